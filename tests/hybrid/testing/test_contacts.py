"""Systems with contacts are checked as others are, and what a user may get wrong in one is found."""

import re

import numpy as np
import pytest
from hypothesis import given

from hybrid import Contact, Guard, HybridSystem, Laws, Mode, Transition, mechanics, simulate
from hybrid.system.growth import finished
from hybrid.testing import (
    Case,
    PropertyError,
    cases,
    check_coefficients,
    check_contact_forces,
    check_derivatives,
    check_dimensions,
    check_gaps,
    check_impacts,
    check_laws,
    check_reads,
    check_system,
    run_settings,
)
from hybrid.testing.contacts import COEFFICIENTS, FORCES, GAPS, IMPACTS, gains_on
from hybrid.testing.variants import altered, new_name, renamed
from tests.hybrid.transform.contacts.scenes import G, ball, beam, block

NEAR = {"y": (0.1, 2.0)}
UNITS = {"x": "m", "y": "m", "u": "m/s", "v": "m/s", "t": "s", "m": "kg", "g": "m/s^2"}


def thrown(units=None, forces=None, **contact):
    """A block of mass ``m`` that is thrown onto a floor."""
    given = {
        "gap": lambda t, x, p: x.y,
        "slip": lambda t, x, p: x.u,
        "restitution": "e",
        "friction": "mu",
    }
    return mechanics(
        coordinates=("x", "y"),
        velocities=("u", "v"),
        parameters={"m": 2.0, "g": G, "e": 0.5, "mu": 0.3},
        mass=lambda t, x, p: (p.m, p.m),
        forces=forces or (lambda t, x, p: (0.0, -p.m * p.g)),
        contacts=[Contact("floor", **{**given, **contact})],
        units=units,
    )


def thrown_case(system, start=(0.0, 1.0, 1.5, 0.0)):
    return Case(system, dict(system.parameters), "free", start, 0.0, 2.0)


@pytest.mark.parametrize("factory", [ball, beam, block])
def test_right_models_have_every_property(factory):
    report = check_system(factory(), examples=12)
    names = {each.name for each in report.properties if each.checked}
    assert {COEFFICIENTS, GAPS, FORCES, IMPACTS} <= names
    assert not report.never_seen
    assert not report.dead_ends
    assert not report.gains


def test_other_systems_are_not_asked():
    system = HybridSystem(state=("q",), modes=[Mode("only", lambda t, x, p: (-x.q,))], transitions=[])
    report = check_system(system, states={"q": (0.5, 1.0)}, examples=2)
    assert GAPS not in {each.name for each in report.properties}


class TestMistakes:
    @pytest.mark.parametrize(
        ("contact", "told"),
        [
            ({"friction": lambda t, x, p: p.mu - 0.2 * x.x}, "friction is -0.*, and must not be negative"),
            (
                {"restitution": lambda t, x, p: p.e * (1.5 + x.u**2)},
                "restitution is 1.875, and must lie between 0 and 1",
            ),
            (
                {"static": lambda t, x, p: p.mu * (1.0 + 0.3 * (2.0 - x.x))},
                r"static friction is 0\.1\d*, and must be no smaller than kinetic friction, 0.3",
            ),
            ({"slip": lambda t, x, p: -2.0 * x.v}, "slip is a multiple of the rate of the gap"),
        ],
        ids=["friction", "restitution", "static", "slip"],
    )
    def test_what_no_contact_can_have(self, contact, told):
        with pytest.raises(PropertyError, match=told) as failure:
            check_coefficients(thrown_case(thrown(**contact), (3.0, 1.0, 1.5, 0.0)))
        assert str(failure.value).startswith(COEFFICIENTS)

    def test_a_gain_of_energy(self):
        """A speed that grows by a tenth at an impact: the energy by 0.21 of what it was."""
        system = thrown(restitution=lambda t, x, p: p.e + 0.6 + x.x, friction=0.0)
        case = thrown_case(system, (0.0, 1.0, 0.0, 0.0))
        with pytest.raises(PropertyError, match="is gained") as failure:
            check_impacts(case)
        gained, before = map(
            float, re.search(r"of (\S+) is gained, and it was (\S+);", str(failure.value)).groups()
        )
        assert gained / before == pytest.approx(0.21, rel=1e-5)

    def test_a_gap_of_the_wrong_sign(self):
        with pytest.raises(PropertyError, match="negative at 4 of 4 drawn starts, and positive at none"):
            check_system(thrown(gap=lambda t, x, p: -x.y), states=NEAR, examples=4)

    def test_a_gap_that_jumps(self):
        step = thrown(gap=lambda t, x, p: x.y - np.where(x.x > 0.6, 0.5, 0.0))
        with pytest.raises(PropertyError, match="may not jump"):
            check_gaps(thrown_case(step))

    def test_friction_that_drives(self):
        with pytest.raises(PropertyError, match=r"it drives|is possible"):
            check_contact_forces(
                thrown_case(thrown(friction=lambda t, x, p: -p.mu - 1e-6 * x.x, restitution=0.0))
            )

    def test_gravity_that_is_given_twice_breaks_the_energy(self):
        twice = mechanics(
            coordinates=("y",),
            velocities=("v",),
            parameters={"m": 2.0, "g": G},
            kinetic=lambda t, x, p: 0.5 * p.m * x.v**2,
            potential=lambda t, x, p: p.m * p.g * x.y,
            forces=lambda t, x, p: (-p.m * p.g,),
            contacts=[Contact("floor", gap=lambda t, x, p: x.y, restitution=0.5)],
        )
        energy = {"energy": lambda t, x, p: 0.5 * p.m * x.v**2 + p.m * p.g * x.y}
        with pytest.raises(PropertyError, match="'energy' never grows"):
            check_system(twice, laws=Laws(dissipated=energy), states=NEAR, examples=3)

    def test_a_parameter_that_no_contact_reads(self):
        with pytest.raises(PropertyError, match="no function reads parameter 'e'"):
            check_reads(thrown(restitution=0.5))
        check_reads(thrown())


