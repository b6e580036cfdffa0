"""How mixed basins of attraction are: their entropy, and the dimension of the boundary between them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError

if TYPE_CHECKING:
    import xarray

# Fewest boxes along an axis from which shares are taken.
FEWEST = 16


@attrs.frozen(eq=False)
class BasinEntropy:
    """How uncertain it is to which attractor a start in a box leads.

    Attributes
    ----------
    entropy
        The mean over all boxes of the entropy of the labels in a box, in units of the natural logarithm: 0
        where each box has one label, ``log(A)`` where all ``A`` are mixed everywhere.
    boundary
        The mean over the boxes that hold more than one label; nan if there are none.
    is_fractal
        Whether ``boundary`` exceeds ``log(2)``: then some part of the boundary is not smooth. The converse
        does not hold.
    size
        The number of cells along a side of a box.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid import basin_entropy
    >>> halves = np.repeat([[1, 1, 2, 2]], 4, axis=0)
    >>> basin_entropy(halves, size=2).entropy, round(basin_entropy(halves, size=4).entropy, 4)
    (0.0, 0.6931)
    """

    entropy: float
    boundary: float
    is_fractal: bool
    size: int


@attrs.frozen(eq=False)
class UncertaintyExponent:
    """How the share of uncertain starts falls with the error of a start.

    Attributes
    ----------
    exponent, standard_error
        The exponent ``a`` of ``share ~ size ** a``, and its standard error from the scatter about the line.
    dimension
        Of the boundary, ``d - a`` for a grid with ``d`` axes.
    sizes, shares
        Lengths of a side of a box ``(K,)``, in distances between two starts, and the shares of boxes with
        more than one label.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid import uncertainty_exponent
    >>> halves = np.repeat([1, 2], 512)
    >>> abs(uncertainty_exponent(halves).dimension) < 0.01
    True
    """

    exponent: float
    standard_error: float
    dimension: float
    sizes: np.ndarray
    shares: np.ndarray


def basin_entropy(found: xarray.Dataset | Any, size: int = 5) -> BasinEntropy:
    """The entropy of basins, from the labels in boxes of cells.

    Parameters
    ----------
    found
        A dataset of `basins`, or an array of whole numbers, the labels on a grid of any number of axes.
        Boxes with a start that leads to no attractor, of the label 0 or -1, are left out.
    size
        Number of cells along a side of a box. The entropy depends on it; that of the boundary does so less.

    Returns
    -------
    BasinEntropy

    Raises
    ------
    ArgumentError
        If there are no labels, the grid has fewer than 1 box, or no box is left.

    References
    ----------
    A. Daza, A. Wagemakers, B. Georgeot, D. Guéry-Odelin, M. A. F. Sanjuán, "Basin entropy: a new tool to
    analyze uncertainty in dynamical systems", Scientific Reports 6 (2016) 31416, doi:10.1038/srep31416.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid import basin_entropy
    >>> mixed = 1 + np.indices((12, 12)).sum(axis=0) % 2
    >>> found = basin_entropy(mixed, size=2)
    >>> round(found.entropy, 6), found.is_fractal
    (0.693147, False)
    """
    labels = _labels(found)
    size = arguments.count("size", size, 1, min(labels.shape), " (the cells along an axis)")
    own = np.array([_entropy(box) for box in _boxes(labels, size)])
    if not len(own):
        raise ArgumentError("found has no box without a start that leads to no attractor; lower size=.")
    at_boundary = own[own > 0.0]
    boundary = float(at_boundary.mean()) if len(at_boundary) else np.nan
    # Boxes across a smooth boundary between two basins have log(2) at most.
    return BasinEntropy(float(own.mean()), boundary, bool(boundary > np.log(2.0)), size)


def uncertainty_exponent(
    found: xarray.Dataset | Any, sizes: Iterable[int] | None = None
) -> UncertaintyExponent:
    """The exponent with which uncertain starts become fewer, and the dimension of the boundary.

    A box is uncertain if it holds starts of more than one attractor. The exponent is the slope of the
    logarithm of their share over that of the size.

    Parameters
    ----------
    found
        As for `basin_entropy`.
    sizes
        Lengths of a side of a box, in distances between two starts; by default the powers of 2 with at least
        16 boxes along each axis. Those at which no box or every box is uncertain tell nothing and are left
        out.

    Returns
    -------
    UncertaintyExponent

    Raises
    ------
    ArgumentError
        If fewer than two sizes are left.

    References
    ----------
    C. Grebogi, S. W. McDonald, E. Ott, J. A. Yorke, "Final state sensitivity: an obstruction to
    predictability", Physics Letters A 99 (1983) 415, doi:10.1016/0375-9601(83)90945-3.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid import uncertainty_exponent
    >>> disc = np.hypot(*np.mgrid[-1:1:512j, -1:1:512j]) < 0.7
    >>> round(uncertainty_exponent(1 + disc).dimension, 1)
    1.0
    """
    labels = _labels(found)
    if sizes is None:
        wanted = [2**k for k in range(31) if (2**k + 1) * FEWEST <= min(labels.shape)]
    else:
        listed = arguments.items("sizes", sizes, "be a list of whole numbers")
        most = min(labels.shape) - 1
        wanted = [arguments.count(f"sizes[{i}]", each, 1, most) for i, each in enumerate(listed)]
    # As many distances as a box is long lie between one start more.
    shares = np.array([_share(labels, size + 1) for size in wanted])
    told = (shares > 0.0) & (shares < 1.0)
    if told.sum() < 2:
        raise ArgumentError(
            f"found: at {int(told.sum())} of the sizes {arguments.shown(wanted)} some boxes hold one label "
            "and some more; a slope takes two sizes. Take a finer grid, or other sizes=."
        )
    x, y = np.log(np.array(wanted)[told]), np.log(shares[told])
    slope, error = _slope(x, y)
    return UncertaintyExponent(slope, error, labels.ndim - slope, np.array(wanted)[told], shares[told])


def _labels(found: Any) -> np.ndarray:
    """Labels as an array of whole numbers."""
    values = found
    if hasattr(found, "data_vars") and "label" in found.data_vars:
        values = found["label"].values
    try:
        labels = np.asarray(values if isinstance(values, np.ndarray | list | tuple) else [])
    except ValueError:
        labels = np.empty(0)
    if labels.dtype.kind not in "iu" or not labels.ndim or not labels.size:
        raise arguments.refusal("found", "be a dataset of basins, or an array of labels", found)
    return labels


def _boxes(labels: np.ndarray, size: int) -> Iterator[np.ndarray]:
    """The labels in each box ``(size ** d,)`` in which every start leads to an attractor."""
    counts = [length // size for length in labels.shape]
    whole = labels[tuple(slice(count * size) for count in counts)]
    split = whole.reshape([n for count in counts for n in (count, size)])
    order = [*range(0, split.ndim, 2), *range(1, split.ndim, 2)]
    yield from (box for box in split.transpose(order).reshape(-1, size**labels.ndim) if box.min() > 0)


def _entropy(box: np.ndarray) -> float:
    _, counts = np.unique(box, return_counts=True)
    share = counts / len(box)
    return float(-(share * np.log(share)).sum()) if len(counts) > 1 else 0.0


def _share(labels: np.ndarray, size: int) -> float:
    """The share of boxes with more than one label among those at all places; nan without a box."""
    from scipy.ndimage import maximum_filter, minimum_filter

    inside = tuple(slice(size // 2, length - (size - 1) // 2) for length in labels.shape)
    least, most = (each(labels, size=size)[inside] for each in (minimum_filter, maximum_filter))
    counted = least > 0
    return float(np.mean(least[counted] != most[counted])) if counted.any() else np.nan


def _slope(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """The slope of a line through points, and its standard error."""
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    rest = y - y.mean() - slope * centred
    degrees = len(x) - 2
    error = np.sqrt(rest @ rest / degrees / (centred @ centred)) if degrees else np.nan
    return slope, float(error)
