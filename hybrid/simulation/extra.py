"""Packages of the extra ``grid``, imported when a call first needs them."""

from __future__ import annotations

import importlib
from typing import Any

from hybrid.errors import HybridError


def needed(package: str, argument: str) -> Any:
    """An optional package.

    Raises
    ------
    HybridError
        If it is not installed; the text names the extra.
    """
    try:
        return importlib.import_module(package)
    except ImportError:
        raise HybridError(
            f"{argument} needs the package {package}, which is not installed. "
            "Install it with: pip install 'hybrid-systems[grid]'."
        ) from None


def load_xarray() -> None:
    """Import all that the first dataset of xarray imports, such as Dask.

    Called before runs, so that their results come at once after Ctrl-C.
    """
    import xarray

    xarray.Dataset({"nothing": ("axis", [0.0])})
