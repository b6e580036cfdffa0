"""Plain equations with switches in unusual places: the same end as an integration from switch to switch."""

import numpy as np
import pytest

from hybrid import DOP853, ModelError, compile_system, from_equations, simulate

OUTER = [
    np.sin,
    np.cos,
    np.tan,
    np.tanh,
    np.sinh,
    np.cosh,
    np.arcsin,
    np.arccos,
    np.arctan,
    np.arcsinh,
    np.arctanh,
    np.cbrt,
]


@pytest.mark.parametrize("outer", OUTER)
def test_functions_of_a_switch(outer):
    """Below the switch the field is that of the lower branch alone."""
    whole = from_equations(lambda t, x, p: (outer(0.3 * np.sign(x.q) - 0.3 * x.q) - 2,), state=("q",))
    lower = from_equations(lambda t, x, p: (outer(-0.3 - 0.3 * x.q) - 2,), state=("q",))
    found, wanted = (simulate(each, (-0.1,), (0.0, 0.3)) for each in (whole, lower))
    np.testing.assert_allclose(found.x[-1], wanted.x[-1], rtol=1e-9)


@pytest.mark.parametrize(
    ("rate", "wanted"),
    [
        (lambda q: np.maximum(q + 0.3, q - 0.2) - 2 * q, 0.3),
        (lambda q: np.minimum(q + 0.3, q - 0.2) - 2 * q, -0.2),
        (lambda q: np.where(q + 0.3 > q, 1.0, 2.0) - q, 1.0),
        (lambda q: np.where(q + 0.3 < q, 1.0, 2.0) - q, 2.0),
        (lambda q: np.clip(q, q - 1, q + 1) - 2 * q, 0.0),
        (lambda q: np.floor(q + 1.5 - q) - q, 1.0),
    ],
)
def test_a_switch_that_is_decided_makes_no_modes(rate, wanted):
    system = from_equations(lambda t, x, p: (rate(x.q),), state=("q",))
    assert len(system.modes) == 1
    arc = simulate(system, (0.7,), (0.0, 3.0))
    np.testing.assert_allclose(arc.x[-1], wanted + (0.7 - wanted) * np.exp(-3.0), rtol=1e-9)


@pytest.mark.parametrize(
    "rate",
    [
        lambda q: np.abs(q**2) - q * q - q,
        lambda q: np.maximum(q**2 + 0.25, 0) - q * q - 0.25 - q,
        lambda q: -np.sqrt(np.abs(1 + q**4)) * q / np.sqrt(1 + q**4),
        lambda q: -np.where(np.exp(-q) > 0, 1.0, 2.0) * q,
        lambda q: -np.sign(1 + 0.8 * np.cos(3 * q)) * q,
        lambda q: np.minimum(-(q**2), 0) + q * q - q,
    ],
)
def test_a_height_that_never_changes_its_sign_makes_no_modes(rate):
    system = from_equations(lambda t, x, p: (rate(x.q),), state=("q",))
    assert system.mode_names == ("smooth",)
    arc = simulate(system, (0.7,), (0.0, 3.0))
    np.testing.assert_allclose(arc.x[-1], 0.7 * np.exp(-3.0), rtol=1e-8)


@pytest.mark.parametrize("height", [lambda v: v**3, lambda v: 1 / v, lambda v: v**5 * (1 + v**2)])
def test_an_odd_power_changes_its_sign_where_its_base_does(height):
    """The block slows down, then sticks: the spring is weaker than friction."""
    field = lambda t, x, p: (x.v, -0.1 * x.q - np.sign(height(x.v)))  # noqa: E731
    block = from_equations(field, state=("q", "v"))
    assert sorted(block.mode_names) == ["v<0", "v=0", "v>0"]
    arc = simulate(block, (0.0, 1.0), (0.0, 3.0))
    plain = from_equations(lambda t, x, p: (x.v, -0.1 * x.q - np.sign(x.v)), state=("q", "v"))
    np.testing.assert_allclose(arc.x[-1], simulate(plain, (0.0, 1.0), (0.0, 3.0)).x[-1], rtol=1e-12)
    assert arc.mode[-1] == "v=0"


