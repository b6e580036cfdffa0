"""Compute the table of ``docs/published.md`` anew: ``python docs/make_published.py``, within a minute.

Each row is a function that reads like its source: what was printed, what the library gives, and an
independent value beside it. ``docs/make_site.py`` calls `renew`, so the site shows the numbers of the day it
was built.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import attrs
import numpy as np
import published_checks as exact
from scipy.optimize import root_scalar

import models
from hybrid import (
    Guard,
    HybridSystem,
    Mode,
    PeriodicOrbit,
    Reset,
    Transition,
    continue_orbit,
    from_equations,
    periodic_orbit,
    simulate,
    switch_branch,
)
from lyapunov import LyapunovSpectrum, kaplan_yorke_dimension, lyapunov_spectrum

PAGE = Path(__file__).parent / "published.md"
BEGIN, END = "<!-- the rows that docs/make_published.py writes -->\n", "<!-- the end of these rows -->\n"
HEAD = "| source | quantity | printed | library | error | independent | s |\n|---|---|---|---|---|---|---|\n"
NOT_OPENED = "not opened"
# Share of its motion to which an orbit has to close.
TIGHT = 1e-13


@attrs.frozen
class Number:
    """One number of a row: printed, ours, its error, and the independent one; as they are shown."""

    quantity: str
    printed: str
    library: str
    error: str
    independent: str


@attrs.frozen
class Row:
    """What one source printed: the number of the source on the page, and the function that finds it again."""

    source: int
    find: Callable[[], list[Number]]
    quick: bool = True


def against(quantity: str, printed: str, library: float, independent: float, digits: int = 12) -> Number:
    """A number whose error is its distance from an independent value."""
    off = f"{abs(library - independent):.0e}"
    return Number(quantity, printed, f"{library:.{digits}f}", off, f"{independent:.{digits}f}")


def gait(guess: tuple[float, float], period: float) -> tuple[PeriodicOrbit, np.ndarray]:
    """A gait of the simplest walker on the slope 0.009, and its state after heelstrike."""
    theta, dtheta = guess
    x0 = (theta, 2 * theta, dtheta, dtheta * (1 - np.cos(2 * theta)))
    orbit = periodic_orbit(models.simplest_walker(), x0, mode="behind", period=period, tolerance=TIGHT)
    assert orbit.status.ok
    strikes = [jump for jump in orbit.arc().jumps if jump.transition == "heelstrike"]
    return orbit, np.asarray(strikes[0].x_plus)


def long_gait() -> list[Number]:
    orbit, after = gait((0.2, -0.2), 3.88)
    theta, dtheta, period, _ = exact.walker_gait(0.2003, -0.1998, 3.88)
    return [
        against("long gait, angle after heelstrike", "0.200310900563820", after[0], float(theta)),
        against("its rate", "-0.199832473025474", after[2], float(dtheta)),
        against("its period", "3.882", orbit.period, float(period)),
    ]


def short_gait() -> list[Number]:
    orbit, after = gait((0.194, -0.204), 3.096)
    theta, dtheta, period, _ = exact.walker_gait(0.1939, -0.2039, 3.096)
    return [
        against("short gait, angle after heelstrike", "0.193937369810188", after[0], float(theta)),
        against("its rate", "-0.203866927442012", after[2], float(dtheta)),
        against("its period", "3.096", orbit.period, float(period)),
    ]


def multipliers_of_the_gaits() -> list[Number]:
    orbit, _ = gait((0.2, -0.2), 3.88)
    pair = next(each for each in orbit.multipliers if each.imag > 0)
    *_, exact_pair = exact.walker_gait(0.2003, -0.1998, 3.88)
    real, imaginary = exact_pair[0].real, exact_pair[0].imag
    orbit, _ = gait((0.194, -0.204), 3.096)
    *_, exact_two = exact.walker_gait(0.1939, -0.2039, 3.096)
    large, small = sorted((float(each.real) for each in exact_two), reverse=True)
    found = np.sort(orbit.multipliers.real)[::-1]
    return [
        against("long gait, multipliers, real part", "-0.19120868949940", pair.real, float(real)),
        against("imaginary part", "0.55633363687106", pair.imag, abs(float(imaginary))),
        against("short gait, larger multiplier", "4.000", found[0], large, 9),
        against("smaller multiplier", "0.459", found[2], small, 9),
    ]


def rimless_wheel() -> list[Number]:
    wheel = HybridSystem(
        state=("q", "u"),
        parameters={"stiffness": 2 / 3, "mu": 2 / 3, "half": np.pi / 6, "slope": 0.2},
        modes=[Mode("stance", lambda t, x, p: (x.u, p.stiffness * np.sin(x.q + p.slope)))],
        transitions=[
            Transition(
                "stance",
                "stance",
                Guard(lambda t, x, p: x.q - p.half, direction=+1),
                Reset(lambda t, x, p: (-x.q, p.mu * x.u)),
                name="step",
            )
        ],
    )
    orbit = periodic_orbit(wheel, (-0.5, 0.46), period=2.0, tolerance=TIGHT)
    speed = float(orbit.arc().jumps[0].x_plus[1])
    return [
        against("rolling wheel, rate after a step", "0.460341126609455", speed, float(exact.wheel_speed()))
    ]


def hops(name: str, given: dict[str, float], printed: tuple[str, str], period: float) -> list[Number]:
    """The hop at the energy of the printed apex, which the search holds: there is one hop for each energy."""
    speed, height = map(float, printed)
    orbit = periodic_orbit(
        models.slip_hopper(),
        (0.0, height, speed, -1e-9),
        mode="descent",
        period=period,
        parameters={"g": 10.0, "l0": 1.0, **given},
        tolerance=TIGHT,
    )
    assert "Held as at the guess: energy" in orbit.status.message
    apex = next(jump for jump in orbit.arc().jumps if jump.transition == "apex").x_plus
    theirs, ours = (exact.hopper_gap(*each, given) for each in ((speed, height), (apex[2], apex[1])))
    told = f"a hop moves the printed apex by {theirs:.0e}"
    return [
        Number(f"{name}, speed at the apex", printed[0], f"{apex[2]:.11f}", f"{ours:.0e}", told),
        Number("its height", printed[1], f"{apex[1]:.11f}", "", ""),
    ]


def hopper() -> list[Number]:
    first = {"m": 100.0, "k": 1e4, "alpha": np.pi / 2 - np.radians(5)}
    second = {"m": 1.0, "k": 100.0, "alpha": np.pi / 2 - np.radians(10)}
    return [
        *hops("first hop", first, ("0.513806075894484", "1.238312718076982"), 0.84),
        *hops("second hop", second, ("1.017450873821607", "1.182441943200824"), 0.75),
    ]


def three_disks() -> list[Number]:
    """Stretching per reflection on the shortest cycles, one of the fundamental domain each."""
    disks, sigma = models.three_disk_billiard(), 6.0
    two = periodic_orbit(disks, (0.1, -np.sqrt(3.0), 1.0, 0.0), period=8.0)
    # The triangle touches each disk at the point that faces the centre.
    corner, side = sigma / np.sqrt(3.0) - 1.0, np.sqrt(3.0) * (sigma / np.sqrt(3.0) - 1.0)
    x0 = (0.1 * side, -0.5 * corner, 1.0, 0.0)
    three = periodic_orbit(disks, x0, period=3.0 * side)
    root, s = np.sqrt(sigma * (sigma - 2.0)), 2.0 * sigma / np.sqrt(3.0)
    return [
        against("cycle 0, stretching", NOT_OPENED, np.sqrt(two.multipliers[0].real), sigma - 1.0 + root, 9),
        against(
            "cycle 1, stretching",
            NOT_OPENED,
            float(np.cbrt(three.multipliers[0].real)),
            -(s - 1.0 + s * np.sqrt(1.0 - np.sqrt(3.0) / sigma)),
            9,
        ),
    ]


def buck_converter() -> list[Number]:
    converter, given = models.buck_converter(), {"parameters": {"E": 20.0}}
    run = simulate(converter, (12.0, 0.5, 0.0), (0.0, 0.08), mode="off", **given)
    orbit = periodic_orbit(converter, run.x[-1], mode=str(run.mode[-1]), **given)
    (flip,) = continue_orbit(orbit, "E", (15.0, 30.0)).bifurcations
    voltage = float(exact.converter_flip((2e-4, 24.5)))
    return [against("first period doubling, V", NOT_OPENED, flip.value, voltage, 10)]


def compass_field(t, x, p):
    """Rates of the swing leg ``n`` and the support leg ``s``; point masses on both and on the hip."""
    b, c, s = p.beta, np.cos(x.s - x.n), np.sin(x.s - x.n)
    m11, m12, m22 = b**2, -(1 + b) * b * c, (1 + b) ** 2 * (p.mu + 1) + 1
    first = -(1 + b) * b * s * x.ds**2 - p.g * b * np.sin(x.n)
    second = (1 + b) * b * s * x.dn**2 + p.g * ((p.mu + 1) * (1 + b) + 1) * np.sin(x.s)
    det = m11 * m22 - m12**2
    return x.dn, x.ds, (m22 * first - m12 * second) / det, (m11 * second - m12 * first) / det


def compass_strike(t, x, p):
    """The legs exchange their roles: angular momentum about the new foot, of the old leg about the hip."""
    b, c = p.beta, np.cos(x.s - x.n)
    first = -b * x.dn + (-b + (p.mu * (1 + b) ** 2 + 2 * (1 + b)) * c) * x.ds
    second = -b * x.ds
    m11, m12 = b * (b - (1 + b) * c), (1 + b) * (1 + b - b * c) + 1 + p.mu * (1 + b) ** 2
    m21, m22 = b**2, -b * (1 + b) * c
    det = m11 * m22 - m12 * m21
    return x.s, x.n, (m22 * first - m12 * second) / det, (m11 * second - m21 * first) / det


def compass_gait() -> list[Number]:
    def ground(t, x, p):
        return x.n + x.s + p.slope * np.pi / 90.0

    # Gravity over the length of the lower part of a leg, slope in degrees.
    given = {"mu": 2.0, "beta": 1.0, "g": 9.81 / 0.5}
    compass = HybridSystem(
        state=("n", "s", "dn", "ds"),
        parameters={**given, "slope": 3.0},
        modes=[Mode("behind", compass_field), Mode("ahead", compass_field)],
        transitions=[
            Transition("behind", "ahead", Guard(ground, +1), name="passing"),
            Transition("ahead", "behind", Guard(ground, -1), Reset(compass_strike), name="heelstrike"),
        ],
    )
    x0 = (-0.3234, 0.2187, -0.3774, -1.0924)
    orbit = periodic_orbit(compass, x0, mode="behind", period=0.73)
    (first,) = continue_orbit(orbit, "slope", (2.5, 6.0)).bifurcations
    _, second = continue_orbit(switch_branch(first), "slope", (4.0, 5.0)).bifurcations
    slope = exact.compass_flip(compass_field, compass_strike, given)
    return [
        against("first period doubling, degrees", NOT_OPENED, first.value, slope, 9),
        Number("second period doubling", NOT_OPENED, f"{second.value:.9f}", "", ""),
    ]


def woodpecker() -> list[Number]:
    toy = models.woodpecker()
    fall = simulate(toy, (0.0, -0.1034, -0.2788, -0.3411, 0.0, -7.4583), (0.0, 2.0))
    orbit = periodic_orbit(toy, fall.x[-1], mode=fall.end.mode, period=0.146)
    p = toy.parameters
    period, back = exact.woodpecker_pecks(orbit.x0, p, 0.6, 1e-6)
    t = np.linspace(orbit.t0, orbit.t0 + orbit.period, 2001)
    # In flight the spring alone turns bird and sleeve against each other, here for a quarter of a period.
    flight = simulate(toy, (0.0, 0.005, -0.005, 0.0, 0.0, 0.0), (0.0, 0.01))
    quarter = root_scalar(lambda t: flight(t, "phi_M") - flight(t, "phi_S"), bracket=(0.0, 0.006)).root
    return [
        Number("pecking, period (s)", "0.1452", f"{orbit.period:.5f}", "", f"{period:.5f}"),
        Number("bird, smallest angle", "-0.53", f"{orbit.arc()(t, 'phi_S').min():.4f}", "", f"{back:.4f}"),
        against("in flight, frequency (Hz)", "72.91", 1 / (4 * quarter), exact.woodpecker_frequency(p), 6),
    ]


def exponents(system: str, spectrum: LyapunovSpectrum, required: str) -> list[Number]:
    """The first and the last exponent, with two standard errors, and what all of them sum to."""
    dimension = kaplan_yorke_dimension(spectrum.exponents)
    pairs = zip(("first", "last"), (0, -1), strict=True)
    told = f"sum {spectrum.exponents.sum():.9f}, {required}"
    return [
        Number(
            f"{system}, {name} exponent",
            NOT_OPENED,
            f"{spectrum.exponents[i]:.5f}",
            f"{2 * spectrum.standard_error[i]:.0e}",
            told if i else f"dimension {dimension:.4f}",
        )
        for name, i in pairs
    ]


def jerk_circuit() -> list[Number]:
    circuit = from_equations(
        lambda t, x, p: (x.v, x.a, -0.6 * x.a - x.v + np.abs(x.x) - 1.0), state=("x", "v", "a")
    )
    spectrum = lyapunov_spectrum(circuit, (0.0, 0.0, 0.0), interval=10.0, intervals=500_000, history=False)
    return exponents("x''' = -0.6 x'' - x' + abs(x) - 1", spectrum, "-0.6 required")


def double_scroll() -> list[Number]:
    spectrum = lyapunov_spectrum(
        models.chua_circuit(), (0.1, 0.0, 0.0), interval=10.0, intervals=300_000, history=False
    )
    return exponents("double scroll", spectrum, f"{spectrum.sum_rule:.9f} by the sum rule")


ROWS = [
    Row(1, long_gait),
    Row(1, short_gait),
    Row(2, multipliers_of_the_gaits),
    Row(3, rimless_wheel),
    Row(4, hopper),
    Row(5, three_disks),
    Row(6, buck_converter),
    Row(7, compass_gait),
    Row(8, woodpecker),
    Row(9, jerk_circuit, quick=False),
    Row(10, double_scroll, quick=False),
]


def lines_of(row: Row) -> list[str]:
    """The lines of a row in the table; the seconds are those of its library and independent numbers."""
    begin = time.perf_counter()
    numbers = row.find()
    seconds = f"{time.perf_counter() - begin:.1f}"
    lines = []
    for i, number in enumerate(numbers):
        cells = [f"[{row.source}]" if i == 0 else "", *attrs.astuple(number), seconds if i == 0 else ""]
        lines.append(f"| {' | '.join(cells)} |\n")
    return lines


def renew(page: Path) -> None:
    """Write the table of a page anew."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    table = HEAD + "".join(line for row in ROWS for line in lines_of(row))
    page.write_text(f"{before}{BEGIN}\n{table}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    renew(PAGE)
