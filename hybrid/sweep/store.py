"""A sweep on disk: results are written as they are made, and a later call takes the sweep up again.

A store is a folder. Inside, ``.sweep/parts`` holds one file per part, which is complete when it gets its name
and is never changed afterwards; ``.sweep/made_by.json`` says what made the results. So a process that is
killed leaves a store without the part in hand, and several processes may write into one store. When a call
ends, the dataset is also laid out as a zarr group in the same folder.
"""

from __future__ import annotations

import json
import os
import shutil
import uuid
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import ArgumentError, HybridError
from hybrid.simulation.disk import (
    as_path,
    check_facts,
    flush_folder,
    replace,
    text_of,
    unwritable,
    write_new,
)
from hybrid.simulation.extra import needed
from hybrid.simulation.seal import SEAL, check_seal, read_file, read_folder, sealed
from hybrid.sweep.outcome import UNFINISHED, Part
from hybrid.sweep.parts import DamagedError, read_part, written
from hybrid.sweep.points import RESERVED, Points, as_points
from hybrid.sweep.sheet import Labels, Sheet

if TYPE_CHECKING:
    import xarray

INSIDE, PARTS, MADE_BY, LATEST = ".sweep", "parts", "made_by.json", "latest.json"
# The checksum of the zarr group, which has none of its own: a chunk that is lost reads as zeros.
LAID_OUT = "laid_out"
SUFFIX = ".part"
# The file that makes a folder a zarr group.
GROUP = "zarr.json"


class Store:
    """The results of a sweep on disk.

    Parameters
    ----------
    path
        The folder, which is made if it does not exist.
    facts
        What decides the results, by name.
    points, along
        The points of this call, and the axis along which they depend on one another, if any.
    """

    def __init__(self, path: Any, facts: Mapping[str, str], points: Points, along: str | None) -> None:
        needed("zarr", "store=")
        self.path = as_path(path)
        self.facts = {**facts, "names in over": ", ".join(sorted(points.names))}
        self.points = points
        self.along = along
        self.keys = points.keys(None if along is None else points.lines(along))
        self.seen: set[str] = set()
        # Whether the zarr group, if there is one, belongs to another call.
        self.is_new = True

    def begin(self, sheet: Sheet, date: str, labels: Labels, made_by: Mapping[str, Any]) -> str:
        """Make the store, or compare it with this call, and read what is there; the date of its making."""
        folder = self.path / INSIDE
        if not folder.exists() and self.path.exists() and any(self.path.iterdir()):
            raise ArgumentError(
                f"store: the folder {str(self.path)!r} is not empty, and is not the store of a sweep. "
                "Name a new folder."
            )
        try:
            (folder / PARTS).mkdir(parents=True, exist_ok=True)
            created = {"facts": self.facts, "date": date}
            if not (folder / MADE_BY).exists() and not any((folder / PARTS).glob(f"*{SUFFIX}")):
                write_new(folder / MADE_BY, json.dumps(created, indent=1).encode())
            known = _made_by(self.path)
        except OSError as failure:
            raise unwritable(self.path, failure) from failure
        check_facts(self.path, known["facts"], self.facts)
        self.read_into(sheet)
        latest = {
            "over": {**_listed(self.points), "along": self.along},
            "labels": {
                "dims": {name: list(dims) for name, dims in labels.dims.items()},
                "coords": {
                    name: [list(dims), np.asarray(values).tolist()]
                    for name, (dims, values) in labels.coords.items()
                },
                "attrs": {name: dict(each) for name, each in labels.attrs.items()},
            },
            "made_by": {**made_by, "date": known["date"]},
        }
        self.is_new = _text(latest) != text_of(folder / LATEST)
        if self.is_new or sheet.untouched().any():
            try:
                # From here on the zarr group, if there is one, is older than the store.
                (self.path / GROUP).unlink(missing_ok=True)
                replace(folder / LATEST, _text(latest).encode())
            except OSError as failure:
                raise unwritable(self.path, failure) from failure
        return str(known["date"])

    def read_into(self, sheet: Sheet) -> None:
        """Put the results that other calls and processes have written so far into the sheet."""
        row_of = dict(zip(self.keys, range(len(self.keys)), strict=True))
        # Rows of points that occur again later.
        earlier: dict[bytes, list[int]] = {}
        if len(row_of) < len(self.keys):
            for row, key in enumerate(self.keys):
                if row_of[key] != row:
                    earlier.setdefault(key, []).append(row)
        for path in sorted((self.path / INSIDE / PARTS).glob(f"*{SUFFIX}")):
            if path.name in self.seen:
                continue
            self.seen.add(path.name)
            try:
                keys, part = read_part(path)
            except DamagedError as failure:
                raise HybridError(
                    f"store: the file {str(path)!r} is damaged: {failure}. Delete this file and call again: "
                    "its points are then computed again."
                ) from None
            rows = np.array([row_of.get(key, -1) for key in keys], dtype=np.int64)
            places = np.flatnonzero(rows >= 0)
            if places.size:
                sheet.put(part.at(rows[places], places))
            if earlier:
                again = [(row, place) for place, key in enumerate(keys) for row in earlier.get(key, ())]
                if again:
                    sheet.put(part.at(*np.array(again, dtype=np.int64).T))

    def write(self, part: Part) -> None:
        """Write the finished points of a part, all or nothing."""
        try:
            name, _ = write_part(self.path, part, self.keys)
        except OSError as failure:
            raise unwritable(self.path, failure) from failure
        self.seen.add(name)

    def seal(self) -> str:
        """What a worker must find in the folder to know that it sees this store."""
        return text_of(self.path / INSIDE / MADE_BY)

    def receive(self, name: str, rows: np.ndarray, sheet: Sheet) -> None:
        """Put the results of a file that a worker has written into the sheet."""
        try:
            _, part = read_part(self.path / INSIDE / PARTS / name)
        except OSError:
            # A network may show the file to this machine a little later: it is read when the sweep ends.
            return
        self.seen.add(name)
        sheet.put(part.at(rows, np.arange(len(rows))))

    def finish(self, found: xarray.Dataset, changed: bool) -> None:
        """Lay the dataset out as a zarr group, unless it is there already."""
        if not changed and not self.is_new and _is_as_laid_out(self.path):
            return
        try:
            with _Lock(self.path / INSIDE / "lock"):
                _lay_out(found, self.path)
        except OSError as failure:
            raise unwritable(self.path, failure) from failure


