"""Where the series of all modes lie in the matrix that they share."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import attrs

from hybrid.compiler.emitted import Series
from hybrid.compiler.taylor.convolutions import padded
from hybrid.kernels.types.codes import WIDE


@attrs.frozen
class Places:
    """The columns of the series of all modes in the matrix that they share.

    Every mode has a table of its own, which stays when another mode writes its series.

    Attributes
    ----------
    tables
        By mode, the first column of its table; all are behind the columns of the state.
    vectors
        The first column of tangent vectors, behind all tables.
    """

    tables: tuple[int, ...]
    vectors: int


def places_of(series: Sequence[Series], *, with_room: bool, whole: int = WIDE) -> Places:
    """The columns of all series; ``with_room``, further modes seldom move those of the modes before them.

    Those of tangent vectors begin at a multiple of ``whole``.
    """
    size = _power_of_two_from if with_room else int
    first = size(max(each.columns for each in series))
    tables = [*accumulate((each.table_columns for each in series), initial=first)]
    return Places(tuple(tables[:-1]), padded(size(tables[-1]), whole))


def _power_of_two_from(count: int) -> int:
    return 1 << (count - 1).bit_length()


def placed(places: Places, bodies: Sequence[str]) -> list[str]:
    """The texts of the series of all modes, each with its columns."""
    return [
        body and f'[["whole","table",{table}],["whole","vectors",{places.vectors}],{body[1:]}'
        for table, body in zip(places.tables, bodies, strict=True)
    ]