class TestUnits:
    def test_those_of_a_right_model_fit(self):
        check_dimensions(thrown(UNITS))

    @pytest.mark.parametrize(
        ("wrong", "told"),
        [
            ({"forces": lambda t, x, p: (0.0, -p.g)}, "field of mode 'free': the derivative of v"),
            ({"slip": lambda t, x, p: x.u * p.m}, "slip of contact 'floor': the slip"),
            ({"restitution": "m"}, "restitution of contact 'floor': the coefficient"),
        ],
        ids=["forces", "slip", "restitution"],
    )
    def test_those_of_a_wrong_model_do_not(self, wrong, told):
        with pytest.raises(PropertyError, match=told):
            check_dimensions(thrown(UNITS, **wrong))


def arms(impacts):
    """Kane's double pendulum, whose tip gains energy by friction with Newton's law."""
    return mechanics(
        coordinates=("a", "b"),
        velocities=("u", "w"),
        kinetic=lambda t, x, p: 0.5 * (4.0 * x.u**2 / 3.0 + x.u * x.w * np.cos(x.a - x.b) + x.w**2 / 3.0),
        contacts=[
            Contact(
                "floor",
                gap=lambda t, x, p: np.cos(np.pi / 9) + np.cos(np.pi / 6) - np.cos(x.a) - np.cos(x.b),
                slip=lambda t, x, p: np.cos(x.a) * x.u + np.cos(x.b) * x.w,
                friction=0.7,
                restitution=0.5,
            )
        ],
        impacts=impacts,
    )


def test_what_newtons_law_gains_is_told_and_no_failure():
    found = {}
    for law in ("newton", "poisson"):
        case = Case(arms(law), {}, "free", (np.pi / 9 + 0.01, np.pi / 6 + 0.02, -0.1, -0.2), 0.0, 0.3)
        check_impacts(case)
        found[law] = list(gains_on(case))
    assert found["newton"]
    assert not found["poisson"]


def test_a_moving_table_gives_energy():
    table = mechanics(
        coordinates=("y",),
        velocities=("v",),
        mass=lambda t, x, p: (1.0,),
        forces=lambda t, x, p: (-G,),
        contacts=[Contact("table", gap=lambda t, x, p: x.y - 0.2 * np.sin(5.0 * t), restitution=0.9)],
    )
    case = Case(table, {}, "free", (1.0, 0.0), 0.0, 3.0)
    jumps = case.whole.jumps["table"]
    assert any(abs(each.x_plus[1]) > abs(each.x_minus[1]) for each in jumps)
    check_impacts(case)
    check_gaps(case)


class TestDrawnStarts:
    @run_settings
    @given(cases(beam(), t_span=(0.0, 1.0)))
    def test_the_start_tells_the_mode(self, case):
        """A foot is held if its gap and its rate are zero, and none overlaps."""
        if case.mode is None:
            return
        y, phi, v, w = case.x0
        b = case.parameters["b"]
        for name, side in (("left", -1.0), ("right", 1.0)):
            gap, rate = y + side * b * phi, v + side * b * w
            assert gap >= -1e-9
            assert (name in case.mode) <= (abs(gap) < 1e-9 and abs(rate) < 1e-9)

    def test_the_system_of_a_case_has_the_modes_of_its_run(self):
        seen = set()

        @run_settings
        @given(cases(block(), t_span=(0.0, 1.0)))
        def see(case):
            if case.mode is not None:
                assert case.whole.status.ok
                seen.update(map(str, np.unique(case.whole.mode)))

        see()
        assert {"free", "floor sticks"} <= seen


class TestStages:
    def test_what_is_made_from_a_system_has_its_modes(self):
        grown = simulate(block(), (0.0, 1.0, 1.0, 0.0), (0.0, 3.0)).system
        names = set(grown.mode_names)
        assert names <= set(altered(grown).system.mode_names)
        assert {new_name(grown.mode_names, name) for name in names} == set(renamed(grown).mode_names)

    def test_a_finished_stage_is_one_object_that_goes_no_further(self):
        system = block()
        first = finished(system)
        assert finished(system) is first
        assert finished(first) is first
        simulate(system, (0.0, 1.0, 1.0, 0.0), (0.0, 3.0))
        arc = simulate(first, (0.0, 1.0, 1.0, 0.0), (0.0, 3.0), mode="free")
        assert arc.system is first
        assert arc.t[-1] == pytest.approx(np.sqrt(2.0 / G), rel=1e-12)


def test_a_guard_that_runs_replace_by_a_plain_one_is_no_slip_in_a_derivative():
    cubic = HybridSystem(
        state=("q",),
        modes=[Mode("a", lambda t, x, p: (1.0,)), Mode("b", lambda t, x, p: (1.0,))],
        transitions=[Transition("a", "b", Guard(lambda t, x, p: (x.q - 1.0) ** 3, +1))],
    )
    check_derivatives(Case(cubic, {}, "a", (0.4,), 0.0, 1.0))


def test_a_case_that_a_user_writes_has_the_modes_that_its_run_makes():
    system = thrown()
    case = Case(system, system.parameters, "free", (0.0, 1.0, 1.0, 0.0), 0.0, 1.5)
    for check in (check_gaps, check_contact_forces, check_impacts, check_laws):
        check(case)
