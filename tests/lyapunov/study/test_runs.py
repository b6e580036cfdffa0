"""The kind of motion at one frequency, from its section and its first exponent."""

from types import SimpleNamespace

import numpy as np
import pytest

from lyapunov.study.runs import Regime

SPREAD = np.array([[0.0, 1.0], [0.5, 1.0], [0.2, 1.5]])


def regime(exponent, error, points):
    spectrum = SimpleNamespace(exponents=np.array([exponent, -1.0]), standard_error=np.array([error, 0.1]))

    class Section(SimpleNamespace):
        def __len__(self):
            return len(self.x)

    return Regime(7.4, (spectrum,), None, None, Section(x=np.array(points)), None)


@pytest.mark.parametrize(
    ("exponent", "error", "points", "kind"),
    [
        (0.2, 0.01, SPREAD, "chaotic"),
        (-0.2, 0.01, SPREAD, "periodic"),
        (0.015, 0.01, SPREAD, "quasi-periodic"),
        (-0.015, 0.01, SPREAD, "quasi-periodic"),
        # Estimates of regular motion may have no error at all.
        (9e-5, 0.0, SPREAD, "quasi-periodic"),
        (2e-4, 0.0, SPREAD, "chaotic"),
        # A section of one point is that of a periodic orbit, whatever the noise of the exponent.
        (0.2, 0.01, [[0.3, 0.7], [0.3 + 9e-7, 0.7], [0.3, 0.7 - 9e-7]], "periodic"),
        (0.2, np.nan, SPREAD, "undecided"),
        (0.2, 0.01, np.empty((0, 2)), "undecided"),
    ],
)
def test_kind_of_motion(exponent, error, points, kind):
    assert regime(exponent, error, points).kind == kind
