"""States on a circle: orbits close up to whole turns of the angles that a system declares."""

import attrs
import numpy as np
import pytest

from hybrid import (
    Guard,
    HybridSystem,
    Mode,
    ModelError,
    Reset,
    Transition,
    continue_orbit,
    open_branch,
    periodic_orbit,
)
from hybrid.testing import PropertyError, check_system

TURN = 2 * np.pi


def rotor(angles=None, length=TURN):
    """Adler's equation: a turn takes ``2 pi / sqrt(w^2 - a^2)``."""
    return HybridSystem(
        state=("phi",),
        parameters={"w": 1.25, "a": 0.75},
        modes=[Mode("runs", lambda t, x, p: ((p.w - p.a * np.sin(TURN / length * x.phi)) * length / TURN,))],
        angles={"phi": length} if angles is None else angles,
    )


@pytest.mark.parametrize("length", [TURN, 360.0, 1.0])
@pytest.mark.parametrize("turns", [1, 2])
def test_the_period_of_a_rotor(turns, length):
    orbit = periodic_orbit(rotor(length=length), (0.3,), period=6.2 * turns)
    assert orbit.status.ok
    assert orbit.period == pytest.approx(TURN * turns, rel=1e-10)
    assert orbit.turns == {"phi": turns}
    assert orbit.residual < 1e-9 * length
    assert orbit.multipliers == pytest.approx([1.0])


def test_an_angle_that_is_not_declared_is_named():
    orbit = periodic_orbit(rotor({}), (0.3,), period=6.28)
    assert not orbit.status.ok
    assert "declare it with HybridSystem(angles={'phi': 2 * np.pi})." in orbit.status.remedy
    assert orbit.turns == {}


def test_a_component_that_is_no_angle_is_not_named():
    """Its rate depends on it otherwise."""
    line = HybridSystem(state=("q",), modes=[Mode("m", lambda t, x, p: (2.0 + np.sin(1.3 * x.q),))])
    assert "angles=" not in periodic_orbit(line, (0.3,), period=6.28).status.remedy


def kicked(e=0.5):
    """A wheel that keeps the share ``e`` of its rate at each turn and gets 1: its rate is 1 / (1 - e)."""
    return HybridSystem(
        state=("phi", "w"),
        parameters={"e": e},
        modes=[Mode("free", lambda t, x, p: (x.w, 0.0 * x.w))],
        transitions=[
            Transition(
                "free",
                "free",
                Guard(lambda t, x, p: np.sin(x.phi), direction=+1, when=lambda t, x, p: np.cos(x.phi) > 0),
                Reset(lambda t, x, p: {"w": p.e * x.w + 1.0}),
                name="kick",
            )
        ],
        angles={"phi": TURN},
    )


# The turns that the angle counts already have no influence.
@pytest.mark.parametrize("before", [0, -3, 1000])
def test_an_orbit_with_jumps_and_its_branch(before):
    orbit = periodic_orbit(kicked(), (1.0 + TURN * before, 1.9), period=3.1)
    assert orbit.status.ok
    assert orbit.turns == {"phi": 1}
    assert orbit.period == pytest.approx(np.pi, rel=1e-10)
    assert np.sort(orbit.multipliers.real) == pytest.approx([0.5, 1.0], rel=1e-8)
    branch = continue_orbit(orbit, "e", (0.2, 0.8))
    assert branch.status.ok
    np.testing.assert_allclose(branch.period, TURN * (1 - branch.parameter), rtol=1e-9)
    assert len(branch.parameter) < 60
    assert branch.orbit(-1).turns == {"phi": 1}
    again = open_branch(kicked(), branch.to_xarray()).orbit(0)
    assert again.turns == {"phi": 1}
    assert again.residual < 1e-8


def test_a_wrong_turn_is_refused():
    wrong = rotor({})
    with pytest.raises(
        ModelError, match=r"angles: 'phi' is no angle with a turn of 3.*Mode 'runs': field is"
    ):
        attrs.evolve(wrong, angles={"phi": 3.0})
    with pytest.raises(ModelError, match="angles: State component 'psi' does not exist"):
        attrs.evolve(wrong, angles={"psi": TURN})


def test_a_reset_may_add_turns():
    def wrapped(back):
        return HybridSystem(
            state=("phi",),
            modes=[Mode("m", lambda t, x, p: (1.0,))],
            transitions=[
                Transition(
                    "m",
                    "m",
                    Guard(lambda t, x, p: np.sin(0.5 * x.phi) ** 2 - 0.5),
                    Reset(lambda t, x, p: (x.phi + back,)),
                )
            ],
            angles={"phi": TURN},
        )

    assert wrapped(-TURN).angles == {"phi": TURN}
    assert wrapped(0.5).angles == {"phi": TURN}


def test_the_checks_of_a_system_find_a_turn_that_holds_at_the_declared_parameters_alone():
    """The field has the frequency ``k``, which is 1 as declared."""
    system = HybridSystem(
        state=("phi",),
        parameters={"k": 1.0},
        modes=[Mode("m", lambda t, x, p: (1.5 + np.sin(p.k * x.phi),))],
        angles={"phi": TURN},
    )
    with pytest.raises(PropertyError, match="A turn of an angle changes no function"):
        check_system(system, examples=5)
    report = check_system(rotor(), examples=5)
    assert "A turn of an angle changes no function" not in report.unchecked
