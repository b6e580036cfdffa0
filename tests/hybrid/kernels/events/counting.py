"""Systems whose transitions count the crossings of their guards, and go round between equal modes."""

from hybrid import Guard, HybridSystem, Mode, Reset, Transition


def counting(names, field, guards, directions, modes, parameters):
    """A system with the state ``names``, followed by one counter for each guard.

    ``field`` gives the rates of the named components in every mode. Each crossing of a guard in its direction
    adds one to its counter and, with several modes, leads to the next.
    """
    first, number = len(names), len(guards)

    def rates(t, x, p):
        return (*field(t, x, p), *[0.0] * number)

    def transition(mode, i):
        def count(t, x, p):
            return tuple(x[k] + (1.0 if k == first + i else 0.0) for k in range(first + number))

        source, target = f"mode {mode}", f"mode {(mode + 1) % modes}"
        guard = Guard(guards[i], direction=directions[i])
        return Transition(source, target, guard, Reset(count), name=f"{i} in {mode}")

    return HybridSystem(
        state=(*names, *(f"n{i}" for i in range(number))),
        parameters=parameters,
        modes=[Mode(f"mode {mode}", rates) for mode in range(modes)],
        transitions=[transition(mode, i) for mode in range(modes) for i in range(number)],
    )