def write_part(path: Path, part: Part, keys: Sequence[bytes] | Mapping[int, bytes]) -> tuple[str, np.ndarray]:
    """Write the finished points of a part, all or nothing: name of the file, if any, and its rows."""
    done = np.flatnonzero(~np.isin(part.codes, UNFINISHED))
    if not done.size:
        return "", part.rows[done]
    kept = part.at(part.rows[done], done)
    name = f"{uuid.uuid4().hex}{SUFFIX}"
    replace(path / INSIDE / PARTS / name, written(kept, [keys[row] for row in kept.rows.tolist()]))
    return name, kept.rows


def sees_store(path: Path, seal: str) -> bool:
    """Whether a folder, seen from this machine, is the store with this seal."""
    return bool(seal) and text_of(path / INSIDE / MADE_BY) == seal


def open_store(path: str | os.PathLike[str]) -> xarray.Dataset:
    """What a sweep saved in a store, also while the sweep runs or after it was killed.

    Parameters
    ----------
    path
        Folder of the store; or a file that ``to_netcdf`` has written.

    Returns
    -------
    xarray.Dataset
        The results of the last call with this store. Points that are not computed have the status
        ``NOT_RUN``.

    Raises
    ------
    ArgumentError
        If there is no store, or if the file is incomplete or damaged.

    Examples
    --------
    >>> import tempfile, hybrid
    >>> from hybrid import open_store
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     squares = hybrid.sweep(lambda point: {"square": point["a"] ** 2}, {"a": [1.0, 2.0, 3.0]})
    ...     squares.to_netcdf(f"{folder}/squares.nc")
    ...     open_store(f"{folder}/squares.nc").square.values.tolist()
    [1.0, 4.0, 9.0]
    """
    where = as_path(path, "path")
    if where.is_file():
        return read_file("path", where)
    latest = text_of(where / INSIDE / LATEST)
    # A group without the parts is the copy of a store. Otherwise a damaged group, or one that another call
    # is laying out, is made again from the parts.
    if (where / GROUP).exists() and (not latest or _is_as_laid_out(where)):
        needed("zarr", "open_store")
        # A later call with another grid first removes the file that makes the folder a group.
        before, found = text_of(where / GROUP), None
        try:
            found = read_folder("path", where)
            # Other datasets that were saved as a group have no seal.
            if SEAL in found.attrs:
                check_seal("path", found, str(where))
                del found.attrs[SEAL]
        except ArgumentError:
            found = None
            if not latest:
                raise
        if found is not None and before and before == text_of(where / GROUP):
            last = [name for name in RESERVED if name in found.data_vars]
            return found[[name for name in found.data_vars if name not in RESERVED] + last]
    if not latest:
        raise ArgumentError(f"path must be the store of a sweep or a file; got {str(where)!r}.")
    facts = _made_by(where)["facts"]
    try:
        stored = json.loads(latest)
        points = as_listed(stored["over"])
        labels, made_by = Labels.read(json.dumps(stored["labels"])), dict(stored["made_by"])
        along = stored["over"]["along"]
    except (ValueError, LookupError, TypeError, AttributeError) as failure:
        raise _damaged(where / INSIDE / LATEST) from failure
    sheet = Sheet(points)
    Store(where, facts, points, along).read_into(sheet)
    return sheet.dataset(labels, made_by)


