"""Functions that do not fit the units of their system are found; right models are left alone."""

import attrs
import numpy as np
import pytest
from hypothesis.errors import UnsatisfiedAssumption

import hybrid
import models
from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import PropertyError
from hybrid.testing.dimensions import check_dimensions, unit_of
from models.contact import Rigid, matched_laws

UNITS = {
    "q": "m", "v": "m/s", "t": "s", "m": "kg", "k": "N/m", "c": "N s/m", "F": "N", "w": "rad/s", "d": "mm",
    "alpha": "deg", "phi": "rad", "T": "ms", "L": "m", "n": "rpm", "f": "Hz", "g": "m/s^2", "share": "%",
}  # fmt: skip
PARAMETERS = {name: 1.0 for name in UNITS if name not in ("q", "v", "t")} | {"e": 0.5}


def force(t, x, p):
    return p.F * np.cos(p.w * t) - p.k * x.q - p.c * x.v


def spring(t, x, p):
    return -p.k / p.m * x.q


def swing(
    rate=lambda t, x, p: force(t, x, p) / p.m,
    *,
    speed=lambda t, x, p: x.v,
    guard=lambda t, x, p: x.q - p.L,
    when=lambda t, x, p: x.v,
    reset=lambda t, x, p: (x.q, -p.e * x.v),
    period=None,
    units=None,
):
    """A driven oscillator with a wall, one of whose functions a test replaces."""
    return HybridSystem(
        name="swing",
        state=("q", "v"),
        parameters=PARAMETERS,
        units=UNITS | (units or {}),
        modes=[Mode("free", lambda t, x, p: (speed(t, x, p), rate(t, x, p)))],
        transitions=[Transition("free", "free", Guard(guard, when=when), Reset(reset), name="wall")],
        period=period,
    )


def fault_of(system):
    with pytest.raises(PropertyError) as caught:
        check_dimensions(system)
    first, *lines, likely = str(caught.value).splitlines()
    assert first == "The units of every function fit: this does not hold for swing."
    assert likely.startswith("  likely: a factor or a power that is missing")
    assert likely.endswith("Parameters without a unit count as pure numbers: e.")
    return "\n".join(line.removeprefix("  ") for line in lines)


FIELD, GUARD, WHEN, RESET = (
    "field of mode 'free': ",
    "guard of transition 'wall': ",
    "condition of transition 'wall': ",
    "reset of transition 'wall': ",
)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"rate": force},
            FIELD + "the derivative of v is in N (p.F, p.w, t, p.k, x.q, p.c, x.v), wanted m / s^2",
        ),
        ({"rate": lambda t, x, p: -np.sin(p.phi)}, FIELD + "the derivative of v is a pure number (p.phi), "),
        ({"speed": lambda t, x, p: 2 * x.q}, FIELD + "the derivative of q is in m (x.q), wanted m / s"),
        (
            {"rate": lambda t, x, p: p.F / p.m + p.w * x.q},
            FIELD + "N / kg (p.F, p.m) is added to m * rad / s (p.w, x.q)",
        ),
        ({"rate": lambda t, x, p: p.g * np.sin(p.alpha)}, FIELD + "sin of deg (p.alpha)"),
        ({"rate": lambda t, x, p: p.g * np.sin(p.n * t)}, FIELD + "sin of rpm * s (p.n, t)"),
        ({"rate": lambda t, x, p: p.g * np.exp(-p.share)}, FIELD + "exp of % (p.share)"),
        ({"rate": lambda t, x, p: p.g * np.exp(-t / p.T)}, FIELD + "exp of s / ms (t, p.T)"),
        ({"rate": lambda t, x, p: p.g * np.log(x.q)}, FIELD + "log of m (x.q)"),
        ({"rate": lambda t, x, p: x.v / p.T}, FIELD + "the derivative of v is in m / ms / s (x.v, p.T), "),
        ({"guard": lambda t, x, p: x.q - p.d}, GUARD + "mm (p.d) is subtracted from m (x.q)"),
        ({"guard": lambda t, x, p: x.q + t}, GUARD + "m (x.q) is added to s (t)"),
        ({"guard": lambda t, x, p: x.q - p.e}, GUARD + "a pure number (p.e) is subtracted from m (x.q)"),
        ({"guard": lambda t, x, p: np.hypot(x.q, x.v)}, GUARD + "hypot of m (x.q) and m / s (x.v)"),
        ({"guard": lambda t, x, p: np.arctan2(x.v, x.q)}, GUARD + "arctan2 of m / s (x.v) and m (x.q)"),
        ({"guard": lambda t, x, p: np.maximum(x.q, p.d)}, GUARD + "maximum of m (x.q) and mm (p.d)"),
        ({"guard": lambda t, x, p: np.mod(t, p.T) - 1}, GUARD + "remainder of s (t) and ms (p.T)"),
        ({"guard": lambda t, x, p: np.clip(x.q, -1, p.d)}, GUARD + "minimum of m (x.q) and mm (p.d)"),
        (
            {"guard": lambda t, x, p: np.where(x.v > 0, x.q, p.d)},
            GUARD + "a choice between m (x.q) and mm (p.d)",
        ),
        ({"when": lambda t, x, p: x.v > p.L}, WHEN + "m / s (x.v) is compared with m (p.L)"),
        ({"reset": lambda t, x, p: (x.v, x.q)}, RESET + "the new q is in m / s (x.v), wanted m\n"),
        ({"reset": lambda t, x, p: {"v": p.w * x.v}}, RESET + "the new v is in m * rad / s^2 (p.w, x.v), "),
        ({"period": lambda p: 2 * p.w, "rate": spring}, "period: the value is in rad / s (p.w), wanted s"),
        ({"period": lambda p: p.T, "rate": spring}, "period: the value is in ms (p.T), wanted s"),
        ({"units": {"k": "N"}}, FIELD + "m * N (p.k, x.q) is subtracted from N (p.F, p.w, t)"),
        ({"units": {"v": "mm/s"}}, FIELD + "mm * N / m (p.c, x.v) is subtracted from N "),
    ],
)
def test_an_error_is_told_by_name(changes, told):
    assert (fault_of(swing(**changes)) + "\n").startswith(told)


