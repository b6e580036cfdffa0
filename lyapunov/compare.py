"""Compare models of one system by their exponents and their cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, HybridSystem, Status, arguments, compile_system
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import progress_bar
from hybrid.display.tables import table
from hybrid.solvers import Solver
from hybrid.status import SUCCESS
from hybrid.system.graph import as_system
from lyapunov.spectrum import LyapunovSpectrum, lyapunov_spectrum


@attrs.frozen(eq=False, repr=False)
class ModelComparison:
    """Spectra of several models at the same parameters; ``print`` shows them as a table.

    Attributes
    ----------
    spectra
        Maps the name of a model to its spectra, one per point of ``points``.
    reference
        Name of the model that the others are compared with.
    points
        Parameter values, by name.

    Examples
    --------
    >>> import models
    >>> from lyapunov import compare_models
    >>> from models.contact import Hertz, Rigid, hertz_stiffness
    >>> laws = {"rigid": Rigid(e=1.0), "Hertz": Hertz(hertz_stiffness())}
    >>> systems = {name: models.vibroimpact(law) for name, law in laws.items()}
    >>> start = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
    >>> found = compare_models(systems, start, reference="Hertz", intervals=50)
    >>> found.cheapest(tolerance=0.02), len(found.spectra["rigid"])
    ('rigid', 1)
    """

    spectra: Mapping[str, tuple[LyapunovSpectrum, ...]]
    reference: str
    points: tuple[Mapping[str, float], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the models, cheapest first."""
        return tuple(sorted(self.spectra, key=self.cost))

    @property
    def status(self) -> Status:
        """Status of the first run that did not succeed, or SUCCESS."""
        runs = (spectrum.status for spectra in self.spectra.values() for spectrum in spectra)
        return next((status for status in runs if not status.ok), SUCCESS)

    def cost(self, name: str) -> float:
        """Mean number of solver steps per interval over all points, including rejected steps."""
        return float(np.mean([spectrum.steps_per_interval for spectrum in self._of(name)]))

    def distance(self, name: str) -> np.ndarray:
        """Largest difference between the sorted exponents of the model and the reference, ``(points,)``.

        The difference is nan where a run of either model did not succeed.
        """
        pairs = zip(self._of(name), self._of(self.reference), strict=True)
        return np.array([_distance(spectrum, reference) for spectrum, reference in pairs])

    def within(self, tolerance: float) -> tuple[str, ...]:
        """Names of the models within ``tolerance`` of the reference at every point, cheapest first."""
        wanted = "be at least 0, in inverse units of time"
        tolerance = arguments.not_negative("tolerance", tolerance, wanted, infinite=True)
        return tuple(
            name
            for name in self.names
            if name == self.reference or bool(np.all(self.distance(name) <= tolerance))
        )

    def cheapest(self, tolerance: float) -> str:
        """Name of the cheapest model within ``tolerance`` of the exponents of the reference at every point.

        Parameters
        ----------
        tolerance
            In inverse units of time. The reference is within any tolerance.

        Raises
        ------
        ArgumentError
            If the tolerance is negative.
        """
        return self.within(tolerance)[0]

    def _of(self, name: str) -> tuple[LyapunovSpectrum, ...]:
        return self.spectra[arguments.known("Model", name, self.spectra, "Models")]

    def __repr__(self) -> str:
        return f"<ModelComparison of {', '.join(self.names)} at {len(self.points)} points>"

    def __str__(self) -> str:
        rows = []
        for name in self.names:
            spectra, distance = self._of(name), self.distance(name)
            good = distance[np.isfinite(distance)]
            rows.append(
                [
                    name,
                    f"{self.cost(name):.1f}",
                    f"{np.mean([spectrum.jumps_per_interval for spectrum in spectra]):.2f}",
                    *(("0", "0") if name == self.reference else _figures(good)),
                    f"{sum(not spectrum.status.ok for spectrum in spectra)}",
                ]
            )
        headings = ["model", "steps", "jumps", "median distance", "largest distance", "failed"]
        return table(headings, rows, numbers=True)


