"""Datasets that know what they held when they were made, and datasets read from disk.

Files of results are copied and cut short. A zarr array whose chunk is missing reads as nan or as empty text,
without an error. So a sealed dataset carries a checksum of each of its variables, and its reader compares.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import ArgumentError

if TYPE_CHECKING:
    import xarray

SEAL, ATTRIBUTES = "checksums", "(attributes)"
AGAIN = "Copy it again from where it was made, or make and save it again."


def sealed(dataset: xarray.Dataset) -> xarray.Dataset:
    """The dataset with the checksums of its variables and of its attributes as one more attribute."""
    return dataset.assign_attrs({SEAL: json.dumps(_checksums(dataset))})


def check_seal(name: str, dataset: xarray.Dataset, place: str = "") -> None:
    """Check that a dataset holds what it held when it was sealed.

    Parameters
    ----------
    name
        The argument that the dataset comes from.
    dataset
        The dataset, read from ``place``.
    place
        The folder or the file; empty if the dataset was given as an object.

    Raises
    ------
    ArgumentError
        If a variable is missing, damaged or changed.
    """
    what, again = (
        f"{name} {place!r}" if place else name,
        AGAIN if place else "Give the dataset as it was saved.",
    )
    try:
        known = dict(json.loads(dataset.attrs[SEAL]))
    except (LookupError, TypeError, ValueError):
        raise ArgumentError(
            f"{what} is incomplete: the attribute {SEAL!r} is missing or damaged. {again}"
        ) from None
    missing = [each for each in known if each != ATTRIBUTES and each not in dataset.variables]
    if missing:
        raise ArgumentError(f"{what} is incomplete: {_listed(missing)} missing. {again}")
    found = _checksums(dataset)
    damaged = [each for each in known if found.get(each) != known[each]]
    if damaged:
        raise ArgumentError(f"{what} is not what was saved: {_listed(damaged)} damaged or changed. {again}")


def read_file(name: str, path: Path) -> xarray.Dataset:
    """The dataset of a file, wholly in memory, so that a file that is cut short is noticed here."""
    import xarray

    return _read(name, "file", path, lambda: xarray.open_dataset(path, decode_times=False))


def read_folder(name: str, path: Path) -> xarray.Dataset:
    """The dataset of a folder of zarr, wholly in memory."""
    import xarray

    # Without consolidated metadata: a save that was killed has none, and each array has its own.
    return _read(
        name,
        "folder",
        path,
        lambda: xarray.open_zarr(path, chunks=None, consolidated=False, decode_times=False),
    )


def _read(name: str, kind: str, path: Path, opened: Callable[[], xarray.Dataset]) -> xarray.Dataset:
    what = f"the {kind} {str(path)!r}"
    try:
        with opened() as found:
            for variable, values in found.variables.items():
                what = f"the variable {str(variable)!r} of the {kind} {str(path)!r}"
                values.load()
            return found
    except Exception as failure:  # each engine and each codec has its own errors
        said = " ".join(str(failure).split())[:200]
        raise ArgumentError(
            f"{name}: {what} cannot be read: it is incomplete or damaged, or was not saved as a dataset "
            f"({type(failure).__name__}: {said}). {AGAIN}"
        ) from failure


def _listed(names: list[str]) -> str:
    return f"{', '.join(map(repr, names))} {'is' if len(names) == 1 else 'are'}"


def _checksums(dataset: xarray.Dataset) -> dict[str, str]:
    """The checksum of each variable, and of the attributes as text."""
    attributes = {str(key): str(value) for key, value in dataset.attrs.items() if key != SEAL}
    return {
        ATTRIBUTES: _hash(json.dumps(attributes, sort_keys=True).encode()),
        **{str(name): _checksum(variable) for name, variable in dataset.variables.items()},
    }


def _checksum(variable: Any) -> str:
    """Hash of axes, shape and values, whatever types of numbers and texts a format makes of them."""
    values = np.asarray(variable.values)
    if values.dtype.kind in "biu":
        content = values.astype("<i8").tobytes()
    elif values.dtype.kind in "fc":
        # Formats keep neither the sign of a zero nor the bits of a nan.
        parts = np.stack([values.real, values.imag]).astype("<f8") + 0.0
        content = np.where(np.isnan(parts), np.nan, parts).tobytes()
    else:
        content = json.dumps([str(each) for each in values.ravel().tolist()]).encode()
    return _hash(f"{variable.dims}{variable.shape}".encode(), content)


def _hash(*parts: bytes) -> str:
    digest = blake2b(digest_size=16)
    for part in parts:
        digest.update(part)
    return digest.hexdigest()