def test_each_fault_is_told_once_and_the_first_five_are_told():
    system = swing(
        lambda t, x, p: sum(np.sin(one) * x.v / t for one in (x.q, x.v, t, p.m, p.k, p.c)),
        when=lambda t, x, p: x.q,
    )
    again = attrs.evolve(
        system, transitions=[*system.transitions, attrs.evolve(system.transitions[0], name="b")]
    )
    lines = fault_of(again).splitlines()
    assert lines[0] == FIELD + "sin of m (x.q)"
    assert lines[4:] == [FIELD + "sin of N / m (p.k)", "and 1 more"]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"rate": lambda t, x, p: 9.81},
        {"rate": lambda t, x, p: -9.81 + 0.5 * p.g},
        {"rate": lambda t, x, p: -p.g * np.sin(np.radians(p.alpha)) + p.g * np.sin(p.alpha * np.pi / 180)},
        {"rate": lambda t, x, p: p.g * np.cos(np.deg2rad(p.alpha) + p.phi)},
        {"rate": lambda t, x, p: p.g * np.sin(np.radians(np.degrees(p.phi) + p.alpha))},
        {"rate": lambda t, x, p: p.g * np.cos(2 * np.pi * p.n / 60 * t) + p.g * np.cos(2 * np.pi * p.f * t)},
        {"rate": lambda t, x, p: p.g * np.sin(np.radians(p.e)) * np.arcsin(p.e)},
        {"rate": lambda t, x, p: p.g * np.exp(-1e3 * t / p.T) * (1 - p.e)},
        {"rate": lambda t, x, p: -p.e * np.sign(x.v - 0.1) * p.g},
        {"rate": lambda t, x, p: np.where(x.q > 0, p.g, 0.0) + np.where(x.v > 1, 1.62, -9.81)},
        {"rate": lambda t, x, p: (x.q > 0) * p.g - (x.q > p.L) * p.g},
        {"rate": lambda t, x, p: -p.k / p.m * np.maximum(x.q, 0) + p.g * np.clip(x.q / p.L, -1, np.inf)},
        {"rate": lambda t, x, p: 0.0 * x.q + spring(t, x, p)},
        {"rate": lambda t, x, p: p.g * p.e ** (x.q / p.L) * 2.0 ** (-p.w * t)},
        {"rate": lambda t, x, p: p.g * x.q**p.e / p.L**p.e},
        {"rate": lambda t, x, p: np.sqrt(p.k / p.m) * np.cbrt(x.v**3) + np.square(x.v) / p.L},
        {"rate": lambda t, x, p: x.v * np.reciprocal(t) * np.heaviside(x.q, 0.5)},
        {"rate": lambda t, x, p: p.g * np.arctan2(x.v, p.w * x.q) * np.mod(p.w * t, 2 * np.pi)},
        {"rate": lambda t, x, p: p.g * (t // t) * np.floor(t / p.L * x.v) * np.logical_or(x.q > 0, t > 0)},
        {"speed": lambda t, x, p: np.hypot(x.v, p.w * x.q) * np.abs(np.tanh(p.phi))},
        {"guard": lambda t, x, p: x.q - 1e-3 * p.d},
        {"guard": lambda t, x, p: x.q - 1.0, "when": lambda t, x, p: (x.v > 0.1) & (t >= 0)},
        {"reset": lambda t, x, p: {"v": -p.e * x.v}},
        {"reset": lambda t, x, p: {"q": p.L, "v": 0.0}},
        {"period": lambda p: 2 * np.pi / p.w},
        {"period": lambda p: 2 * np.pi / p.w, "reset": lambda t, x, p: (0, -x.v)},
        {"units": {"F": "kg·m/s²", "k": "kg s^-2", "c": "kg/s", "m": "stones (old)"}},
        {"units": {"F": "fish", "k": "fish/m", "c": "?"}},
    ],
)
def test_right_functions_are_left_alone(changes):
    check_dimensions(swing(**changes))


