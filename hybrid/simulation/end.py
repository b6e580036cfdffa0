"""Where a run has ended, and all that it remembers: another run goes on from there as if it had not stopped.

A state and a mode do not tell how a run goes on. It also knows on which side of its guards the state is, what
has just fired, when the mode was entered, which ticks of its clocks are over, how long its steps are, and
where jumps that accumulate lead.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.kernels.types.entries import COUNTERS, NUMBERS
from hybrid.simulation.seal import check_seal, read_file, read_folder, sealed
from hybrid.status import StatusCode
from hybrid.system.entries import has_age
from hybrid.system.frozen import FrozenMapping
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray

KIND = "end"
# Arrays of a run with an entry for each transition, for each mode, and for each component of the state along
# the last axis, before others.
BY_TRANSITION = (
    "side", "on_guard", "due", "fires", "side_before", "order_before", "unproved_before",
    "tried_side", "tried_due", "tried_order", "tick", "ticked",
)  # fmt: skip
BY_MODE = ("first_step", "stay")
BY_COMPONENT = ("scale", "stretch", "visits", "trail")
OTHERS = ("counters", "numbers", "recent", "ticks")
INSTANT = "instant"
MEMORY = (*BY_TRANSITION, *BY_MODE, *BY_COMPONENT, *OTHERS)
# Counters that are the index of a transition, and of a mode; a negative one is none.
OF_TRANSITION = ("last_fired", "pending", "grazing_guard", "touched_guard")
OF_MODE = ("mode", "previous_mode")
# What a run has counted to tell of itself, and of its tangent vectors: the next one counts anew.
COUNTED = (
    "singular_jumps", "ill_conditioned", "order_mattered", "indistinct", "unresolved", "coarse",
    "steep_jumps", "ran_dry", "field_jumps", "jumped_in", "turned", "turned_to", "rejected",
)  # fmt: skip
MEASURED = (
    "divergence", "log_determinant", "log_determinant_before", "largest_saltation", "ill_conditioned_growth",
    "ill_conditioned_growth_before", "strain", "lateness", "unknown_time",
)  # fmt: skip
# Components that a line shows.
MOST_SHOWN = 8
# Behind these no run goes on.
OVER = (StatusCode.TERMINAL, StatusCode.ACCUMULATION)


def _read_only(value: np.ndarray) -> np.ndarray:
    found = np.array(value, dtype=float)
    found.flags.writeable = False
    return found


def _frozen(value: Mapping[str, float]) -> Mapping[str, float]:
    return FrozenMapping(value)


@attrs.frozen(eq=False, repr=False)
class ArcEnd:
    """The end of a run: ``simulate(system, arc.end, (arc.end.t, t1))`` goes on from it.

    The next run has the parameters, the mode, the clocks and the memory of the run that ended. Tangent
    vectors begin anew. An end can be pickled, and saved as a dataset (:meth:`to_xarray`).

    Attributes
    ----------
    t, x, mode
        Time, state ``(n,)`` and mode.
    parameters
        The values of all parameters, by name.
    status
        How the run ended.

    Examples
    --------
    >>> import hybrid, models
    >>> ball = models.bouncing_ball()
    >>> first = hybrid.simulate(ball, (1.0, 0.0), (0.0, 1.0))
    >>> first.end
    <ArcEnd t = 1, mode 'flight', q = 0.468004, v = -1.837, SUCCESS>
    >>> second = hybrid.simulate(ball, first.end, (1.0, 2.0))
    >>> whole = hybrid.simulate(ball, (1.0, 0.0), (0.0, 2.0))
    >>> bool(abs(second["q"][-1] - whole["q"][-1]) < 1e-12)
    True
    """

    t: float
    x: np.ndarray = attrs.field(converter=_read_only)
    mode: str
    parameters: Mapping[str, float] = attrs.field(converter=_frozen)
    status: StatusCode
    _state_names: tuple[str, ...]
    _modes: tuple[str, ...]
    _transitions: tuple[str, ...]
    # The mode that the run has advanced by steps in time, where others would have used a series.
    _by_steps: str | None
    _memory: Mapping[str, np.ndarray]

    def __repr__(self) -> str:
        pairs = [f"{name} = {value:.6g}" for name, value in zip(self._state_names, self.x, strict=True)]
        left = [f"and {len(pairs) - MOST_SHOWN} more"] if len(pairs) > MOST_SHOWN else []
        state = ", ".join([*pairs[:MOST_SHOWN], *left])
        return f"<ArcEnd t = {self.t:.9g}, mode {self.mode!r}, {state}, {self.status.name}>"

    def to_xarray(self) -> xarray.Dataset:
        """The end as a dataset: ``.to_netcdf(path)`` or ``.to_zarr(path)`` saves it, `open_end` reads it."""
        import xarray

        packed = BytesIO()
        np.savez(packed, allow_pickle=False, **dict(self._memory))
        # Formats of datasets differ in the numbers that they know; all know bytes.
        memory = np.frombuffer(packed.getvalue(), dtype=np.int8)
        told = {"modes": self._modes, "transitions": self._transitions, "by_steps": self._by_steps}
        made_by = {
            "kind": KIND,
            "status": self.status.name,
            "model_parameters": json.dumps(dict(self.parameters)),
            "names": json.dumps(told),
        }
        variables = {
            "t": ((), self.t),
            "x": ("state", self.x),
            "mode": ((), self.mode),
            "memory": ("byte", memory),
        }
        return sealed(xarray.Dataset(variables, {"state": ("state", list(self._state_names))}, made_by))


def open_end(saved: xarray.Dataset | str | os.PathLike[str]) -> ArcEnd:
    """An end from what its `to_xarray` gave, or from the file or the folder of zarr where that is.

    Raises
    ------
    ArgumentError
        If it is no end, or the save is incomplete, damaged or was changed.

    Examples
    --------
    >>> import hybrid, models
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
    >>> hybrid.open_end(arc.end.to_xarray())
    <ArcEnd t = 1, mode 'flight', q = 0.468004, v = -1.837, SUCCESS>
    """
    import xarray

    place = ""
    if isinstance(saved, str | os.PathLike) and os.path.exists(saved):
        place = os.fspath(saved)
        saved = read_folder("saved", Path(place)) if os.path.isdir(place) else read_file("saved", Path(place))
    if not isinstance(saved, xarray.Dataset) or saved.attrs.get("kind", KIND) != KIND:
        raise arguments.refusal("saved", "be the dataset of an end, or a file or folder where it is", saved)
    check_seal("saved", saved, place)
    told = json.loads(saved.attrs["names"])
    packed = BytesIO(np.asarray(saved["memory"].values).astype(np.int8).tobytes())
    return ArcEnd(
        float(saved["t"]),
        saved["x"].values,
        str(saved["mode"].values),
        json.loads(saved.attrs["model_parameters"]),
        StatusCode[saved.attrs["status"]],
        tuple(map(str, saved["state"].values)),
        tuple(told["modes"]),
        tuple(told["transitions"]),
        told["by_steps"],
        FrozenMapping(dict(np.load(packed))),
    )


def end_of(
    system: HybridSystem,
    run: Any,
    t: float,
    parameters: Mapping[str, float],
    status: StatusCode,
    by_steps: int | None,
) -> ArcEnd:
    """The end of a run that kernels have left as it is."""
    n, modes = system.dimension, system.mode_names
    # Between two jumps of one instant, the second one is told by the first where it happens.
    names = MEMORY if run.pending == codes.NO_TRANSITION else (*MEMORY, INSTANT)
    return ArcEnd(
        t,
        run.y[:n],
        modes[run.mode],
        parameters,
        status,
        system.state_names,
        modes,
        system.transition_names,
        None if by_steps is None else modes[by_steps],
        FrozenMapping({name: np.array(getattr(run, name)) for name in names}),
    )


def end_without_component(end: ArcEnd, i: int) -> ArcEnd:
    """The end of a run without component ``i`` of the state."""
    memory = dict(end._memory)
    memory |= {name: np.delete(memory[name], i, axis=-1) for name in BY_COMPONENT}
    memory.pop(INSTANT, None)
    names = (*end._state_names[:i], *end._state_names[i + 1 :])
    return attrs.evolve(end, x=np.delete(end.x, i), state_names=names, memory=FrozenMapping(memory))


def with_component(end: ArcEnd, i: int, name: str, value: float) -> ArcEnd:
    """The end of a run with one more component ``i`` of the state."""
    memory = dict(end._memory)
    sizes = {"scale": abs(value), "stretch": value, "visits": 0.0, "trail": 0.0}
    memory |= {each: np.insert(memory[each], i, size, axis=-1) for each, size in sizes.items()}
    memory.pop(INSTANT, None)
    names = (*end._state_names[:i], name, *end._state_names[i:])
    return attrs.evolve(end, x=np.insert(end.x, i, value), state_names=names, memory=FrozenMapping(memory))


def goes_on_in(
    system: HybridSystem,
    end: ArcEnd,
    t0: float,
    mode: str | None,
    parameters: Mapping[str, float] | None,
    time: str,
) -> tuple[str, dict[str, float]]:
    """The mode and the parameters of a run that goes on from an end, everything about the call checked."""
    check_system(end, system)
    if t0 != end.t:
        raise ArgumentError(
            f"{time} must begin at {end.t!r}, where the run ended that x0 is the end of; got {t0!r}. For a "
            "run that begins at another time give x0=end.x and mode=end.mode."
        )
    if mode is not None and mode != end.mode:
        raise ArgumentError(
            f"mode must be left out, since x0 is the end of a run in mode {end.mode!r}; got "
            f"{arguments.shown(mode)}. For a run in another mode give x0=end.x and mode=."
        )
    own = dict(end.parameters)
    changes = system.variables.overrides(parameters)
    given = dict(zip(own, system.parameter_values({**own, **changes}).tolist(), strict=True))
    changed = [name for name in own if given[name] != own[name]]
    if changed:
        raise ArgumentError(
            f"parameters must be left out, since x0 is the end of a run with {changed[0]} = "
            f"{own[changed[0]]!r}; got {given[changed[0]]!r}. For a run with other parameters from there "
            "give x0=end.x and mode=end.mode."
        )
    return end.mode, own


def check_system(end: ArcEnd, system: HybridSystem) -> None:
    """ArgumentError unless a run of a system can go on from here."""
    if end.status in OVER:
        raise ArgumentError(
            f"x0 is the end of a run that is over ({end.status.name}): nothing follows. For a new run "
            "from its state give x0=end.x and mode=."
        )
    if end._state_names != system.state_names:
        raise ArgumentError(
            f"x0 is the end of a run with the state {', '.join(end._state_names)}; the system has "
            f"{', '.join(system.state_names)}. Give the system of that run."
        )
    known = [("parameter", {*end.parameters}, {*system.parameters})]
    if system.growth is None:
        known.append(("mode", {*end._modes}, {*system.mode_names}))
        known.append(("transition", {*end._transitions}, {*system.transition_names}))
    for what, own, others in known:
        other = sorted(own ^ others)
        if other:
            raise ArgumentError(
                f"x0 is the end of a run of another system: {what} {other[0]!r} is in one of the two "
                "only. Give the system of that run, or x0=end.x and mode= for a new run."
            )


def check_tangents(end: ArcEnd) -> None:
    """ArgumentError unless tangent vectors can begin here."""
    if INSTANT in end._memory and _count(end, "locked"):
        raise ArgumentError(
            "x0 is the end of a run that was stopped between two jumps of one instant (max_jumps=): "
            "tangent vectors cannot begin there. Go on without them to a later time first."
        )


def mode_by_steps(end: ArcEnd, system: HybridSystem) -> int | None:
    """The mode that is to be advanced by steps in time, as it was; None if there is none."""
    return None if end._by_steps is None else system.mode_index(end._by_steps)


def age_of(end: ArcEnd, system: HybridSystem) -> float:
    """The time since the mode was entered, where a clock counts from there; else zero."""
    if not has_age(system, end.mode):
        return 0.0
    cycles = _count(end, "cycle") - _count(end, "entry_cycle")
    whole = cycles * (system.forcing_period(end.parameters) or 0.0) if cycles else 0.0
    phase = _number(end, "phase") - _number(end, "entry_phase")
    return whole + (phase + (_number(end, "phase_low") - _number(end, "entry_low")))


def put_memory(end: ArcEnd, run: Any, system: HybridSystem) -> None:
    """Let a run at its begin, whose state is in place, remember what this one did."""
    memory = end._memory
    transitions = _places(end._transitions, system.transition_names)
    modes = _places(end._modes, system.mode_names)
    for names, (own, there) in ((BY_TRANSITION, transitions), (BY_MODE, modes)):
        for name in names:
            getattr(run, name)[there] = memory[name][own]
    for name in BY_COMPONENT:
        getattr(run, name)[...] = memory[name]
    run.ticks[:], run.recent[:] = memory["ticks"], _moved(memory["recent"], transitions)
    horizon = run.horizon
    run.counters[:], run.numbers[:] = memory["counters"], memory["numbers"]
    for name in OF_TRANSITION:
        setattr(run, name, _moved(np.array([getattr(run, name)]), transitions)[0])
    for name in OF_MODE:
        setattr(run, name, _moved(np.array([getattr(run, name)]), modes)[0])
    # A number of a step is told from the begin of a run.
    for name in ("stretch_steps", "touched_step"):
        setattr(run, name, getattr(run, name) - run.steps)
    run.steps = 0
    for name in COUNTED:
        setattr(run, name, 0)
    for name in MEASURED:
        setattr(run, name, 0.0)
    if INSTANT in memory:
        run.instant[:] = memory[INSTANT]
    else:
        run.locked = run.map_is_known = 0
    if run.stage == codes.READY:
        # What the last step left for the next one is not remembered.
        run.stage = codes.STALE
    run.horizon += horizon


def _number(end: ArcEnd, name: str) -> float:
    return float(end._memory["numbers"][NUMBERS.index(name)])


def _count(end: ArcEnd, name: str) -> int:
    return int(end._memory["counters"][COUNTERS.index(name)])


def _places(own: Sequence[str], others: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the names that two lists share, in either."""
    place = {name: i for i, name in enumerate(others)}
    pairs = [(i, place[name]) for i, name in enumerate(own) if name in place]
    found = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _moved(indices: np.ndarray, places: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Indices into the first of two lists as those into the second; negative ones stay."""
    own, there = places
    table = dict(zip(own.tolist(), there.tolist(), strict=True))
    return np.array([table.get(i, i) for i in indices.tolist()], dtype=np.int64)
