"""The infusion schedule compared with superposed infusions in closed form."""

import numpy as np
import pytest

import hybrid
from models import infusion_schedule
from models.infusion_schedule import INFUSIONS

P = infusion_schedule().parameters


def exact(t, infusions, k=P["k"]):
    """Concentration at times."""
    found = np.zeros_like(t)
    for begin, duration, amount in zip(*(infusions[name] for name in INFUSIONS), strict=True):
        left = np.exp(-k * np.maximum(t - begin - duration, 0.0)) - np.exp(-k * np.maximum(t - begin, 0.0))
        found += amount / (duration * P["V"] * k) * left
    return found


@pytest.mark.parametrize(
    "infusions",
    [
        INFUSIONS,
        # Two begin together, two end together, one begins where another ends.
        {"t": (2.0, 0.0, 2.0, 5.0), "duration": (3.0, 5.0, 1.0, 2.0), "amount": (9.0, 1.0, 4.0, 2.0)},
    ],
)
def test_infusions_superpose(infusions):
    t = np.linspace(-1.0, 40.0, 165)
    arc = hybrid.simulate(infusion_schedule(infusions), {"c": 0.0}, (-1.0, 40.0), samples=t)
    np.testing.assert_allclose(arc["c"], exact(t, infusions), rtol=1e-10, atol=1e-12)
    assert arc["r"][-1] == pytest.approx(0.0, abs=1e-12)


def test_sensitivity_in_the_rate_of_elimination():
    arc = hybrid.simulate(infusion_schedule(), {"c": 0.0}, (-1.0, 30.0), sensitivities=("k",))
    end, h = np.array([30.0]), 1e-5
    ends = [exact(end, INFUSIONS, P["k"] + s * h)[0] for s in (1, -1)]
    assert arc.sensitivity[0, 0] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-7)
