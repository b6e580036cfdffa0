"""Derivatives of runs in parameters and in the start, against closed forms and against differences."""

import numpy as np
import pytest

import models
from hybrid import (
    DOP853,
    ArgumentError,
    Guard,
    HybridSystem,
    Mode,
    Reset,
    StatusCode,
    Taylor,
    Transition,
    from_equations,
    simulate,
)

TIGHT = Taylor(rtol=1e-13, atol=1e-15)


def extrapolated(function, value, step):
    """Central differences with Richardson's extrapolation."""
    coarse, fine = ((function(value + h) - function(value - h)) / (2 * h) for h in (step, step / 2))
    return (4 * fine - coarse) / 3


class TestClosedForms:
    """A ball from the height ``h`` lands at ``sqrt(2 h / g)`` with ``sqrt(2 g h)`` and bounces."""

    g, e, h = 9.81, 0.8, 1.0

    def run(self, t1, **options):
        return simulate(
            models.bouncing_ball(),
            (self.h, 0.0),
            (0.0, t1),
            solver=TIGHT,
            sensitivities=("e", "g"),
            **options,
        )

    def test_times_of_jumps(self):
        jumps, t = self.run(2.0).jumps, np.sqrt(2 * self.h / self.g)
        k = np.arange(len(jumps))
        factor = 1 + 2 * (self.e - self.e ** (k + 1)) / (1 - self.e)
        slope = [sum(2 * i * self.e ** (i - 1) for i in range(1, j + 1)) for j in k]
        np.testing.assert_allclose(jumps.t, t * factor, rtol=1e-12)
        np.testing.assert_allclose(jumps.t_sensitivity[:, 0], t * np.array(slope), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(jumps.t_sensitivity[:, 1], -jumps.t / (2 * self.g), rtol=1e-10)
        np.testing.assert_allclose(jumps.t_gradient[:, 0], jumps.t / (2 * self.h), rtol=1e-10)

    def test_the_end(self):
        """After one bounce ``v = e V - g (t - T)`` and ``q = e V (t - T) - g (t - T)^2 / 2``."""
        t, (T, V) = 0.9, (np.sqrt(2 * self.h / self.g), np.sqrt(2 * self.g * self.h))
        s, dT, dV = t - T, -T / (2 * self.g), V / (2 * self.g)
        in_e = [V * s, V]
        in_g = [
            self.e * (dV * s - V * dT) - s**2 / 2 + self.g * s * dT,
            self.e * dV - s + self.g * dT,
        ]
        np.testing.assert_allclose(self.run(t).sensitivity, np.transpose([in_e, in_g]), rtol=1e-11)

    def test_a_chatter_and_what_comes_after_its_limit(self):
        """A table that begins to sink at the end of the chatter takes the ball along."""
        system = models.bouncing_table()
        given = {"parameters": {"A": 0.0, "e": 0.5, "w": 1.0}, "mode": "flight", "solver": TIGHT}
        arc = simulate(system, (0.1, 0.0), (0.0, 1.0), sensitivities=("e",), **given)
        assert arc.mode[-1] == "rest"
        assert arc.status.ok
        np.testing.assert_array_equal(arc.sensitivity, 0.0)
        T = np.sqrt(0.2 / 9.81)
        assert arc.jumps.t_sensitivity[-2, 0] == pytest.approx(2 * T / (1 - 0.5) ** 2, rel=1e-3)
        assert np.isnan(arc.jumps.t_sensitivity[-1, 0])


CASES = [
    (models.impact_oscillator(), ("w", "r", "d", "k", "c", "A"), (0.0, 0.0), 20.0, {}),
    (models.vibroimpact(), ("omega", "K", "D", "xi1", "m2"), (0.0, 0.02, 0.0, 0.0), 3.0, {}),
    (models.stick_slip(), ("belt", "Fs", "delta"), (0.5, 0.0), 20.0, {"mode": "below"}),
    (models.coulomb_stick_slip(), ("belt", "Fs", "Fk"), (0.5, -0.3), 20.0, {"mode": "slip"}),
    (models.buck_converter(), ("E", "a", "T", "R"), (12.0, 0.5, 0.0), 3.9e-3, {"mode": "on"}),
    (models.rimless_wheel(), ("gamma", "alpha", "l"), (0.0, 1.0), 5.0, {}),
    (models.slip_hopper(), ("k", "alpha", "g"), (0.0, 1.0, 5.0, 0.0), 1.0, {"mode": "descent"}),
    (models.bilinear_oscillator(), ("k2", "w"), (0.2, 0.0), 12.0, {"mode": "stiff"}),
    (models.three_disk_billiard(), ("R", "a"), (0.1, 0.0, 0.1, 1.0), 6.0, {}),
]


@pytest.mark.parametrize(
    ("system", "names", "x0", "t1", "options"), CASES, ids=[each[0].name for each in CASES]
)
def test_models_against_differences(system, names, x0, t1, options):
    """Differences have about eight digits here; the derivatives have more."""
    samples, n = np.array([0.3, 0.7]) * t1, system.dimension

    def run(x, parameters, **more):
        return simulate(system, x, (0.0, t1), parameters=parameters, solver=TIGHT, **options, **more)

    arc = run(x0, None, sensitivities=names)
    sampled = run(x0, None, sensitivities=names, samples=samples)
    assert arc.status.ok
    assert arc.sensitivity.shape == (n, len(names))

    def numbers(x, parameters):
        arc = run(x, parameters)
        return np.concatenate([arc.x[-1], arc.jumps.t, arc(samples).ravel()])

    def compare(found, differences):
        np.testing.assert_allclose(found, differences, rtol=1e-6, atol=1e-8 * np.abs(differences).max())

    for j, name in enumerate(names):
        value = system.parameters[name]
        differences = extrapolated(lambda p, name=name: numbers(x0, {name: p}), value, 3e-5 * abs(value))
        parts = (arc.sensitivity[:, j], arc.jumps.t_sensitivity[:, j], sampled.sampled_sensitivity[:, :, j])
        for found, part in zip(parts, np.split(differences, [n, n + len(arc.jumps)]), strict=True):
            compare(found.ravel(), part)
    for i in range(n):
        start = np.array(x0)

        def moved(value, i=i, start=start):
            start[i] = value
            return numbers(start, None)

        differences = extrapolated(moved, x0[i], 3e-5)
        compare(arc.jumps.t_gradient[:, i], differences[n : n + len(arc.jumps)])
        compare(sampled.sampled_fundamental[:, :, i].ravel(), differences[n + len(arc.jumps) :])


def test_a_landing_beyond_another_guard():
    """Two thresholds at once: the jump of the first sets off the second, at the time of the first."""
    system = HybridSystem(
        state=("x", "y"),
        parameters={"a": 1.0, "b": 0.5},
        modes=[Mode("run", lambda t, x, p: (1.0, 0.3))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: x.x - p.a, +1),
                Reset(lambda t, x, p: {"x": 0.0, "y": x.y + 1.0}),
            ),
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: x.y - 1.0, +1),
                Reset(lambda t, x, p: {"y": p.b * x.y}),
                name="b",
            ),
        ],
    )
    arc = simulate(system, (0.0, 0.2), (0.0, 1.5), sensitivities=("a", "b"), solver=TIGHT)
    assert list(arc.jumps.transition) == ["run->run", "b"]
    np.testing.assert_allclose(arc.jumps.t_sensitivity, [[1.0, 0.0], [1.0, 0.0]], atol=1e-13)
    # x = t - a, y = b (0.2 + 0.3 a + 1) + 0.3 (t - a).
    np.testing.assert_allclose(arc.sensitivity, [[-1.0, 0.0], [0.15 - 0.3, 1.5]], atol=1e-13)


