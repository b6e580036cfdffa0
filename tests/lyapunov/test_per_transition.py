"""Exponents per jump of a transition, on maps that are iterated at times which vary from jump to jump."""

import numpy as np
import pytest

import models
from hybrid import ArgumentError, Guard, HybridSystem, Mode, Reset, Transition, split
from lyapunov import lyapunov_spectrum


def iterated(step, wait=lambda u: 1.0 + u):
    """At each hit ``u`` goes one step of a map further, and the next hit is ``wait(u)`` later."""
    return HybridSystem(
        state=("u", "s"),
        modes=[Mode("waits", lambda t, x, p: (0.0 * x.u, -1.0))],
        transitions=[
            Transition(
                "waits",
                "waits",
                Guard(lambda t, x, p: x.s, direction=-1),
                Reset(lambda t, x, p: (step(x.u), wait(x.u))),
                name="hit",
            ),
            Transition("waits", "waits", Guard(lambda t, x, p: x.s - 9.0, direction=+1), name="never"),
        ],
    )


def tent(u):
    return 1.9 * np.minimum(u, 1.0 - u)


def logistic(u):
    return 4.0 * u * (1.0 - u)


def test_each_hit_stretches_by_the_same_although_the_times_vary():
    """The exponent per unit time has an error, from the times alone; the one per hit has nearly none."""
    spectrum = lyapunov_spectrum(iterated(tent), (0.3, 1.0), intervals=4000, interval=1.0)
    per = spectrum.per("hit")
    assert per.exponents == pytest.approx([np.log(1.9), 0.0], abs=1e-3)
    # Intervals end between two hits: what is left over is one hit in the whole run.
    assert per.standard_error.max() < spectrum.standard_error[0] / 4
    assert per.time == pytest.approx(np.log(1.9) / spectrum.exponents[0], rel=1e-3)
    assert "per jump of 'hit'" in repr(per)


def test_the_error_holds_the_truth():
    """It is ln 2 for the logistic map, whose growth per hit varies."""
    inside = []
    for i in range(40):
        spectrum = lyapunov_spectrum(
            iterated(logistic), (0.1 + 0.02 * i, 0.7), intervals=1000, interval=1.0, history=False
        )
        per = spectrum.per("hit")
        inside.append(abs(per.exponents[0] - np.log(2.0)) <= 2.0 * per.standard_error[0])
        assert per.standard_error[0] < 0.05
    assert sum(inside) >= 34


def test_without_a_history_and_per_period_as_per_unit_time():
    """One hit per period, as the period is its time scale."""
    system = models.impact_oscillator()
    spectra = [
        lyapunov_spectrum(system, (0.9, 1.0), intervals=300, history=history) for history in (True, False)
    ]
    for spectrum in spectra:
        per = spectrum.per("impact")
        np.testing.assert_allclose(per.exponents, spectrum.exponents * 2 * np.pi, rtol=1e-9)
        assert per.time == pytest.approx(2 * np.pi, rel=1e-9)
    np.testing.assert_array_equal(spectra[0].per("impact").exponents, spectra[1].per("impact").exponents)


def test_the_copies_of_a_transition_that_has_been_split_count_together():
    whole = models.impact_oscillator()
    kinked = HybridSystem(
        state=("u", "s"),
        modes=[Mode("waits", lambda t, x, p: (0.0 * x.u * np.abs(x.s - 1.1), -1.0))],
        transitions=iterated(logistic).transitions[:1],
    )
    cut = lyapunov_spectrum(split(kinked), (0.3, 0.7), intervals=500, interval=1.0)
    one = lyapunov_spectrum(iterated(logistic), (0.3, 0.7), intervals=500, interval=1.0)
    assert cut.per("hit").time == pytest.approx(one.per("hit").time, rel=1e-3)
    assert whole.transition_names == ("impact",)


def test_what_cannot_be_counted_is_refused():
    spectrum = lyapunov_spectrum(iterated(tent), (0.3, 1.0), intervals=50, interval=1.0)
    with pytest.raises(ArgumentError, match="transition 'never' did not fire"):
        spectrum.per("never")
    with pytest.raises(ArgumentError, match=r"Transition 'hitt' does not exist.*Did you mean 'hit'"):
        spectrum.per("hitt")


def test_a_direction_that_hits_annihilate():
    flat = iterated(lambda u: 0.0 * u + 0.5, wait=lambda u: 1.0 + 0.0 * u)
    per = lyapunov_spectrum(flat, (0.3, 0.7), intervals=50, interval=1.0).per("hit")
    assert per.exponents.tolist() == [0.0, -np.inf]
    assert per.standard_error[1] == 0.0
