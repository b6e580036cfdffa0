"""Every model keeps the laws that it declares, and a mistake in it breaks one of them."""

from contextlib import nullcontext

import attrs
import numpy as np
import pytest

import models
from hybrid import Guard, Laws, Reset
from hybrid.system.graph import laws_of
from hybrid.testing import Case, PropertyError, check_laws, check_system
from hybrid.testing.contacts import COEFFICIENTS, FORCES, IMPACTS
from hybrid.testing.coverage import IMPACTS_OF
from hybrid.testing.crossings import CROSSINGS
from hybrid.testing.dimensions import DIMENSIONS
from hybrid.testing.elastic import ELASTIC
from hybrid.testing.events import JUMPS, SIDES
from hybrid.testing.invariance import CUT
from hybrid.testing.landing import LANDINGS, LIMITS
from hybrid.testing.laws import law_checks
from hybrid.testing.saltation import CONTINUITY, EXTENSION, FLOW_DIRECTION, SALTATION, SUM_RULE
from models.contact import HuntCrossley, KelvinVoigt, Rigid
from models.slider_crank import CORNERS

# The models, and ranges in which they are meant to run.
RUNS = {
    "ball_chain": (
        models.ball_chain(),
        {
            "states": {"q1": (-1.0, 0.0), "q2": (0.1, 0.5), "q3": (0.6, 0.8)},
            "parameters": {"e": (0.3, 1.0), "m1": (0.5, 2.0)},
            "t_span": (0.0, 4.0),
        },
    ),
    "battery_cell": (
        models.battery_cell(),
        {"states": {"s": (0.05, 0.15), "v1": (0.0, 0.1)}, "t_span": (0.0, 130.0)},
    ),
    "bilinear_oscillator": (models.bilinear_oscillator(), {"t_span": (0.0, 7.0)}),
    "boost_converter": (
        models.boost_converter(),
        {"states": {"i": (0.2, 1.2), "v": (12.0, 25.0), "r": 0.0}, "t_span": (0.0, 6e-4)},
    ),
    "bouncing_ball": (models.bouncing_ball(), {"states": {"q": (0.1, 1.0)}, "t_span": (0.0, 1.5)}),
    "bouncing_table": (
        models.bouncing_table(),
        {"states": {"q": (0.001, 0.02), "v": (-0.2, 0.2)}, "t_span": (0.0, 0.6)},
    ),
    "buck_converter": (
        models.buck_converter(),
        {
            "states": {"v": (11.5, 12.8), "i": (0.2, 0.8), "tau": 0.0},
            "parameters": {
                each: models.buck_converter().parameters[each] for each in ("V_L", "V_U", "V_ref")
            },
            "t_span": (0.0, 2e-3),
        },
    ),
    "cam_follower": (
        models.cam_follower(),
        {
            "states": {"q": (0.02, 0.06), "v": (-1.0, 1.0)},
            "parameters": {"w": (38.0, 50.0), "e": (0.1, 0.4)},
            "t_span": (0.0, 0.4),
        },
    ),
    "chua_circuit": (
        models.chua_circuit(),
        {"states": {"x": (-2.0, 2.0), "y": (-0.3, 0.3), "z": (-2.0, 2.0)}, "t_span": (0.0, 6.0)},
    ),
    "coulomb_stick_slip": (models.coulomb_stick_slip(), {"t_span": (0.0, 15.0)}),
    "digital_pwm": (
        models.digital_pwm(),
        {
            "states": {"i": (3.0, 6.0), "d": (0.3, 0.7)},
            "parameters": {"k": (0.05, 0.1)},
            "t_span": (0.0, 2e-3),
        },
    ),
    "dosing_schedule": (
        models.dosing_schedule(),
        {"states": {"A": (0.0, 100.0), "c": (0.0, 3.0)}, "t_span": (0.0, 40.0)},
    ),
    "dry_friction_oscillator": (
        models.dry_friction_oscillator(),
        {
            "examples": 25,
            "states": {"x": (-1.0, 1.0), "v": (-1.0, 1.0)},
            "parameters": {"c": (0.0, 0.2)},
            "t_span": (0.0, 7.0),
        },
    ),
    "delayed_neurons": (
        models.delayed_neurons(),
        {"examples": 25, "states": {"v1": (0.0, 0.9), "v2": (0.0, 0.9)}, "t_span": (0.0, 3.5)},
    ),
    "infusion_schedule": (
        models.infusion_schedule(),
        {"states": {"c": (0.0, 5.0), "r": (0.0, 10.0)}, "t_span": (0.0, 30.0)},
    ),
    "gear_pair": (
        models.gear_pair(),
        {
            "states": {"x": (-1.5, 1.5), "v": (-0.6, 0.6)},
            "parameters": {"kappa": (0.0, 0.3), "e": (0.0, 0.2)},
            "t_span": (0.0, 12.0),
        },
    ),
    "interleaved_converter": (
        models.interleaved_converter(2),
        {
            "states": {"v": (1.0, 5.0), "phase.i": (0.0, 3.0), "phase.w": 0.0, "phase.on": 0.0},
            "parameters": {"k": (0.0, 0.01)},
            "t_span": (0.0, 2e-4),
        },
    ),
    "pulse_coupled_neurons": (
        models.pulse_coupled_neurons(3),
        {"states": {"neuron.u": (0.05, 0.95)}, "t_span": (0.0, 0.7)},
    ),
    "impact_oscillator": (models.impact_oscillator(), {"states": {"x": (-1.0, 0.7)}, "t_span": (0.0, 7.0)}),
    "impact_pair": (models.impact_pair(), {"states": {"x": (-1.5, 1.5)}, "t_span": (0.0, 8.0)}),
    "newtons_cradle": (
        models.newtons_cradle(),
        {
            "states": {"x1": (-0.2, -0.1), "x2": (-0.05, 0.0), "x3": (0.05, 0.1)},
            "parameters": {"e": (0.5, 1.0), "d": (0.0, 0.02)},
            "t_span": (0.0, 2.0),
        },
    ),
    "refractory_neuron": (
        models.refractory_neuron(),
        {"states": {"u": (-70.0, -55.0)}, "t_span": (0.0, 60.0)},
    ),
    "relief_valve": (
        models.relief_valve(),
        {
            "states": {"y": (0.1, 4.0), "v": (-3.0, 3.0), "P": (4.0, 9.9)},
            "parameters": {"q": (0.2, 1.5), "r": (0.05, 0.3)},
            "t_span": (0.0, 4.0),
        },
    ),
    "rimless_wheel": (
        models.rimless_wheel(),
        {"states": {"theta": (-0.25, 0.35), "omega": (-2.0, 2.0)}, "t_span": (0.0, 2.0)},
    ),
    "rocking_block": (
        models.rocking_block(),
        {
            "states": {
                **{"x": 0.0, "y": (1.01, 1.03), "theta": (0.02, 0.1)},
                **{"u": (0.1, 0.3), "v": (-0.3, -0.1), "omega": (0.05, 0.2)},
            },
            "parameters": {"A": (0.0, 0.3), "e": (0.0, 0.5)},
            "t_span": (0.0, 0.5),
            "examples": 4,
        },
    ),
    "sampled_loop": (
        models.sampled_loop(),
        {"states": {"y": (-1.0, 2.0), "u": (-1.0, 1.0), "e": (-1.0, 1.0)}, "t_span": (0.0, 1.5)},
    ),
    "shaken_stack": (
        models.shaken_stack(),
        {
            "states": {
                **{"x1": 0.0, "x2": 0.0, "y1": (0.0, 0.02), "y2": (0.02, 0.04)},
                **{"u1": (-0.3, 0.3), "u2": (-0.3, 0.3), "v1": (-0.3, 0.3), "v2": (-0.3, 0.3)},
            },
            "parameters": {"e": (0.0, 0.5), "A": (0.3, 1.0)},
            "t_span": (0.0, 0.3),
            "examples": 4,
        },
    ),
    "simplest_walker": (
        models.simplest_walker(),
        {
            "states": {
                "theta": (0.15, 0.25),
                "phi": (0.2, 0.5),
                "dtheta": (-0.25, -0.15),
                "dphi": (-0.3, 0.0),
            },
            "t_span": (0.0, 6.0),
        },
    ),
    "slider_crank": (
        models.slider_crank(),
        {
            "examples": 3,
            "states": {
                "theta1": (-0.003, 0.003),
                "theta2": (-0.001, 0.001),
                "theta3": (-0.005, 0.005),
                "w1": (140.0, 160.0),
                "w2": (-80.0, -70.0),
                "w3": (-5.0, 5.0),
            },
            "parameters": {"mu": (0.0, 0.02)},
            "t_span": (0.0, 0.006),
        },
    ),
    "slip_hopper": (
        models.slip_hopper(),
        {
            "states": {"x": (-0.3, 0.3), "y": (0.95, 1.2), "vx": (-4.0, 6.0), "vy": (-1.0, 1.0)},
            "t_span": (0.0, 1.5),
        },
    ),
    "solvable_oscillator": (models.solvable_oscillator(), {"t_span": (0.0, 4.0)}),
    "stick_slip": (
        models.stick_slip(),
        {"examples": 25, "states": {"x": (0.0, 2.0), "v": (-0.5, 1.0)}, "t_span": (0.0, 8.0)},
    ),
    "stop_oscillator": (models.stop_oscillator(), {"parameters": {"F0": (0.0, 0.5)}, "t_span": (0.0, 7.0)}),
    "switched_arrival": (
        models.switched_arrival(),
        {"states": {"x1": (0.1, 0.3), "x2": (0.35, 0.6), "x3": (0.7, 1.0)}, "t_span": (0.0, 8.0)},
    ),
    "three_disk_billiard": (
        models.three_disk_billiard(),
        {
            "states": {"x": (-0.2, 0.2), "y": (-0.2, 0.2)},
            "parameters": {"R": (1.8, 1.95)},
            "t_span": (0.0, 2.0),
        },
    ),
    "verge_escapement": (
        models.verge_escapement(),
        {
            "states": {"theta": (-0.1, 0.1), "phi": (-0.2, 0.2), "w": (-2.0, 2.0), "nu": (-1.0, 1.0)},
            "parameters": {"A": (0.28, 0.32), "e": (0.2, 0.6)},
            "t_span": (0.0, 0.8),
        },
    ),
    "vibroimpact": (
        models.vibroimpact(),
        {
            "states": {"x1": (-0.05, 0.0), "x2": (0.0, 0.05), "v1": (0.2, 0.6), "v2": (-0.3, 0.0)},
            "t_span": (0.0, 0.4),
        },
    ),
    "woodpecker": (
        models.woodpecker(),
        {
            "states": {
                **{"y": 0.0, "phi_M": (-0.1, 0.1), "phi_S": (0.0, 0.1)},
                **{"v": (-0.4, 0.0), "omega_M": (1.0, 3.0), "omega_S": (2.0, 8.0)},
            },
            "parameters": {"e": (0.3, 0.6), "mu": (0.2, 0.4)},
            "t_span": (0.0, 0.04),
            "examples": 4,
        },
    ),
}
# Properties of systems with a continuous event, or of elastic ones.
UNCHECKED = {CONTINUITY, ELASTIC}
# Transitions at times have no guard that the state reaches; the state passes some transitions; some resets
# forget a component.
TIMED = {SIDES, CROSSINGS, CUT, EXTENSION, FLOW_DIRECTION}
# What needs runs with impacts.
OF_CONTACTS = {COEFFICIENTS, FORCES, IMPACTS, LIMITS}
OF_JUMPS = {EXTENSION, FLOW_DIRECTION, JUMPS, LANDINGS, SALTATION}
# Few runs are drawn of bodies with several contacts, whose modes are many.
OF_FEW = {FORCES, IMPACTS, LIMITS, SUM_RULE}
MORE_UNCHECKED = {
    "solvable_oscillator": {CROSSINGS, SIDES},
    "bouncing_table": {CUT},
    "buck_converter": {CUT, SUM_RULE},
    "boost_converter": {CUT, SUM_RULE},
    "delayed_neurons": {CUT},
    "dosing_schedule": TIMED,
    "infusion_schedule": TIMED,
    "sampled_loop": {*TIMED, SUM_RULE},
    "battery_cell": {FLOW_DIRECTION},
    # The age that tangent vectors need has no unit.
    "refractory_neuron": {DIMENSIONS},
    "digital_pwm": {CROSSINGS, CUT, DIMENSIONS, SUM_RULE},
    "interleaved_converter": {CUT},
    "cam_follower": {FLOW_DIRECTION},
    # Its runs are few, since each start in contact has modes of its own; other tests check its contacts.
    "slider_crank": {*OF_CONTACTS, *OF_JUMPS},
    "newtons_cradle": {*OF_FEW, SIDES},
    "rocking_block": OF_FEW,
    "shaken_stack": OF_FEW,
    "woodpecker": OF_FEW,
}
# Few starts lead to these, or few are drawn; a belt carries a block away from where it would slip ahead.
RARE = {
    "dry_friction_oscillator": {"two-fold", "sliding->above"},
    "stick_slip": {"two-fold", "sliding->above"},
    "slider_crank": {f"impacts of contact '{corner}'" for corner in CORNERS},
    **{
        name: {IMPACTS_OF.format(contact) for contact in contacts}
        for name, contacts in {
            "rocking_block": ("left", "right"),
            "shaken_stack": ("1", "2"),
            "woodpecker": ("beak", "lower", "upper"),
        }.items()
    },
}