def compare_models(
    systems: Mapping[str, HybridSystem],
    x0: ArrayLike,
    *,
    reference: str,
    points: Sequence[Mapping[str, float]] = ({},),
    mode: str | None = None,
    k: int | None = None,
    intervals: int = 300,
    interval: float | None = None,
    transient: int = 200,
    solver: Solver | None = None,
    progress: bool = False,
) -> ModelComparison:
    """Exponents and cost of several models of one system, over a range of parameters.

    :meth:`ModelComparison.cheapest` gives the cheapest model that agrees with the reference. All models
    start at the same state at every point. Where attractors coexist, two models may reach different
    attractors; the distance includes this difference.

    Parameters
    ----------
    systems
        Maps names to models. All models have the same states, and the parameters named in ``points``.
    x0, mode, k, intervals, interval, transient, solver
        As for :func:`lyapunov_spectrum`.
    reference
        Name of the model to compare the others with.
    points
        Parameter values to compare at, each a mapping as for ``parameters`` of :func:`lyapunov_spectrum`; by
        default the models' declared values.
    progress
        Whether to show a progress bar.

    Returns
    -------
    ModelComparison

    Raises
    ------
    ModelError
        If a model cannot be compiled or lacks the mode ``mode``.
    ArgumentError
        If ``systems`` lacks the reference, the states differ, or an argument does not fit.

    Examples
    --------
    >>> import models
    >>> from lyapunov import compare_models
    >>> from models.contact import Hertz, Rigid, hertz_stiffness
    >>> laws = {"rigid": Rigid(e=1.0), "Hertz": Hertz(hertz_stiffness())}
    >>> found = compare_models(
    ...     {name: models.vibroimpact(law) for name, law in laws.items()},
    ...     (-0.00765806, -0.00411675, 0.05565196, -0.35621583),
    ...     reference="Hertz",
    ...     points=[{"omega": 7.39}, {"omega": 7.40}],
    ...     intervals=50,
    ... )
    >>> found.cheapest(tolerance=0.02), found.cheapest(tolerance=1e-3)
    ('rigid', 'Hertz')
    """
    models = {
        name: as_system(f"systems[{arguments.shown(name)}]", system)
        for name, system in arguments.mapping("systems", systems, "map names to models").items()
    }
    if not models:
        raise ArgumentError("systems must hold at least one model; got none.")
    arguments.known("Reference model", reference, models, "Models")
    values = [
        arguments.mapping(f"points[{i}]", point)
        for i, point in enumerate(arguments.items("points", points, "be a list of mappings"))
    ]
    if not values:
        raise ArgumentError("points must hold at least one mapping of parameter values; got none.")
    for i, point in enumerate(values):
        for system in models.values():
            for name, value in point.items():
                arguments.known(f"points[{i}]: Parameter", name, system.parameters, "Parameters")
                arguments.number(f"points[{i}]: Parameter {name!r}", value)
    if len({system.state for system in models.values()}) > 1:
        states = ", ".join(f"{system.state} in {name!r}" for name, system in models.items())
        raise ArgumentError(f"systems must have the same states; got {states}.")
    progress = arguments.flag("progress", progress)
    spectra: dict[str, tuple[LyapunovSpectrum, ...]] = {}
    for system in models.values():
        compile_system(system)
    with CTRL_C, progress_bar(len(models) * len(values), "Spectra", progress) as bar:
        for name, system in models.items():
            found = []
            for parameters in values:
                found.append(
                    lyapunov_spectrum(
                        system,
                        x0,
                        mode=mode,
                        parameters=parameters,
                        k=k,
                        intervals=intervals,
                        interval=interval,
                        transient=transient,
                        solver=solver,
                        history=False,
                    )
                )
                bar.update(1)
            spectra[name] = tuple(found)
    return ModelComparison(spectra, reference, tuple(values))


def _distance(spectrum: LyapunovSpectrum, reference: LyapunovSpectrum) -> float:
    if not (spectrum.status.ok and reference.status.ok):
        return float("nan")
    mine, theirs = np.sort(spectrum.exponents), np.sort(reference.exponents)
    # Two exponents of minus infinity do not differ.
    return float(np.max(np.abs(np.subtract(mine, theirs, where=mine != theirs, out=np.zeros(len(mine))))))


def _figures(distance: np.ndarray) -> tuple[str, str]:
    return (f"{np.median(distance):.1e}", f"{distance.max():.1e}") if len(distance) else ("-", "-")
