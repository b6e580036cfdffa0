"""The note on crossings that are not proved names the transitions, and says nothing of those that are."""

import numpy as np

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate

BALLS = 5


def test_pendulums_that_touch_at_rest_are_no_doubt_of_their_contacts():
    """After one and a half periods the last of the balls is as high as the first one was."""

    def hit(i):
        return Transition(
            "swing",
            "swing",
            Guard(lambda t, x, p: x[i + 1] - x[i], -1),
            Reset(lambda t, x, p: (*x[: BALLS + i], x[BALLS + i + 1], x[BALLS + i], *x[BALLS + i + 2 :])),
            name=f"hit{i}",
        )

    cradle = HybridSystem(
        state=tuple(f"{name}{i}" for name in "qv" for i in range(BALLS)),
        modes=[Mode("swing", lambda t, x, p: (*x[BALLS:], *(-q for q in x[:BALLS])))],
        transitions=[hit(i) for i in range(BALLS - 1)],
    )
    arc = simulate(cradle, (-1.0, *[0.0] * (2 * BALLS - 1)), (0.0, 3 * np.pi))
    assert arc.status.message == "Reached the end."
    np.testing.assert_allclose(np.abs(arc.x[-1]), np.eye(2 * BALLS)[BALLS - 1], atol=1e-7)


def test_of_several_guards_the_one_that_is_in_doubt_is_named():
    """A guard that only bounds on very short pieces keep from zero, beside one that is far from it."""
    system = HybridSystem(
        state=("x",),
        modes=[Mode("m", lambda t, x, p: (-x.x,))],
        transitions=[
            Transition("m", "m", Guard(lambda t, x, p: x.x - 0.5, 1), name="plain"),
            Transition(
                "m",
                "m",
                Guard(lambda t, x, p: (np.sin(1e7 * x.x) + 2) * (np.cos(1e7 * x.x) + 2) - 1.2 * x.x, -1),
                name="near",
            ),
        ],
    )
    message = simulate(system, (1.0,), (0.0, 0.1)).status.message
    assert "Not all crossings of 'near' are proved" in message