def test_a_root_of_a_cube_is_zero_beyond_its_surface():
    field = lambda t, x, p: (x.v, -5 * np.sqrt(np.maximum(x.q**3, 0)) - 1)  # noqa: E731
    other = lambda t, x, p: (x.v, -5 * np.maximum(x.q, 0) ** 1.5 - 1)  # noqa: E731
    found, wanted = (
        simulate(from_equations(each, state=("q", "v")), (-1.0, 2.0), (0.0, 4.0)) for each in (field, other)
    )
    assert len(found.jumps) == len(wanted.jumps) == 2
    np.testing.assert_allclose(found.x[-1], wanted.x[-1], rtol=1e-9)


@pytest.mark.parametrize("offset", [0.0, 0.7, -5.3])
@pytest.mark.parametrize(("period", "share"), [(4.0, 0.5), (4.0, 0.25), (2.0, 0.825), (3.0, 1e-3)])
def test_a_duty_cycle_has_two_modes(period, share, offset):
    """What is carried is the time above the threshold."""
    pulse = lambda t: np.where(np.mod(t - offset, period) > share * period, 1.0, 0.0)  # noqa: E731
    system = from_equations(lambda t, x, p: (pulse(t) + 0 * x.q,), state=("q",))
    assert len(system.modes) == 2
    end = offset + 7 * period
    arc = simulate(system, (0.0,), (offset + 0.5 * share * period, end))
    assert arc.status.ok
    np.testing.assert_allclose(arc.x[-1], 7 * (1 - share) * period, rtol=1e-11)
    # The ends of each pulse, but not the end of the run.
    assert len(arc.jumps) in (13, 14)


@pytest.mark.parametrize(
    ("pulse", "wanted"),
    [
        (lambda t: np.mod(t, 4.0) > 5.0, 0.0),
        (lambda t: np.mod(t, 4.0) < 5.0, 1.0),
        (lambda t: np.mod(t, 4.0) > -1.0, 1.0),
        (lambda t: np.mod(t, -4.0) > 0.5, 0.0),
    ],
)
def test_a_threshold_that_is_never_passed_makes_no_modes(pulse, wanted):
    system = from_equations(lambda t, x, p: (np.where(pulse(t), 1.0, 0.0) + 0 * x.q,), state=("q",))
    assert len(system.modes) == 1
    arc = simulate(system, (0.0,), (0.3, 9.0))
    assert len(arc.jumps) == 0
    np.testing.assert_allclose(arc.x[-1], wanted * 8.7, rtol=1e-12)


def test_levels_of_one_fraction():
    def level(t, x, p):
        place = np.mod(t, p.T)
        return (np.where(place < 0.25 * p.T, 1.0, np.where(place < 0.5 * p.T, 2.0, 0.0)) + 0 * x.q,)

    system = from_equations(level, state=("q",), parameters={"T": 3.0})
    assert len(system.modes) == 3
    arc = simulate(system, (0.0,), (0.0, 8.0), parameters={"T": 2.0})
    np.testing.assert_allclose(arc.x[-1], 4 * (0.5 * 1.0 + 0.5 * 2.0), rtol=1e-11)


@pytest.mark.parametrize(
    ("wave", "modes", "mean"),
    [
        (lambda t: np.abs(np.mod(t, 2.0) - 1), 2, 0.5),
        (lambda t: np.abs(np.mod(-t, 2.0) - 1), 2, 0.5),
        (lambda t: 2 * np.abs(t / 2 - np.floor(t / 2 + 0.5)), 2, 0.5),
        (lambda t: 2 * np.minimum(np.mod(t / 2, 1), 0.25), 3, 0.4375),
        (lambda t: np.where(np.mod(t / 2, 1) < 0.3, np.mod(t / 2, 1), 0), 2, 0.045),
        (lambda t: np.where(np.mod(t, 2) < 0.6, 1, 0) + np.where(np.mod(t, 2) < 1.2, 1, 0), 3, 0.9),
        (lambda t: np.clip(3 * np.abs(np.mod(t, 2) - 1) - 1, 0, 1), 6, 0.5),
    ],
)
def test_a_wave_has_no_modes_where_its_fraction_cannot_be(wave, modes, mean):
    system = from_equations(lambda t, x, p: (wave(t) + 0 * x.q,), state=("q",))
    assert len(system.modes) == modes
    arc = simulate(system, (0.0,), (0.3, 14.3))
    assert arc.status.ok
    np.testing.assert_allclose(arc.x[-1], 14 * mean, rtol=1e-12)


