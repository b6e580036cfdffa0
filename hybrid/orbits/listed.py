"""What every branch says of its bifurcations in a dataset, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.status import Status, StatusCode

if TYPE_CHECKING:
    import xarray

# Whether what is beside a bifurcation is stable, as numbers.
SIDES = {None: -1, False: 0, True: 1}


def of_bifurcations(found: Sequence[Any], unit: Mapping[str, str]) -> dict[str, Any]:
    """Variables over the axis ``bifurcation`` that both kinds of branches have."""
    return {
        "kind": ("bifurcation", np.array([each.kind for each in found], dtype=str)),
        "value": ("bifurcation", np.array([each.value for each in found], dtype=float), unit),
        "message": ("bifurcation", np.array([each.message for each in found], dtype=str)),
        "stable_beside": (
            ("bifurcation", "side"),
            np.array([[SIDES[side] for side in each.stable] for each in found], dtype=int).reshape(-1, 2),
        ),
        "position": ("bifurcation", np.array([each.position for each in found], dtype=int)),
    }


def saved_sides(row: xarray.Dataset) -> tuple[bool | None, bool | None]:
    """Whether what is before and after a saved bifurcation is stable."""
    before, after = (
        next(key for key, number in SIDES.items() if number == int(side)) for side in row.stable_beside
    )
    return before, after


def saved_status(made_by: Mapping[str, Any]) -> Status:
    """The status among the attributes of a dataset."""
    return Status(StatusCode[made_by["status"]], made_by["message"])
