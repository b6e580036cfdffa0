"""Labels of curves, moved along their curves until none lies on another."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import attrs
import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Annotation, Text
    from matplotlib.transforms import BboxBase

# Where a label may be on its curve, as a fraction, and beside it, in heights of the label.
ALONG = np.linspace(0.2, 0.8, 25)
BESIDE = (0.0, 1.0, -1.0)
# The distance that labels keep, in points.
GAP = 1.5
# How often all labels look for a place, points of a curve, and what covering a whole curve counts.
ROUNDS, POINTS, OF_CURVES = 3, 41, 2.0
NOWHERE = np.full((1, 2), -np.inf)


@attrs.frozen(eq=False)
class CurveLabel:
    """A label at the fraction ``along`` of a quadratic Bezier curve ``(3, 2)``, in data coordinates."""

    text: Text
    curve: np.ndarray
    along: float

    def places(self) -> np.ndarray:
        """Places ``(N, 2)`` on the curve, the one that is wanted most first."""
        order = [self.along, *sorted(ALONG, key=lambda each: abs(each - self.along))]
        return np.array([point_on(self.curve, each) for each in order])

    def line(self) -> np.ndarray:
        """Points ``(N, 2)`` of the curve."""
        return np.array([point_on(self.curve, each) for each in np.linspace(0.0, 1.0, POINTS)])


def point_on(curve: np.ndarray, along: float) -> np.ndarray:
    """The point of a quadratic Bezier curve ``(3, 2)`` at a fraction of it."""
    start, control, end = curve
    return (1 - along) ** 2 * start + 2 * along * (1 - along) * control + along**2 * end


def lay_out(ax: Axes) -> None:
    """Let the layout decide where the axes and their texts are."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    with warnings.catch_warnings():
        # A figure that is too small for a layout is drawn without one, as Matplotlib says when it is shown.
        warnings.filterwarnings("ignore", "constrained_layout not applied", UserWarning)
        figure.draw_without_rendering()


def keep_inside(ax: Axes, notes: Iterable[Annotation]) -> None:
    """Move texts at a distance from points, given in points, into the figure. The axes have been laid out."""
    canvas, unit = ax.figure.bbox, ax.figure.dpi / 72
    for note in notes:
        box = note.get_window_extent()
        right = max(canvas.x0 - box.x0, 0.0) - max(box.x1 - canvas.x1, 0.0)
        up = max(canvas.y0 - box.y0, 0.0) - max(box.y1 - canvas.y1, 0.0)
        x, y = note.xyann
        note.xyann = (x + right / unit, y + up / unit)


def keep_apart(ax: Axes, labels: Sequence[CurveLabel], fixed: Iterable[Text]) -> None:
    """Move labels that lie on others, on ``fixed`` texts, on other curves or outside the figure.

    Where no place is free, a label has the one where it covers least. The axes have been laid out.
    """
    gap = GAP * ax.figure.dpi / 72
    known = [_box(text).padded(gap) for text in fixed]
    curves = [ax.transData.transform(label.line()) for label in labels]
    places = [label.places() for label in labels]
    boxes: dict[int, BboxBase] = {}
    # A label that has been moved may leave a place for one before it.
    for _ in range(ROUNDS):
        for i, label in enumerate(labels):
            others = [boxes[k].padded(gap) for k in boxes if k != i]
            room = _Room(ax, [*known, *others], np.concatenate([*curves[:i], *curves[i + 1 :], NOWHERE]))
            place, boxes[i] = room.best(places[i], _box(label.text))
            label.text.set_position((float(place[0]), float(place[1])))
    for label, wanted in zip(labels, places, strict=True):
        if not np.array_equal(label.text.get_position(), wanted[0]):
            # The places are those of this layout, which they must not change.
            label.text.set_in_layout(False)


@attrs.frozen(eq=False)
class _Room:
    """What a label must not lie on, in pixels: boxes, and points ``(N, 2)`` of curves."""

    ax: Axes
    boxes: Sequence[BboxBase]
    points: np.ndarray

    def best(self, places: np.ndarray, box: BboxBase) -> tuple[np.ndarray, BboxBase]:
        """The first of the places, in data coordinates, where a label covers least, and what it covers."""
        from matplotlib.transforms import Bbox

        half = np.array([box.width, box.height]) / 2
        least = np.inf
        best: tuple[np.ndarray, BboxBase] = (places[0], box)
        for beside in BESIDE:
            for place in places:
                middle = self.ax.transData.transform(place) + np.array([0.0, beside * box.height])
                there = Bbox([middle - half, middle + half])
                covered = self._covered(there, least)
                if covered < least:
                    moved = place if beside == 0.0 else self.ax.transData.inverted().transform(middle)
                    least, best = covered, (moved, there)
                if covered == 0.0:
                    return best
        return best

    def _covered(self, box: BboxBase, least: float) -> float:
        """What a box covers, in shares of its area; a curve counts less than a text."""
        area = box.width * box.height
        found = sum(_common(box, other) for other in self.boxes) + area - _common(box, self.ax.figure.bbox)
        if found >= least * area:
            return np.inf
        inside = (self.points > box.min).all(axis=1) & (self.points < box.max).all(axis=1)
        return float(found / area + OF_CURVES * inside.mean())


def _box(text: Text) -> BboxBase:
    """What a text covers, with the box around it."""
    patch = text.get_bbox_patch()
    return text.get_window_extent() if patch is None else patch.get_window_extent()


def _common(one: BboxBase, other: BboxBase) -> float:
    """The area that two boxes have in common."""
    width = min(one.x1, other.x1) - max(one.x0, other.x0)
    height = min(one.y1, other.y1) - max(one.y0, other.y0)
    return float(max(width, 0.0) * max(height, 0.0))