@pytest.mark.parametrize("factor", [3.0, -3.0])
@pytest.mark.parametrize("rounded", [np.floor, np.ceil])
@pytest.mark.parametrize("q", [0.1, 0.2, -0.1, -0.2])
def test_the_name_of_a_step_is_true(factor, rounded, q):
    system = from_equations(lambda t, x, p: (rounded(factor * x.q),), state=("q",))
    [name] = {*simulate(system, (q,), (0.0, 1e-6)).mode}
    half = ">" if q * 3.0 % 1 > 0.5 else "<"
    assert name == f"mod(3*q,1){half}1/2"


@pytest.mark.parametrize(
    ("rate", "wanted"),
    [
        (lambda n: np.where(n == 2, 1.0, 0.0), 1.0),
        (lambda n: np.where(n != 2, 1.0, 0.0), 5.25),
        (lambda n: np.where(n > 2, 1.0, 0.0), 3.25),
        (lambda n: np.where(n >= 2, 1.0, 0.0), 4.25),
        (lambda n: np.where(np.mod(n, 2) == 0, 1.0, -1.0), 0.25),
        (lambda n: np.where(np.mod(n, 2) < 0.5, 1.0, -1.0), 0.25),
        (lambda n: np.floor(n / 2), 6.75),
        (lambda n: np.mod(n, 3), 6.0),
        (lambda n: np.sign(n - 1), 3.25),
        (lambda n: np.select([n == 0, n == 1], [3.0, 2.0], 1.0), 9.25),
    ],
)
def test_choices_by_a_floor_change_with_it(rate, wanted):
    system = from_equations(lambda t, x, p: (rate(np.floor(t)) + 0 * x.q,), state=("q",))
    assert set(system.mode_names) == {"mod(t,1)<1/2", "mod(t,1)>1/2"}
    arc = simulate(system, (0.0,), (0.0, 6.25))
    np.testing.assert_allclose(arc.x[-1], wanted, rtol=1e-9)


def test_choices_by_a_floor_of_the_state():
    """Gears: each has its own acceleration."""
    gear = lambda v: np.where(np.floor(v) == 0, 4.0, np.where(np.floor(v) == 1, 2.0, 1.0))  # noqa: E731
    car = from_equations(lambda t, x, p: (gear(x.v),), state=("v",))
    arc = simulate(car, (0.0,), (0.0, 1.75))
    np.testing.assert_allclose(arc.x[-1], 3.0, rtol=1e-9)
    assert "jumps" not in repr(compile_system(car))


def test_the_note_of_half_a_turn_shows_no_rounding():
    field = lambda t, x, p: (np.where(np.mod(x.th, 2 * np.pi) < np.pi, 1.0, 0.3),)  # noqa: E731
    assert "e-17" not in repr(from_equations(field, state=("th",)))


def test_surfaces_that_meet_in_one_place_are_named():
    """Both lines |q| = |v| pass through the corner of q = 0 and v = 0."""

    def field(height):
        return lambda t, x, p: (x.v, -0.4 * np.sign(height(x.q, x.v)) * x.q - 0.1 * x.v)

    with pytest.raises(ModelError, match=r"q\+v=0 passes through the intersection of .*q=v") as caught:
        from_equations(field(lambda q, v: np.abs(q) - np.abs(v)), state=("q", "v"))
    assert "np.sign(a**2 - b**2)" in str(caught.value)
    arc = simulate(from_equations(field(lambda q, v: q**2 - v**2), state=("q", "v")), (0.8, -0.4), (0.0, 4.0))
    assert arc.status.ok


def test_a_floor_is_a_constant_of_each_mode():
    """Its modes have series, and tangent vectors lose no digits."""
    stairs = from_equations(lambda t, x, p: (x.v, -np.sin(x.q) + 0.2 * np.floor(x.q)), state=("q", "v"))
    told = repr(compile_system(stairs))
    assert told.count("Taylor series") == len(stairs.modes) == 2
    arc = simulate(stairs, (1.3, 0.2), (0.0, 10.0), tangent=True)
    tight = DOP853(rtol=1e-12, atol=1e-12)
    other = simulate(stairs, (1.3, 0.2), (0.0, 10.0), tangent=True, solver=tight)
    assert arc.status.message == "Reached the end."
    np.testing.assert_allclose(arc.x[-1], other.x[-1], atol=1e-10)
    np.testing.assert_allclose(arc.fundamental, other.fundamental, atol=1e-9)
