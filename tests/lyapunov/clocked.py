"""Maps as the reset of a constant field: everything about them is known exactly."""

from hybrid import Guard, HybridSystem, Mode, Reset, Transition


def clocked(state, image, **options):
    """The map ``image(t, x, p)`` of the components of ``state``, once per unit of time.

    A clock ``tau`` runs from 0 to 1, and is the last component of the state.
    """
    return HybridSystem(
        state=(*state, "tau"),
        modes=[Mode("wait", lambda t, x, p: (*(0.0 for _ in state), 1.0))],
        transitions=[
            Transition(
                "wait",
                "wait",
                Guard(lambda t, x, p: x.tau - 1.0, +1),
                Reset(lambda t, x, p: (*image(t, x, p), 0.0)),
                name="map",
            )
        ],
        **options,
    )