def test_units_of_any_size_fit_if_they_agree():
    units = {
        "q": "mm",
        "v": "mm/ms",
        "t": "ms",
        "m": "g",
        "k": "N/mm",
        "c": "N ms/mm",
        "w": "1/ms",
        "L": "mm",
    }
    check_dimensions(swing(units=units))
    told = FIELD + "the derivative of v is in N / kg (p.F, p.w, t, p.k, x.q, p.c, x.v, p.m), wanted mm / ms^2"
    assert fault_of(swing(units=units | {"m": "kg"})) == told


def test_a_state_without_names_has_its_units_by_number():
    def plain(rate):
        return HybridSystem(
            state=2,
            parameters={"k": 4.0, "m": 1.0},
            units={"x0": "m", "x1": "m/s", "t": "s", "k": "N/m", "m": "kg"},
            modes=[Mode("free", lambda t, x, p: np.array([x[1], rate(x, p)]))],
            transitions=[Transition("free", "free", Guard(lambda t, x, p: x[0]), Reset(lambda t, x, p: x))],
        )

    check_dimensions(plain(lambda x, p: -p.k / p.m * x[0] - 9.81))
    check_dimensions(plain(lambda x, p: -4 * x[0]))
    told = r"the system\.\n  field of mode 'free': the derivative of x1 is in m \(x0\), wanted m / s\^2\n"
    with pytest.raises(PropertyError, match=told):
        check_dimensions(plain(lambda x, p: -2 * x[0]))


@pytest.mark.parametrize("name", models.__all__)
def test_the_models_fit_their_units(name):
    system = getattr(models, name)()
    if system.units:
        check_dimensions(system)
    else:
        with pytest.raises(UnsatisfiedAssumption, match="units= is not given"):
            check_dimensions(system)


@pytest.mark.parametrize("law", [Rigid(), *matched_laws(K=1.5e11, mass=90.9, speed=0.4, e=0.8).values()])
def test_the_laws_of_contact_fit_their_units(law):
    check_dimensions(models.vibroimpact(law))


def test_the_modes_of_a_split_system_fit():
    system = swing(lambda t, x, p: -p.g * np.sign(x.v) + spring(t, x, p))
    check_dimensions(hybrid.split(system))
    wrong = hybrid.split(swing(lambda t, x, p: -p.F * np.sign(x.v) + spring(t, x, p)))
    with pytest.raises(
        PropertyError, match=r"field of mode 'v<0': N / kg \(x.q, p.m, p.k\) is added to N \(p.F\)"
    ):
        check_dimensions(wrong)


@pytest.mark.parametrize(
    ("units", "why"),
    [({}, "units= is not given"), ({"q": "m", "t": "s"}, "lacks v"), ({"q": "m", "v": "m/s"}, "lacks t")],
)
def test_without_the_units_of_state_and_time_nothing_is_checked(units, why):
    with pytest.raises(UnsatisfiedAssumption, match=why):
        check_dimensions(attrs.evolve(swing(force), units=units))


def test_a_function_that_cannot_be_traced_is_left_out():
    def branches(t, x, p):
        return p.F if x.q + t > 0 else p.k

    system = swing(branches, reset=lambda t, x, p: (x.v, x.v))
    assert fault_of(system) == RESET + "the new q is in m / s (x.v), wanted m"
    with pytest.raises(UnsatisfiedAssumption, match="no model function can be traced"):
        check_dimensions(attrs.evolve(swing(branches), transitions=[]))


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("m/s^2", "m s^-2"),
        ("m/s²", "m/s/s"),
        ("kg m^2", "kg·m²"),
        ("N/m^(3/2)", "N/m**1.5"),
        ("", "1"),
        ("-", "1"),
        ("rad", "radian"),
        ("°", "deg"),
        ("%", "percent"),
        ("Ohm", "Ω"),
        ("kOhm", "kΩ"),
        ("Nm/rad", "N m/rad"),
        ("rad/Nm", "rad/(N m)"),
        ("Nms", "N m s"),
        ("Ns/m", "N s/m"),
        ("degC", "K"),
        ("W/°C", "W/K"),
    ],
)
def test_units_are_read_as_people_write_them(text, same):
    assert unit_of(text) is not None
    assert unit_of(text) == unit_of(same)


@pytest.mark.parametrize("text", ["fish", "m/", "stones (old)", "Nm^2", "dB", "1 000", "m/s; of the ball"])
def test_a_text_that_is_not_read_is_no_unit(text):
    assert unit_of(text) is None


def test_the_argument_is_a_system():
    with pytest.raises(hybrid.ArgumentError, match="system must be a HybridSystem"):
        check_dimensions("swing")