def test_every_model_declares_laws():
    assert {*models.__all__} <= {*RUNS}


@pytest.mark.parametrize("name", RUNS)
def test_a_model_keeps_its_laws(name):
    system, ranges = RUNS[name]
    report = check_system(system, **{"examples": 8} | ranges)
    laws = {*law_checks(system.laws)}
    assert laws
    assert laws.isdisjoint(report.unchecked)
    assert {*report.unchecked} <= UNCHECKED | MORE_UNCHECKED.get(name, set())
    assert {*report.never_seen} <= RARE.get(name, set())


@pytest.mark.parametrize(
    ("contact", "D", "x0"),
    [
        (Rigid(0.8), 0.05, (-0.03, 0.0, 0.5, 0.0)),
        (HuntCrossley(1e6, 0.5), 0.05, (-0.03, 0.0, 0.5, 0.0)),
        # Strongly damped and pressed together, the bodies touch again before their surfaces have recovered.
        (KelvinVoigt(100.0, 600.0), -0.5, (-0.1, 0.0, 6.0, 0.0)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_bodies_keep_the_laws_of_their_contact(contact, D, x0):
    """A law of a mode or transition that the run does not reach would raise as well."""
    system = models.vibroimpact(contact)
    check_laws(Case(system, {**system.parameters, "D": D}, "free", x0, 0.0, 4.0))


def test_without_preload_the_stops_begin_without_a_force():
    system = models.stop_oscillator()
    names = ("touch right", "leave right", "touch left", "leave left")
    for preload, error in ((0.0, nullcontext()), (0.1, pytest.raises(PropertyError, match="'touch right'"))):
        case = Case(system, {**system.parameters, "F0": preload}, "free", (0.0, 2.0), 0.0, 8.0)
        with error:
            for check in law_checks(Laws(continuous=names)).values():
                check(case)


def changed(elements, name, **changes):
    """The modes or transitions, one of them changed."""
    return [attrs.evolve(each, **changes) if each.name == name else each for each in elements]


def field(system, mode, function):
    return attrs.evolve(system, modes=changed(system.modes, mode, field=function))


def guard(system, transition, function, direction):
    guards = Guard(function, direction)
    return attrs.evolve(system, transitions=changed(system.transitions, transition, guard=guards))


def reset(system, transition, function):
    return attrs.evolve(system, transitions=changed(system.transitions, transition, reset=Reset(function)))


def stop_without_distance(t, x, p):
    return x.v, p.A * np.cos(p.w * t) - p.c * x.v - (p.k + p.ks) * x.x


def swing_leg_kept(t, x, p):
    return -x.theta, -2 * x.theta, np.cos(2 * x.theta) * x.dtheta, x.dphi


def stiffer(system):
    """The field of the contact with one and a half times its force."""
    free, contact = (mode.field for mode in system.modes)
    return lambda t, x, p: tuple(
        (3 * a - b) / 2 for a, b in zip(contact(t, x, p), free(t, x, p), strict=True)
    )


# The model, what is wrong, a start (mode, state and end of the time), and the law that breaks.
MISTAKES = {
    "a ball that keeps its energy": (
        models.bouncing_ball(),
        lambda s: reset(s, "bounce", lambda t, x, p: (0.0, -x.v)),
        ("flight", (1.0, 0.0), 1.0),
        "The rule 'restitution' holds at 'bounce'",
    ),
    "a ball that is not pushed": (
        models.ball_chain(),
        lambda s: reset(s, "right", lambda t, x, p: {"v2": x.v3}),
        ("flight", (0.0, 1.0, 2.0, 0.0, 1.0, 0.0), 2.0),
        "'momentum' is conserved",
    ),
    "a ball at rest that falls": (
        models.bouncing_table(),
        lambda s: field(s, "rest", lambda t, x, p: (0.0, -p.g)),
        ("rest", (0.0, 0.0), 0.02),
        "'velocity' is zero in mode 'rest'",
    ),
    "a stop without its distance": (
        models.stop_oscillator(),
        lambda s: field(s, "right", stop_without_distance),
        ("free", (0.0, 2.0), 2.0),
        "'energy' changes at its rate",
    ),
    "a stiffness that begins late": (
        models.bilinear_oscillator(),
        lambda s: guard(s, "touch", lambda t, x, p: x.x - 0.1, +1),
        ("soft", (-1.0, 2.0), 2.0),
        "'displacement to the left' is non-negative in mode 'soft'",
    ),
    "a belt that holds too long": (
        models.coulomb_stick_slip(),
        lambda s: guard(s, "release", lambda t, x, p: x.x - p.Fs - p.Fk, +1),
        ("stick", (0.0, 0.2), 10.0),
        "'friction in reserve' is non-negative in mode 'stick'",
    ),
    "a server that works for two": (
        models.switched_arrival(),
        lambda s: field(s, "fill1", lambda t, x, p: (p.rho2 + p.rho3, -p.rho2, 0.0)),
        ("fill1", (0.2, 0.3, 0.5), 0.5),
        "'total work' is conserved",
    ),
    "a foot in the wrong place": (
        models.slip_hopper(),
        lambda s: reset(s, "touchdown", lambda t, x, p: {"x": -p.l0 * np.sin(p.alpha)}),
        ("descent", (0.0, 1.0, 5.0, 0.0), 0.5),
        "The rule 'length of the leg' holds at 'touchdown'",
    ),
    "a swing leg that keeps its rate": (
        models.simplest_walker(),
        lambda s: reset(s, "heelstrike", swing_leg_kept),
        ("behind", (0.2003, 0.4006, -0.1998, -0.0158), 5.0),
        "The rule 'angular momentum of the swing leg' holds at 'heelstrike'",
    ),
    "a disk that sends everything back": (
        models.three_disk_billiard(),
        lambda s: reset(s, "disk1", lambda t, x, p: {"vx": -x.vx, "vy": -x.vy}),
        ("flight", (0.3, 0.0, 0.0, 1.0), 5.0),
        "The rule 'angular momentum about its centre' holds at 'disk1'",
    ),
    "a contact with a factor too much": (
        models.vibroimpact(),
        lambda s: field(s, "contact", stiffer(s)),
        ("free", (-0.03, 0.0, 0.5, 0.0), 0.4),
        "'energy' changes at its rate in mode 'contact'",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_breaks_a_law(mistake):
    system, change, (mode, x0, end), law = MISTAKES[mistake]
    check = law_checks(laws_of(system))[law]
    check(Case(system, system.parameters, mode, x0, 0.0, end))
    with pytest.raises(PropertyError) as caught:
        check(Case(change(system), system.parameters, mode, x0, 0.0, end))
    assert str(caught.value).startswith(f"{law}: this does not hold")
