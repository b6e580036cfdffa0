"""Made-up results of the study, with values that are easy to tell apart."""

import math
from types import SimpleNamespace

import numpy as np

from hybrid.status import Status, StatusCode

FINE, STOPPED = Status(StatusCode.SUCCESS, ""), Status(StatusCode.MAX_STEPS, "too many steps")


class Result(SimpleNamespace):
    def __repr__(self):
        return self.name


def regime(omega, intervals, *, impacts=(0.5, 0.5, 0.5), multipliers=(0.5, -0.25), **changes):
    """Histories that count up or stay the same, of exponents 1, -2 and -3.5."""
    count = np.arange(1.0, intervals + 1)[:, None]
    spectra = [
        Result(
            name=f"spectrum {k}",
            intervals=intervals,
            benettin_history=count * [k, 0.0],
            history=count * [0.01 * k, 0.0],
            exponents=np.array([float(k), -2.0, -3.5]),
            standard_error=np.array([0.001 * k, 0.5, 0.5]),
            sum_rule=-4.5,
            status=FINE,
        )
        for k in (1, 2, 3)
    ]
    two = Result(
        name="two",
        single_piece=count[:, 0] / 2,
        telescoped=-count[:, 0] / 1000,
        undivided=np.full(intervals, math.nan),
        renormalised_growths=np.full(intervals, -0.25),
        status=FINE,
    )
    orbit = Result(name="orbit", status=FINE, residual=2e-3, multipliers=np.array(multipliers))
    parts = {"section": Result(name="section", status=FINE), "arc": Result(name="arc", status=FINE)}
    values = {"spectra": spectra, "two_orbit": two, "orbit": orbit, **parts, "kind": "periodic"}
    return Result(name="regime", omega=omega, impacts_per_period=impacts, **values | changes)