def _made_by(path: Path) -> dict[str, Any]:
    """What the store says of the call that made it, or an error if the file is damaged."""
    file = path / INSIDE / MADE_BY
    try:
        known = json.loads(file.read_text(encoding="utf-8"))
        return {"facts": dict(known["facts"]), "date": str(known["date"])}
    except FileNotFoundError:
        raise _damaged(file) from None
    except (ValueError, LookupError, TypeError) as failure:
        raise _damaged(file) from failure


def _damaged(file: Path) -> HybridError:
    if file.name == LATEST:
        return HybridError(f"store: the file {str(file)!r} is damaged. Repeat the call that made the store.")
    return HybridError(
        f"store: the file {str(file)!r} is damaged or missing, so it is not known what made the results. "
        "Name another store."
    )


def _listed(points: Points) -> dict[str, Any]:
    """Points as JSON; numbers keep all their digits."""
    return {
        "dims": list(points.dims),
        "names": list(points.names),
        "shape": list(points.shape),
        "coords": {
            name: [dim, values.tolist(), units] for name, (dim, values, units) in points.coords.items()
        },
    }


def as_listed(stored: Mapping[str, Any]) -> Points:
    """The points that :func:`_listed` has written."""
    coords = {name: (dim, np.array(values), units) for name, (dim, values, units) in stored["coords"].items()}
    if stored["names"] == stored["dims"]:
        points = as_points({name: values for name, (_, values, _) in coords.items()})
    else:
        points = as_points(
            [
                dict(zip(stored["names"], row, strict=True))
                for row in zip(*(coords[name][1].tolist() for name in stored["names"]), strict=True)
            ]
        )
    return Points(points.names, points.values, tuple(stored["dims"]), tuple(stored["shape"]), coords)


def _text(value: Any) -> str:
    return json.dumps(value, default=str)


def _lay_out(found: xarray.Dataset, path: Path) -> None:
    """Write a dataset as a zarr group; the file that makes the folder a group comes last."""
    for left in path.glob(".new-*"):
        shutil.rmtree(left, ignore_errors=True)
    new = path / f".new-{uuid.uuid4().hex}"
    try:
        with warnings.catch_warnings():
            # Texts and consolidated metadata are extensions of zarr's format 3.
            warnings.simplefilter("ignore")
            sealed(found).to_zarr(new, zarr_format=3, consolidated=True)
        (path / GROUP).unlink(missing_ok=True)
        for old in path.iterdir():
            if not old.name.startswith("."):
                shutil.rmtree(old)
        for each in new.iterdir():
            if each.name != GROUP:
                os.replace(each, path / each.name)
        os.replace(new / GROUP, path / GROUP)
        flush_folder(path)
        replace(path / INSIDE / LAID_OUT, _checksum(path).encode())
    finally:
        shutil.rmtree(new, ignore_errors=True)


def _is_as_laid_out(path: Path) -> bool:
    """Whether the zarr group holds what was laid out: all of its files, to the last bit."""
    told = text_of(path / INSIDE / LAID_OUT)
    try:
        return bool(told) and (path / GROUP).exists() and told == _checksum(path)
    except OSError:  # another process is laying it out
        return False


def _checksum(path: Path) -> str:
    """Hash of the names and contents of all files of the zarr group."""
    digest = blake2b()
    for folder, folders, files in os.walk(path):
        folders[:] = sorted(each for each in folders if not each.startswith("."))
        for name in sorted(files):
            file = Path(folder) / name
            content = file.read_bytes()
            digest.update(f"{file.relative_to(path).as_posix()}\0{len(content)}\0".encode())
            digest.update(content)
    return digest.hexdigest()


class _Lock:
    """Held by one process at a time; the system gives it back when the process ends, however that ends."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> None:
        self.file = self.path.open("ab")
        with suppress(ImportError, OSError):
            import fcntl

            fcntl.flock(self.file, fcntl.LOCK_EX)

    def __exit__(self, *failure: object) -> None:
        self.file.close()
