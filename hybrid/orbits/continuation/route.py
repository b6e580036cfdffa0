"""What stays along a branch: the stretches of an orbit, the modes they are in, and the jumps between them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import attrs
import numpy as np

from hybrid.simulation.arc import HybridArc
from hybrid.simulation.jumps import Jump
from hybrid.system.graph import HybridSystem

# A stretch is divided if an error at its start grows by more than this up to its end.
LARGEST_GROWTH = 1e3
# A touch that changes no component of the state by more than this share of it is none.
SLIGHT = 1e-9


@attrs.frozen
class Stretch:
    """The motion from one point of an orbit to the next, in one mode.

    Attributes
    ----------
    mode, end_mode
        Names of the modes at its two ends. They differ only if jumps accumulate within the stretch.
    within
        Names of the transitions whose jumps accumulate within the stretch; empty for a smooth motion.
    fired
        Names of the transitions that fire at its end, at one instant, in order; empty if the next stretch
        goes on smoothly.
    counters
        Values of the counters at its start. They are no unknowns, and tell no routes apart.
    """

    mode: str
    end_mode: str
    within: tuple[str, ...]
    fired: tuple[str, ...]
    counters: tuple[float, ...] = attrs.field(default=(), eq=False)


Route = tuple[Stretch, ...]


def rotations(route: Route) -> set[Route]:
    """The route as it is from each of its stretches on."""
    return {(*route[i:], *route[:i]) for i in range(len(route))}


@attrs.frozen(eq=False)
class Loop:
    """Unknowns of an orbit of ``S`` stretches.

    Attributes
    ----------
    x
        States ``(S, n)`` at the starts of the stretches, after the jumps.
    times
        Times ``(S + 1,)`` of the ends of the stretches, the first start included.
    values
        The parameters ``(k,)`` that are free.
    """

    x: np.ndarray
    times: np.ndarray
    values: np.ndarray

    @property
    def period(self) -> float:
        """Time until the orbit closes."""
        return float(self.times[-1] - self.times[0])

    @property
    def flat(self) -> np.ndarray:
        """All unknowns as one vector ``(S n + S + 1 + k,)``."""
        return np.concatenate([self.x.ravel(), self.times, self.values])

    def plus(self, change: np.ndarray) -> Loop:
        """The unknowns after a change ``(S n + S + 1 + k,)``."""
        flat = self.flat + change
        first, last = self.x.size, self.x.size + len(self.times)
        return Loop(flat[:first].reshape(self.x.shape), flat[first:last], flat[last:])


def route_of(system: HybridSystem, arc: HybridArc, period: float) -> tuple[Route, np.ndarray, np.ndarray]:
    """The stretches of an orbit, with the states and times of a :class:`Loop`, from a run over one period.

    The first stretch begins after the first jump; without jumps it is the whole run.
    """
    groups, n = instants(with_effect(system, arc.jumps)), system.tangent_dimension
    if not groups:
        mode, x = str(arc.mode[0]), arc.x[:1, :n].copy()
        stretch = Stretch(mode, mode, (), (), tuple(arc.x[0, n:].tolist()))
        return (stretch,), x, np.array([arc.t[0], arc.t[0] + period])
    if any(group[0].kind == "limit" for group in groups):
        groups, within = _without_chatter(groups)
    else:
        within = [()] * len(groups)
    stretches = []
    for group, after, passed in zip(groups, [*groups[1:], groups[0]], [*within[1:], within[0]], strict=True):
        names = tuple(jump.transition for jump in after)
        counters = tuple(group[-1].x_plus[n:].tolist())
        # A plastic impact may lead into a rest at once; a smooth stretch is in the mode that it ends in.
        begin = str(group[-1].target) if passed else after[0].source
        stretches.append(Stretch(begin, after[0].source, passed, names, counters))
    x = np.array([group[-1].x_plus[:n] for group in groups])
    times = np.array([group[0].t for group in groups] + [groups[0][0].t + period])
    # Where the order has been turned, the groups before the first one are those of the next period.
    times[:-1] += np.where(times[:-1] < times[0], period, 0.0)
    return tuple(stretches), x, times


def instants(jumps: Sequence[Jump]) -> list[list[Jump]]:
    """The jumps by instants. The last jump that ends the run belongs to no orbit."""
    groups: list[list[Jump]] = []
    for jump in jumps:
        if groups and jump.t - groups[-1][0].t <= 4 * math.ulp(jump.t) and jump.kind != "limit":
            groups[-1].append(jump)
        else:
            groups.append([jump])
    return groups


def accumulating(jumps: Sequence[Jump]) -> tuple[str, ...]:
    """Names of the transitions whose jumps accumulate at some limit of an orbit; empty if there is none."""
    groups = instants(jumps)
    last = max((i for i, group in enumerate(groups) if group[0].kind == "limit"), default=None)
    return () if last is None else _accumulating([*groups[last + 1 :], *groups[: last + 1]])


def with_effect(system: HybridSystem, jumps: Iterable[Jump]) -> list[Jump]:
    """The jumps without impacts at no speed, which change nothing but for rounding.

    Where a contact opens, its gap, the rate and the acceleration are zero, and rounding decides whether there
    is one.
    """
    resets = {each.name for each in system.transitions if each.reset and each.source == each.target}

    def is_nothing(jump: Jump) -> bool:
        touches = jump.kind == "grazing" and jump.transition in resets
        return touches and np.allclose(jump.x_minus, jump.x_plus, rtol=SLIGHT, atol=0.0)

    return [jump for jump in jumps if not is_nothing(jump)]


def from_limits(system: HybridSystem) -> set[str]:
    """Names of the transitions that leave the mode of a limit at once, such as the one into a rest.

    A run may pass one without a jump where its reset keeps the state to the last bit, so they tell no routes
    apart.
    """
    limits = {each.accumulates_to for each in system.transitions}
    return {each.name for each in system.transitions if each.source in limits and each.guard.at_start}


def _without_chatter(groups: list[list[Jump]]) -> tuple[list[list[Jump]], list[tuple[str, ...]]]:
    """The groups but those that accumulate, and the names of what accumulates before each of them.

    The order is turned so that what accumulates comes last.
    """
    last = max(i for i, group in enumerate(groups) if group[0].kind == "limit")
    turned = [*groups[last + 1 :], *groups[: last + 1]]
    kept: list[list[Jump]] = []
    within: list[tuple[str, ...]] = []
    passed: tuple[str, ...] = ()
    names, begun = _accumulating(turned), False
    for group in turned:
        accumulates = group[0].transition in names
        # The first of them is an ordinary jump: what follows it does not begin on a guard without speed.
        if group[0].kind == "limit" or (accumulates and begun):
            passed = names
        else:
            kept.append(group)
            within.append(passed)
            passed, begun = (), accumulates
    # What accumulates after the last group comes before the first one of the next period.
    within[0] = passed
    return kept, within


def _accumulating(groups: list[list[Jump]]) -> tuple[str, ...]:
    """Names of the transitions that fire in turn before the last limit, and of those that follow at once."""
    limit, *at_once = groups[-1]
    names: list[str] = []
    for jump in (jump for group in groups[-2::-1] for jump in group[::-1]):
        if names and jump.transition == names[0]:
            break
        names.append(jump.transition)
    else:
        names.insert(0, limit.transition)
    return tuple(dict.fromkeys([*names, *(jump.transition for jump in at_once)]))
