"""Exponents of equations with kinks and jumps: integrated straight through, smoothed, and split.

``python -m benchmarks.plain_equations`` makes ``docs/plain_equations.png`` and prints its numbers, and
``--cost`` compares the times of split systems with those of the models written by hand.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

import attrs
import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import DOP853

import models
from benchmarks.common import file_in, heading, options, table
from hybrid import HybridSystem, from_equations, simulate
from hybrid.plot.styles import COLOURS, INK, style
from lyapunov import lyapunov_spectrum
from tests.reference.plain_models import PLAIN, pair

PICTURE = "plain_equations.png"
WIDTHS = (1e-1, 1e-2, 1e-3, 1e-4)
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
INTERVALS = 200
# Longest time for one estimate, in seconds. One that is cut off counts with the intervals that it has.
PATIENCE = 20.0
# Pairs of runs for the cost, and the shortest time that counts, in seconds.
PAIRS = 60
SHORTEST = 0.02
Field = Callable[[Any, Any, Any], tuple[Any, ...]]
Sign = Callable[[Any], Any]


@attrs.frozen
class Oscillator:
    """A textbook oscillator, with the sign function still open.

    Attributes
    ----------
    equations
        By the sign function: the field ``f(t, x, p)``.
    jacobian
        ``D_x f`` beside the jumps, ``(t, x, p)`` to ``(2, 2)``.
    first
        Its first exponent, from the model written by hand.
    """

    title: str
    model: HybridSystem
    equations: Callable[[Sign], Field]
    jacobian: Callable[..., np.ndarray]
    x0: tuple[float, float]
    interval: float
    first: float


def stop_with_preload() -> Oscillator:
    """A mass between two springs that are pressed against their seats."""
    model = attrs.evolve(
        models.stop_oscillator(),
        parameters={
            **models.stop_oscillator().parameters,
            "F0": 1.0,
            "A": 1.2,
            "w": 0.8,
        },
    )

    def equations(sign: Sign) -> Field:
        def field(t, x, p):
            right, left = 0.5 * (1 + sign(x.x - p.d)), 0.5 * (1 + sign(-x.x - p.d))
            stops = right * (p.F0 + p.ks * (x.x - p.d)) - left * (p.F0 - p.ks * (x.x + p.d))
            return x.v, p.A * np.cos(p.w * t) - p.c * x.v - p.k * x.x - stops

        return field

    def jacobian(t, x, p):
        return np.array([[0.0, 1.0], [-p.k - p.ks * (abs(x.x) > p.d), -p.c]])

    return _measured("stops with preload", model, equations, jacobian, (0.3, 0.2), None)


def dry_friction() -> Oscillator:
    """Den Hartog's forced mass on a dry surface."""
    model = models.dry_friction_oscillator()

    def equations(sign: Sign) -> Field:
        return lambda t, x, p: (x.v, p.A * np.cos(p.w * t) - p.c * x.v - x.x - p.f * sign(x.v))

    def jacobian(t, x, p):
        return np.array([[0.0, 1.0], [-1.0, -p.c]])

    return _measured("dry friction", model, equations, jacobian, (0.3, 0.1), None)


def block_on_belt() -> Oscillator:
    """A block that a belt carries along until its spring pulls it loose."""
    model = models.stick_slip()

    def equations(sign: Sign) -> Field:
        return lambda t, x, p: (
            x.v,
            -p.Fs * sign(x.v - p.belt) / (1 + p.delta * (x.v - p.belt) * sign(x.v - p.belt)) - x.x,
        )

    def jacobian(t, x, p):
        slide = x.v - p.belt
        slope = p.Fs * p.delta / (1 + p.delta * abs(slide)) ** 2
        return np.array([[0.0, 1.0], [-1.0, slope]])

    return _measured("block on a belt", model, equations, jacobian, (0.3, 0.1), 5.0)


def _measured(title, model, equations, jacobian, x0, interval) -> Oscillator:
    spectrum = lyapunov_spectrum(model, x0, intervals=20_000, transient=500, interval=interval)
    interval = interval or model.forcing_period()
    return Oscillator(title, model, equations, jacobian, x0, interval, float(spectrum.exponents[0]))


def split_of(oscillator: Oscillator, sign: Sign = np.sign) -> HybridSystem:
    """The equations as a system: split if the sign jumps, one smooth mode if it does not."""
    model = oscillator.model
    return from_equations(
        oscillator.equations(sign), state=model.state, parameters=model.parameters, period=model.period
    )


def by_library(oscillator: Oscillator, system: HybridSystem) -> tuple[np.ndarray, float]:
    """Running estimates of the first exponent by the library, and the seconds that they took."""
    options = {} if system.period else {"interval": oscillator.interval}
    lyapunov_spectrum(system, oscillator.x0, intervals=1, **options)
    begun = time.perf_counter()
    spectrum = lyapunov_spectrum(system, oscillator.x0, intervals=INTERVALS, transient=50, **options)
    return spectrum.history[:, 0], time.perf_counter() - begun


