"""The last impacts before a limit are slow, and yet no grazings: all orbits nearby hit the floor as well."""

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate


def test_a_complete_chatter_has_no_grazing():
    ball = HybridSystem(
        state=("q", "v"),
        modes=[Mode("flight", lambda t, x, p: (x.v, -10.0)), Mode("rest", lambda t, x, p: (0.0, 0.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (0.0, -0.1 * x.v)),
                accumulates_to="rest",
            )
        ],
    )
    arc = simulate(ball, (5.0, 0.0), (0.0, 3.0), mode="flight", tangent=True)
    assert arc.mode[-1] == "rest"
    assert arc.status.ok
    assert "grazed" not in arc.status.message
