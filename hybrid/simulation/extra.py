"""Packages of extras, imported when a call first needs them."""

from __future__ import annotations

import importlib
from typing import Any

from hybrid.errors import HybridError


def how_to_install(extra: str) -> str:
    """A sentence that says how the packages of an extra are installed."""
    return f"Install the extra {extra!r} in the folder of the sources of hybrid: pip install '.[{extra}]'."


def needed(package: str, argument: str) -> Any:
    """An optional package of the extra ``grid``.

    Raises
    ------
    HybridError
        If it is not installed; the text names the extra.
    """
    try:
        return importlib.import_module(package)
    except ImportError:
        raise HybridError(
            f"{argument} needs the package {package}, which is not installed. {how_to_install('grid')}"
        ) from None


def load_xarray() -> None:
    """Import all that the first dataset of xarray imports, such as Dask.

    Called before runs, so that their results come at once after Ctrl-C.
    """
    import xarray

    xarray.Dataset({"nothing": ("axis", [0.0])})