def straight_through(oscillator: Oscillator, tolerance: float) -> tuple[np.ndarray, float]:
    """The same by SciPy: state and tangent vectors as one smooth system, which they are not."""
    variables = oscillator.model.variables
    p = variables.parameter_view(oscillator.model.parameter_values())
    field = oscillator.equations(np.sign)

    def whole(t, y):
        x = variables.state_view(y[:2])
        rates = oscillator.jacobian(t, x, p) @ y[2:].reshape(2, 2)
        return np.concatenate([np.array(field(t, x, p), float), rates.ravel()])

    y, grown, total, begun = np.concatenate([oscillator.x0, np.eye(2).ravel()]), [], 0.0, time.perf_counter()
    for k in range(50 + INTERVALS):
        run = DOP853(
            whole, k * oscillator.interval, y, (k + 1) * oscillator.interval, rtol=tolerance, atol=tolerance
        )
        while run.status == "running":
            run.step()
            if time.perf_counter() - begun > PATIENCE:
                return np.array(grown), time.perf_counter() - begun
        q, r = np.linalg.qr(run.y[2:].reshape(2, 2))
        y = np.concatenate([run.y[:2], q.ravel()])
        if k >= 50:
            total += np.log(abs(r[0, 0]))
            grown.append(total / ((k - 49) * oscillator.interval))
    return np.array(grown), time.perf_counter() - begun


def estimates(oscillator: Oscillator) -> Iterator[tuple[str, str, np.ndarray, float]]:
    """Kind, label, running estimates and seconds of every way to the exponent."""
    for tolerance in TOLERANCES:
        yield "straight", f"straight through, {tolerance:.0e}", *straight_through(oscillator, tolerance)
    for width in WIDTHS:
        smooth = split_of(oscillator, lambda u, width=width: np.tanh(u / width))
        yield "smoothed", f"tanh, width {width:.0e}", *by_library(oscillator, smooth)
    yield "split", "split", *by_library(oscillator, split_of(oscillator))


def main() -> None:
    """Make the picture and print its numbers."""
    parser = options(__doc__)
    parser.add_argument("--cost", action="store_true", help="only the times of split and written models")
    given = parser.parse_args()
    if given.cost:
        cost()
        return
    colours = dict(zip(("straight", "smoothed", "split"), COLOURS, strict=False))
    with style("chart"):
        figure, grid = plt.subplots(2, 3, figsize=(11.0, 6.2), layout="constrained")
        for column, make in enumerate((stop_with_preload, dry_friction, block_on_belt)):
            oscillator = make()
            heading(f"{oscillator.title}: first exponent {oscillator.first:.6f}")
            rows = []
            above, below = grid[:, column]
            for kind, label, history, seconds in estimates(oscillator):
                last = history[-1] if len(history) else np.nan
                error = abs(last - oscillator.first)
                rows.append([label, f"{last:.5f}", f"{error:.1e}", str(len(history)), f"{seconds:.3g}"])
                print(rows[-1], flush=True)
                above.plot(np.arange(1, len(history) + 1), history, color=colours[kind], alpha=0.8)
                whole = len(history) == INTERVALS
                below.plot(
                    seconds, max(error, 1e-9), "o", color=colours[kind], fillstyle="full" if whole else "none"
                )
                note = label.replace("straight through, ", "").replace("tanh, width ", "")
                below.annotate(
                    note, (seconds, max(error, 1e-9)), (4, 3), textcoords="offset points", fontsize=7
                )
            above.axhline(oscillator.first, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
            spread = max(0.1, 3 * abs(oscillator.first))
            above.set(
                title=oscillator.title,
                xlabel="intervals",
                xscale="log",
                ylim=(oscillator.first - spread, oscillator.first + 2 * spread),
            )
            below.set(xlabel="seconds for 250 intervals", xscale="log", yscale="log")
            table(["way", "exponent", "error", "intervals", "seconds"], rows)
        grid[0, 0].set_ylabel("first exponent so far")
        grid[1, 0].set_ylabel("error")
        handles = [plt.Line2D([], [], color=colour, marker="o") for colour in colours.values()]
        names = ["straight through (SciPy, by tolerance)", "smoothed (tanh, by width)", "split"]
        figure.legend(handles, names, loc="outside lower center", ncols=3)
        figure.savefig(file_in(given.output, PICTURE), dpi=150)


def cost() -> None:
    """Time of a split system over that of the model written by hand: median of alternated pairs."""
    rows = []
    for name, plain in PLAIN.items():
        systems = pair(name)
        times: list[list[float]] = [[], []]
        repeats = 1
        while len(times[0]) < PAIRS:
            for system, own in zip(systems, times, strict=True):
                begun = time.perf_counter()
                for _ in range(repeats):
                    simulate(system, plain.x0, (0.0, plain.end), samples=[plain.end])
                own.append(time.perf_counter() - begun)
            if times[0][-1] < SHORTEST:
                # The first runs compile. Runs too short to be timed are repeated.
                repeats *= 2
                times = [[], []]
        low, middle, high = statistics.quantiles((b / a for a, b in zip(*times, strict=True)), n=4)
        rows.append(
            [name, f"{1e3 * min(times[0]) / repeats:.3g}", f"{middle:.3f}", f"{low:.3f} to {high:.3f}"]
        )
        print(*rows[-1], flush=True)
    heading("Time of the split equations over that of the model written by hand")
    table(["model", "ms by hand", "median", "quartiles"], rows)


if __name__ == "__main__":
    main()
