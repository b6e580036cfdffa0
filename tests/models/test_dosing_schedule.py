"""The dosing schedule compared with superposed Bateman functions."""

import numpy as np
import pytest

import hybrid
from models import dosing_schedule

TIMES = (8.0, 20.0, 32.0, 44.0, 56.0, 68.0)


def single(t, p):
    """Concentration of one dose at time 0."""
    curve = np.exp(-p["k_e"] * t) - np.exp(-p["k_a"] * t)
    return np.where(t > 0, p["dose"] / p["V"] * p["k_a"] / (p["k_a"] - p["k_e"]) * curve, 0.0)


@pytest.mark.parametrize("given", [{}, {"k_a": 0.4, "dose": 20.0}])
def test_doses_superpose(given):
    p = {**dosing_schedule().parameters, **given}
    t = np.linspace(0.0, 96.0, 193)
    arc = hybrid.simulate(dosing_schedule(), (0.0, 0.0), (0.0, 96.0), parameters=given, samples=t)
    exact = sum(single(t - dose, p) for dose in TIMES)
    np.testing.assert_allclose(arc["c"], exact, rtol=1e-9, atol=1e-11)
    assert arc.status.ok


def test_every_dose_comes_at_its_time():
    arc = hybrid.simulate(dosing_schedule(), (0.0, 0.0), (0.0, 96.0))
    assert arc.jumps.t.tolist() == [*TIMES]


def test_a_missed_dose():
    times = [each for each in TIMES if each != 32.0]
    whole, missed = (
        hybrid.simulate(dosing_schedule(each), (0.0, 0.0), (0.0, 50.0)) for each in (TIMES, times)
    )
    lost = single(np.array(50.0 - 32.0), dosing_schedule().parameters)
    assert whole["c"][-1] - missed["c"][-1] == pytest.approx(float(lost), rel=1e-9)


def test_sensitivities():
    """The concentration is proportional to the dose, and the derivative in k_e that of the exponentials."""
    arc = hybrid.simulate(dosing_schedule(), (0.0, 0.0), (0.0, 96.0), sensitivities=("dose", "k_e"))
    p, h = dosing_schedule().parameters, 1e-6
    assert arc.sensitivity[1, 0] == pytest.approx(arc["c"][-1] / p["dose"], rel=1e-9)
    ends = [sum(single(96.0 - dose, {**p, "k_e": p["k_e"] + s * h}) for dose in TIMES) for s in (1, -1)]
    assert arc.sensitivity[1, 1] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-7)
