"""The mode that a run starts in."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NoReturn

import numpy as np

from hybrid.compiler.cache.loader import load_kernels
from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.simulation.kinks import move_alike
from hybrid.system.elements import Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import Unexplored

# Verdict on a guard that is not finite; those of the kernel are above zero.
UNDEFINED = -1


def choose_mode(
    system: HybridSystem, plan: Any, model: Any, run: Any, work: Any, mode: str | None
) -> tuple[int, tuple[str, ...]]:
    """Index of the mode to start in: the one named, the only one, or the only one that allows the state.

    On a kink of a continuous field that the flow does not leave at once, the modes on all sides allow the
    state, and their motion is the same: the first of them is taken. If the mode is named, or the only one,
    the transitions whose guards the state lies beyond come too, unless the mode excludes the state.

    Raises
    ------
    ModelError
        If the name is unknown, no mode allows the state, or more than one does.
    """
    modes = system.mode_names
    if mode is None and len(system.whole_modes) == 1:
        [mode] = system.whole_modes
    if mode is not None:
        within = system.parts_of(mode)
        verdicts, _ = _verdicts(system, plan, model, run, work, within)
        if len(within) > 1:
            # Guards of the user's may be crossed, as the mode is named; the sides of its parts must be right.
            against = [(tr.part_of, tr.source) for tr in _against(system, verdicts)]
            within = [i for i in within if (None, modes[i]) not in against]
        if len(within) == 1 or move_alike(system, model, run, [modes[i] for i in within]):
            index = within[0]
            if codes.BEYOND not in verdicts:
                return index, ()
            own = [i for i, transition in enumerate(system.transitions) if transition.source == modes[index]]
            if any(verdicts[i] == codes.LEAVES and _excludes_start(system, model, i) for i in own):
                return index, ()
            beyond = [system.transitions[i] for i in own if verdicts[i] == codes.BEYOND]
            return index, tuple(tr.name for tr in beyond)
        return _refused(system, model, run, verdicts, [modes[i] for i in within])
    verdicts, undefined = _verdicts(system, plan, model, run, work, range(len(modes)))
    violated = {transition.source for transition in _against(system, verdicts)}
    if undefined and len(violated) == len(modes):
        # Otherwise it may be a guard of modes to which the state does not belong.
        raise _undefined(system, run, *min(undefined.items()))
    allowed = [name for name in modes if name not in violated]
    if len(allowed) == 1 or move_alike(system, model, run, allowed):
        return modes.index(allowed[0]), ()
    return _refused(system, model, run, verdicts, allowed)


def _excludes_start(system: HybridSystem, model: Any, index: int) -> bool:
    """Whether a transition only leads starts that its mode excludes into another mode."""
    transition = system.transitions[index]
    leads_away = transition.target != transition.source and model.enters[index] == 1
    return bool(transition.guard.at_start and leads_away)


def _refused(system: HybridSystem, model: Any, run: Any, verdicts: list[int], allowed: list[str]) -> NoReturn:
    if not allowed and system.growth is not None:
        # The state lies on surfaces; a mode along these may not have been made yet. The last is the nearest.
        for transition in reversed(_against(system, verdicts)):
            if system.growth.leads_on(transition.name):
                place = float(run.phase), run.y[: system.dimension].copy(), model.parameters
                system.growth.extend(transition.name, place, system.transition_names)
                raise Unexplored(transition.name)
    if not allowed:
        raise ArgumentError(
            f"{_place(system, run)} is allowed in no mode: {_faults(system, verdicts)}. Start on the other "
            "side of a guard, or choose a mode with mode=, or HybridSystem(start=...), to start beyond its "
            "guard."
        )
    candidates = ", ".join(allowed)
    raise ArgumentError(
        f"{_place(system, run)} is allowed in more than one mode: {candidates}. Choose one with mode=, or "
        "for all runs with HybridSystem(start=...)."
    )


def _verdicts(
    system: HybridSystem, plan: Any, model: Any, run: Any, work: Any, modes: Sequence[int]
) -> tuple[list[int], dict[int, float]]:
    """One code per transition that leaves one of the modes: whether its guard allows the start of the run.

    Also the values of guards that are not finite, by transition, if there are several modes.
    """
    verdicts = np.zeros(len(system.transitions), dtype=np.int64)
    try_modes = load_kernels("hybrid.kernels.runs.initial_mode").try_modes
    kernel = partial(try_modes, plan.parts_so_far, model, plan.method, run, work)
    undefined: dict[int, float] = {}
    if len(modes) == len(system.mode_names):
        # One call for all of them is faster, and enough unless a guard is not finite.
        if kernel(0, len(modes), verdicts) == codes.NO_TRANSITION:
            return verdicts.tolist(), undefined
        verdicts[:] = codes.NO_OBJECTION
    for mode in modes:
        transition = kernel(mode, mode + 1, verdicts)
        if transition == codes.NO_TRANSITION:
            continue
        if len(modes) == 1:
            raise _undefined(system, run, transition, work.scalar[0])
        verdicts[transition] = UNDEFINED
        undefined[transition] = float(work.scalar[0])
    return verdicts.tolist(), undefined


def _undefined(system: HybridSystem, run: Any, transition: int, value: float) -> ArgumentError:
    return ArgumentError(
        f"Transition {system.transition_names[transition]!r}: the guard is {value} at "
        f"t = {run.phase}, {_place(system, run)}. A guard must be finite wherever its mode runs."
    )


def _against(system: HybridSystem, verdicts: list[int]) -> list[Transition]:
    """The transitions whose guards do not allow the start."""
    said = zip(system.transitions, verdicts, strict=True)
    return [transition for transition, verdict in said if verdict != codes.NO_OBJECTION]


def _faults(system: HybridSystem, verdicts: list[int]) -> str:
    """For each mode, the transitions whose guards do not allow the start."""
    against = _against(system, verdicts)
    return "; ".join(
        f"mode {name!r} is left through {', '.join(repr(tr.name) for tr in against if tr.source == name)}"
        for name in system.mode_names
    )


def _place(system: HybridSystem, run: Any) -> str:
    return f"x0 = {tuple(float(v) for v in run.y[: system.dimension])}"
