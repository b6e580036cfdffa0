"""The branches of a diagram on disk, each written when it is done, so that a later call goes on from there.

A store is a folder. ``made_by.json`` says what made it. ``branch-0``, ``branch-1`` and so on are branches as
they are saved by hand, each with what was known when it was done: the starts found on it, and what was not
followed. ``diagram`` is the whole as the last call has left it.
"""

from __future__ import annotations

import json
import os
import shutil
import uuid
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybrid.errors import ArgumentError, HybridError
from hybrid.simulation.disk import as_path, check_facts, flush_folder, text_of, unwritable, write_new
from hybrid.simulation.extra import needed
from hybrid.simulation.seal import check_seal, read_folder, sealed

if TYPE_CHECKING:
    import xarray

MADE_BY, BRANCH, DIAGRAM = "made_by.json", "branch", "diagram"
# The attribute of a branch with what was known when it was done, as text.
WALK = "walk"


class DiagramStore:
    """Branches on disk in the order in which they were followed.

    Parameters
    ----------
    path
        The folder, which is made if it does not exist.
    facts
        What decides the diagram, by name.

    Raises
    ------
    ArgumentError
        If the folder is no such store, or that of another call.
    """

    def __init__(self, path: object, facts: Mapping[str, str]) -> None:
        needed("zarr", "store=")
        self.path = as_path(path)
        if self.path.exists() and not (self.path.is_dir() and _is_store_or_empty(self.path)):
            raise ArgumentError(
                f"store: {str(self.path)!r} is not empty, and is not the store of a diagram. Name a new "
                "folder."
            )
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            write_new(self.path / MADE_BY, json.dumps(dict(facts), indent=1).encode())
        except OSError as failure:
            raise unwritable(self.path, failure) from failure
        try:
            known = dict(json.loads(text_of(self.path / MADE_BY)))
        except ValueError:
            raise HybridError(
                f"store: the file {str(self.path / MADE_BY)!r} is damaged, so it is not known what made the "
                "branches. Name another store."
            ) from None
        check_facts(self.path, known, facts)

    def read(self, i: int) -> tuple[xarray.Dataset, dict[str, Any]] | None:
        """A branch as a dataset, and what was known when it was done; None if it is not there."""
        place = self.path / f"{BRANCH}-{i}"
        if not place.exists():
            return None
        found = read_folder("store", place)
        check_seal("store", found, str(place))
        return found, dict(json.loads(found.attrs[WALK]))

    def write(self, i: int, branch: xarray.Dataset, walk: Mapping[str, Any]) -> None:
        """Write a branch, all or nothing."""
        self._put(f"{BRANCH}-{i}", sealed(branch.assign_attrs({WALK: json.dumps(walk)})))

    def finish(self, diagram: xarray.Dataset) -> None:
        """Write the diagram, for :func:`hybrid.open_diagram`."""
        self._put(DIAGRAM, diagram)

    def _put(self, name: str, dataset: xarray.Dataset) -> None:
        new, place = self.path / f".new-{uuid.uuid4().hex}", self.path / name
        try:
            dataset.to_zarr(new, zarr_format=2)
            if place.exists():
                os.replace(place, self.path / f".old-{uuid.uuid4().hex}")
            os.replace(new, place)
            flush_folder(self.path)
        except OSError as failure:
            raise unwritable(self.path, failure) from failure
        finally:
            for left in (*self.path.glob(".new-*"), *self.path.glob(".old-*")):
                with suppress(OSError):
                    shutil.rmtree(left)


def diagram_in(path: str | os.PathLike[str]) -> str | os.PathLike[str]:
    """The place of the diagram in a store; the path itself if it is no store.

    Raises
    ------
    ArgumentError
        If no call with the store has ended yet.
    """
    if not os.path.exists(os.path.join(path, MADE_BY)):
        return path
    place = os.path.join(path, DIAGRAM)
    if not os.path.exists(place):
        raise ArgumentError(
            f"saved: no call with store={os.fspath(path)!r} has ended yet. Repeat the call: it goes on from "
            "the branches that are there."
        )
    return place


def _is_store_or_empty(path: Path) -> bool:
    return (path / MADE_BY).exists() or not any(path.iterdir())
