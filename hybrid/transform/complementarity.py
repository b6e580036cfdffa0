"""Linear complementarity systems: ideal diodes and whatever else is never negative become a hybrid system."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Unpack

import numpy as np

from hybrid import arguments
from hybrid.errors import ModelError
from hybrid.shared import shares
from hybrid.system.declared import as_parameters, as_state
from hybrid.system.elements import Function, Mode
from hybrid.system.graph import HybridSystem
from hybrid.system.outputs import as_outputs
from hybrid.system.variables import Variables
from hybrid.system.watched import Watched
from hybrid.transform.asked import Described, passed_on
from hybrid.transform.pairs.pair import Pair

# All sets of pairs are tried.
MOST_PAIRS = 10


@shares(Described)
def complementarity(
    *,
    state: tuple[str, ...] | int,
    rates: Function,
    pairs: Iterable[Pair],
    parameters: Mapping[str, float] | None = None,
    modes: Mapping[str, Any] | None = None,
    **asked: Unpack[Described],
) -> HybridSystem:
    """The hybrid system of equations with ideal diodes, or with other pairs of which one is zero.

    The equations are ``x' = f(t, x, z, p)`` and ``w = g(t, x, z, p)``, both affine in ``z``, and for each
    pair ``w >= 0``, ``z >= 0`` and ``w z = 0``. Which ``z`` are positive, when that changes and what the
    state does then is derived. The result is an ordinary `HybridSystem`, whose modes are made when a run
    first needs them.

    Parameters
    ----------
    state, parameters
        As for `HybridSystem`.
    rates
        ``f(t, x, z, p)``, the ``n`` derivatives. Unknowns are read by the names of pairs, as in ``z.diode``.
        A switch that follows a clock is ``np.where`` on ``np.mod`` of time, as for `from_equations`.
    pairs
        `Pair` objects, at most ten.
    modes
        Names for what clocks switch, as for `split`:
        ``{"on": lambda t, x, p: np.mod(t, p.T) < p.D * p.T}``.

    Returns
    -------
    HybridSystem
        Modes are named by the pairs whose ``z`` may be positive: ``free``, ``d1``, ``d1+d3``; behind what
        clocks have switched, as in ``on: d1``. Outputs ``d1.w`` and ``d1.z`` are the two quantities of a
        pair. ``arc.jumps["d1.w"]`` are the instants at which ``w`` of a pair becomes zero; where those of
        several do together, the name is that of all, ``d1.w, d3.z``. A run ends (TERMINAL) with a jump ``no
        solution`` where no ``z`` keeps all ``w`` from becoming negative, and with ``not unique`` where
        several motions agree with all pairs.

    Raises
    ------
    ModelError
        If a function cannot be traced, has the wrong number of values, is not affine in ``z``, or has a kink
        or a jump that is no clock; if the factors of ``z`` in ``w`` depend on the state; if neither ``w`` of
        a pair nor its rate depends on any ``z``, as for the gap of a contact: `mechanics` does these.

    Notes
    -----
    *Modes.* With the active pairs ``A``, those with ``w = 0``, the equations for their ``z`` are ``w_A = 0``.
    Where these do not determine ``z``, some combinations of ``w_A`` are functions of the state: they are held
    at zero, and ``z`` follows from their rates (index one). A pair is left in the direction in which the
    value, or the first of its derivatives in time that is not zero, is negative.

    *Jumps.* Where no motion goes on from a state, impulses of ``z >= 0`` bring what can be held to zero, as
    for two capacitors that a diode joins: ``x+ = x + B Z``.

    *None and several.* All cases are tried at the state at which this is asked. Cases with the same motion
    count as one; the ``z`` and ``w`` in which they differ are nan.

    References
    ----------
    W. P. M. H. Heemels, J. M. Schumacher, S. Weiland, Linear complementarity systems, SIAM Journal on Applied
    Mathematics 60, 2000, doi:10.1137/S0036139997325199.
    M. K. Camlibel, W. P. M. H. Heemels, J. M. Schumacher, On linear passive complementarity systems, European
    Journal of Control 8, 2002, doi:10.3166/ejc.8.220-237.
    V. Acary, O. Bonnefon, B. Brogliato, Nonsmooth Modeling and Simulation for Switched Circuits, Springer,
    2011, doi:10.1007/978-90-481-9681-4.

    Examples
    --------
    A diode, a coil and a resistance at a sine: ``z`` is the voltage that the diode blocks.

    >>> import numpy as np
    >>> from hybrid import Pair, complementarity, simulate
    >>> rectifier = complementarity(
    ...     state=("i",),
    ...     parameters={"R": 1.0, "L": 1.0},
    ...     rates=lambda t, x, z, p: ((np.sin(t) - p.R * x.i + z.diode) / p.L,),
    ...     pairs=[Pair("diode", w=lambda t, x, z, p: x.i, says="blocks")],
    ... )
    >>> arc = simulate(rectifier, (0.0,), (0.0, 2 * np.pi))
    >>> [str(mode) for mode in dict.fromkeys(arc.mode)], round(float(arc.jumps["diode.w"][0].t), 4)
    (['free', 'diode blocks'], 3.9407)
    """
    # SymPy is slow to import, so it is not imported with the library.
    from hybrid.transform.deciding import Origin
    from hybrid.transform.pairs.equations import Equations
    from hybrid.transform.pairs.growth import PairGrowth
    from hybrid.transform.pairs.judge import Judge

    arguments.function("complementarity: rates", rates, "(t, x, z, p)")
    found = _checked(pairs)
    values = as_parameters({} if parameters is None else parameters)
    components = as_state(state)
    variables = Variables(components, values)
    if not variables.dimension:
        raise ModelError("complementarity: state must have at least one component; got none.")
    equations = Equations(variables, rates, found, modes)
    judge = Judge(equations)
    _check_degrees(judge)
    given_outputs = {} if asked["outputs"] is None else asked["outputs"]
    own = as_outputs(given_outputs, "complementarity")
    told = {f"{each.name}.{what}": _free_of_pairs for each in found for what in ("w", "z")}
    taken = sorted(own.keys() & told.keys())
    if taken:
        raise ModelError(f"complementarity: outputs: {taken[0]!r} is told of a pair. Choose another name.")
    original = HybridSystem(
        state=components,
        parameters=values,
        modes=[Mode("free", _without_pairs(equations))],
        transitions=[],
        **{**passed_on(asked), "outputs": {**own, **as_outputs(told)}},
        derived_from=Watched([rates, *(each.w for each in found)]),
    )
    called = {
        **{"state": state, "rates": rates, "pairs": found, "parameters": parameters, "modes": modes},
        **asked,
    }
    return PairGrowth(judge, original, Origin(complementarity, called)).current


def _checked(pairs: Iterable[Pair]) -> tuple[Pair, ...]:
    found = tuple(arguments.items("complementarity: pairs", pairs, "be a list of Pair objects", least=1))
    for i, each in enumerate(found):
        arguments.instance(f"complementarity: pairs[{i}]", each, Pair)
    names = [each.name for each in found]
    if len(set(names)) < len(names):
        raise ModelError(f"complementarity: pairs must have names of their own; got {', '.join(names)}.")
    if len(found) > MOST_PAIRS:
        raise ModelError(
            f"complementarity: pairs must be at most {MOST_PAIRS}, because all sets of them are tried; got "
            f"{len(found)}. Divide the model, or write its modes as a HybridSystem."
        )
    return found


def _free_of_pairs(t: Any, x: Any, p: Any) -> float:
    """Stands for a quantity of a pair until modes are made."""
    return 0.0


def _without_pairs(equations: Any) -> Function:
    from hybrid.expression.evaluation import expressed

    return expressed(equations.configuration(next(equations.all_sides())).a)


def _check_degrees(judge: Any) -> None:
    """A ModelError if neither ``w`` of a pair nor its rate depends on any ``z``."""
    from hybrid.transform.pairs.regime import shape_of

    equations = judge.equations
    variables = equations.variables
    place = 0.0, np.ones(variables.dimension), variables.defaults
    told = set[int]()
    for sides in equations.all_sides():
        numbers = equations.configuration(sides).at(place)
        for active in judge.cases():
            if not told.issuperset(active) and shape_of(numbers, active) is not None:
                told.update(active)
    missing: Sequence[Pair] = [each for i, each in enumerate(equations.pairs) if i not in told]
    if missing:
        raise ModelError(
            f"{missing[0].title}: neither w nor its rate depends on z, so that no z keeps w from becoming "
            "negative (relative degree two or more). For bodies that touch use mechanics; in a circuit take "
            "as w what z acts on at once, or whose rate it changes."
        )
