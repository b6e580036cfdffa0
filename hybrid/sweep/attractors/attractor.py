"""An attractor as the user sees it, and a mapping of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.display.ranges import described
from hybrid.display.tables import counted, html_table
from hybrid.simulation.labelled import Names, attributes
from hybrid.status import Status
from hybrid.system.entries import has_age
from hybrid.system.graph import HybridSystem
from hybrid.transform.aged import original_of

if TYPE_CHECKING:
    import xarray

KINDS = ("equilibrium", "periodic", "torus", "chaotic")
UNKNOWN = "not known"
# The kind of an attractor that features tell from others.
BY_FEATURES = "by features"


@attrs.frozen(eq=False, repr=False)
class Attractor:
    """An attractor on its section.

    Attributes
    ----------
    kind
        ``"equilibrium"``, ``"periodic"``, ``"torus"`` or ``"chaotic"``, by the signs of the exponents: one
        within two standard errors of zero counts as zero. ``"not known"`` if they could not be computed,
        ``"by features"`` for a search by features, which looks for neither a period nor exponents.
    points, mode
        Points of the section ``(P, n)`` and names of their modes ``(P,)``: one round of a periodic orbit, in
        the order in which it visits them; a sample of other attractors.
    round
        How many points one round has: for a forced system the number of forcing periods. 0 if the points do
        not come back: the motion is not periodic, or the points of an orbit are taken at equal times.
    period
        Time of one round; nan if the motion is not periodic.
    jumps
        Jumps per period, or per point if the motion is not periodic.
    exponents, standard_error
        Lyapunov exponents ``(n,)``, largest first, in inverse units of time, and their errors. Those of a
        periodic orbit are the logarithms of its multipliers over the period.
    start
        A state that leads to it ``(n,)``.
    features
        Features by name, if the search was by features: those of the run in the middle of the group. The
        attractor is also a mapping of their names: ``attractor["peak"]``.
    ranges
        The lowest and the highest value of each feature among the runs that lead to the attractor.

    Examples
    --------
    >>> import numpy as np
    >>> import hybrid, models
    >>> found = hybrid.attractors(models.impact_oscillator(), {"x": (-1.0, 1.0), "v": (-2.0, 2.0)})
    >>> one = found[1]
    >>> one.kind, round(one.period / (2 * np.pi), 6), one.points.shape
    ('periodic', 1.0, (1, 2))
    """

    kind: str
    points: np.ndarray
    mode: np.ndarray
    round: int
    period: float
    jumps: float
    exponents: np.ndarray
    standard_error: np.ndarray
    start: np.ndarray
    features: Mapping[str, float] = attrs.field(factory=dict)
    ranges: Mapping[str, tuple[float, float]] = attrs.field(factory=dict)

    def __getitem__(self, name: str) -> float:
        """The value of a feature.

        Raises
        ------
        ArgumentError
            If the attractor has no such feature.
        """
        return self.features[arguments.known("name: Feature", name, self.features, "Features")]

    def __repr__(self) -> str:
        return self._told({})

    def _told(self, sizes: Mapping[str, float]) -> str:
        """The attractor in a line; ``sizes`` are those of the features of all attractors."""
        if self.features:
            return f"<Attractor: {described(self.ranges, sizes)}, {self.jumps:.4g} jumps per point>"
        what = f"{self.kind}, {counted(self.round, 'point')}" if self.round else self.kind
        values = ", ".join(f"{value:.4g}" for value in self.exponents)
        return f"<Attractor: {what}, {self.jumps:.4g} jumps, exponents [{values}]>"


class Attractors(Mapping[int, Attractor]):
    """Attractors by label: 1, 2, ...

    The labels depend on the attractors alone: equilibria and periodic orbits come first, those of fewer
    points before others, then tori, then chaos; among equals the one with the lowest first component.

    Attributes
    ----------
    status
        How the search ended.

    Examples
    --------
    >>> import hybrid, models
    >>> found = hybrid.attractors(models.impact_oscillator(), {"x": (-1.0, 1.0), "v": (-2.0, 2.0)})
    >>> list(found), found[1].kind
    ([1], 'periodic')
    """

    def __init__(self, found: tuple[Attractor, ...], status: Status, names: Names) -> None:
        self._found, self.status, self.names = found, status, names

    def __getitem__(self, label: int) -> Attractor:
        if label not in range(1, len(self._found) + 1):
            raise KeyError(label)
        return self._found[label - 1]

    def __iter__(self) -> Iterator[int]:
        return iter(range(1, len(self._found) + 1))

    def __len__(self) -> int:
        return len(self._found)

    def __repr__(self) -> str:
        lines = [f"<{counted(len(self), 'attractor')}, {self.status.brief}>"]
        names = self._found[0].features if self._found else {}
        sizes = {name: max(abs(each[name]) for each in self._found) for name in names}
        return "\n".join([*lines, *(f"{label}: {each._told(sizes)}" for label, each in self.items())])

    def _repr_html_(self) -> str:
        """A table for a notebook."""
        if any(each.features for each in self._found):
            return self._features_table()
        rows = [
            [str(label), each.kind, str(each.round or ""), f"{each.jumps:.4g}", f"{each.exponents[0]:.4g}"]
            for label, each in self.items()
        ]
        head = ("label", "kind", "points per round", "jumps", "largest exponent")
        return f"{html_table(head, rows)}\n<p>{escape(str(self.status))}</p>"

    def _features_table(self) -> str:
        names = [*self._found[0].features]
        rows = [
            [str(label), *(f"{each[name]:.6g}" for name in names), f"{each.jumps:.4g}"]
            for label, each in self.items()
        ]
        head = ("label", *names, "jumps per point")
        return f"{html_table(head, rows)}\n<p>{escape(str(self.status))}</p>"

    def to_xarray(self) -> xarray.Dataset:
        """The attractors over the axis ``attractor``, with points filled up with nan."""
        import xarray

        n, found = len(self.names.state), self._found
        directions = len(found[0].exponents) if found else n
        most = max((len(each.points) for each in found), default=0)
        points, modes = np.full((len(found), most, n), np.nan), np.full((len(found), most), "", dtype=object)
        for i, each in enumerate(found):
            points[i, : len(each.points)], modes[i, : len(each.points)] = each.points, each.mode
        axes = ("attractor", "point", "state")
        variables = {
            "kind": ("attractor", np.array([each.kind for each in found], dtype=object)),
            "round": ("attractor", np.array([each.round for each in found], dtype=np.int64)),
            "period": ("attractor", np.array([each.period for each in found]), self.names.of("t")),
            "jumps": ("attractor", np.array([each.jumps for each in found])),
            "exponents": (("attractor", "exponent"), _rows(found, "exponents", directions), self.names.rate),
            "standard_error": (
                ("attractor", "exponent"),
                _rows(found, "standard_error", directions),
                self.names.rate,
            ),
            "points": (axes, points, self.names.states),
            "mode_of_point": (axes[:2], modes),
        }
        variables |= feature_variables(found)
        coords = {"attractor": np.arange(1, len(found) + 1), "exponent": np.arange(1, directions + 1)}
        if found and found[0].features:
            coords["feature"] = np.array([*found[0].features])
        return xarray.Dataset(
            variables, {**coords, **self.names.coords()}, attributes("attractors", self.status)
        )


def feature_variables(found: tuple[Attractor, ...]) -> dict[str, Any]:
    """Features of attractors and their ranges, over the axes ``attractor`` and ``feature``."""
    if not found or not found[0].features:
        return {}
    over = "attractor", "feature"
    values = np.array([[*each.features.values()] for each in found])
    ranges = np.array([[*each.ranges.values()] for each in found])
    return {
        "features": (over, values),
        "lowest_feature": (over, ranges[..., 0]),
        "highest_feature": (over, ranges[..., 1]),
    }


def unaged(found: tuple[Attractor, ...], system: HybridSystem) -> tuple[tuple[Attractor, ...], HybridSystem]:
    """Attractors of a system without the age, if the age counts for nothing at all of their points.

    It then has no part in their states, and the exponent minus infinity. Returned with the system.
    """
    age = system.age
    modes = {str(mode) for each in found for mode in each.mode}
    if age is None or any(has_age(system, mode) for mode in modes):
        return found, system
    shown = (
        attrs.evolve(
            each,
            points=np.delete(each.points, age, axis=1),
            exponents=each.exponents[:-1],
            standard_error=each.standard_error[:-1],
            start=np.delete(each.start, age),
        )
        for each in found
    )
    return tuple(shown), original_of(system)


def _rows(found: tuple[Attractor, ...], name: str, n: int) -> np.ndarray:
    return np.array([getattr(each, name) for each in found]).reshape(-1, n)