def test_systems_made_from_equations_in_stages():
    """Dry friction in two places: the modes are made as the run needs them."""

    def field(t, x, p):
        return x.v, -x.q - p.mu * np.sign(x.v) + p.F * np.abs(np.cos(t))

    system = from_equations(field, state=("q", "v"), parameters={"mu": 0.3, "F": 0.4})
    arc = simulate(system, (1.0, 0.0), (0.0, 3.0), sensitivities=("mu", "F"), solver=TIGHT)
    for j, (name, value) in enumerate(system.parameters.items()):
        differences = extrapolated(
            lambda p, name=name: simulate(
                system, (1.0, 0.0), (0.0, 3.0), parameters={name: p}, solver=TIGHT
            ).x[-1],
            value,
            1e-5,
        )
        np.testing.assert_allclose(arc.sensitivity[:, j], differences, rtol=1e-7, atol=1e-9)


def test_a_state_without_names():
    decay = HybridSystem(
        state=2, parameters={"k": 0.5}, modes=[Mode("m", lambda t, x, p: np.array([-p.k * x[0], x[0]]))]
    )
    arc = simulate(decay, (2.0, 0.0), (0.0, 1.5), sensitivities=("k",), solver=DOP853(rtol=1e-12, atol=1e-14))
    assert arc.sensitivity[0, 0] == pytest.approx(-3.0 * np.exp(-0.75), rel=1e-11)


def test_a_run_that_a_transition_ends():
    fall = models.slip_hopper()
    arc = simulate(fall, (0.0, 1.0, 2.0, 0.0), (0.0, 9.0), mode="descent", sensitivities=("k",))
    assert arc.status.code == StatusCode.TERMINAL
    assert np.all(np.isfinite(arc.sensitivity))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"sensitivities": ("ee",)}, "sensitivities: Parameter 'ee' does not exist. Parameters: g, e"),
        ({"sensitivities": ("e", "e")}, "sensitivities: 'e' is given twice"),
        ({"sensitivities": "e"}, "sensitivities must be names of parameters"),
    ],
)
def test_errors(given, text):
    with pytest.raises(ArgumentError) as caught:
        simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), **given)
    assert text in str(caught.value)


def test_without_sensitivities_there_are_none():
    arc = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
    for ask in (lambda: arc.sensitivity, lambda: arc.jumps.t_gradient, lambda: arc.sampled_fundamental):
        with pytest.raises(ArgumentError, match="Run simulate with sensitivities="):
            ask()
    with_them = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), sensitivities=("e",))
    with pytest.raises(ArgumentError, match="Run simulate with samples="):
        _ = with_them.sampled_sensitivity


DRIVE = 1.5


def test_a_global_that_has_changed_is_read_anew(monkeypatch):
    """As by the run itself: the derivatives are those of the function as it is now."""
    system = HybridSystem(
        state=("v",), parameters={"k": 1.0}, modes=[Mode("run", lambda t, x, p: (DRIVE - p.k * x.v,))]
    )
    for drive in (1.5, 2.0):
        monkeypatch.setattr(f"{__name__}.DRIVE", drive)
        arc = simulate(system, (0.0,), (0.0, 3.0), sensitivities=("k",))
        exact = drive * (4.0 * np.exp(-3.0) - 1.0)
        np.testing.assert_allclose(arc.sensitivity, [[exact]], rtol=1e-9)
