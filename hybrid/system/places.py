"""What a delay has under way, as components of the state: a list of due times in order, and its clock.

The due times count from the last change of the list, and its clock is the time since then. So the components
do not depend on the origin of time: they return where a motion repeats, and orbits close over them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, ClassVar

import attrs
import numpy as np

from hybrid.system.clocks import Clock, Quantity, read
from hybrid.system.delay import Delay

# The time left where nothing is under way.
NEVER = 1e300
# A wait is over, and its tick missed, if its end lies behind by more than this share of the duration: the
# times left are rounded.
OVER = 1e-9


@attrs.frozen
class Places:
    """The names of the components that hold what is under way, and how the list of due times changes.

    Attributes
    ----------
    duration
        How long each waits, as the user gave it.
    is_held
        Whether it reads what resets change, which may make it negative.
    misses
        Whether a wait may end without a jump.
    clock
        The time since the last change of the list; it stands still while nothing is under way.
    due
        The due times in order, on that clock; 0 in places that are free.
    count, busy
        How many are under way, and whether any is, 1 or 0: the rate of the clock.
    """

    duration: Quantity
    is_held: bool
    misses: bool
    clock: str
    due: tuple[str, ...]
    count: str
    busy: str

    def wait(self, x: Any, p: Any) -> Any:
        """How long what begins at a state waits."""
        found = read(self.duration, x, p)
        return np.maximum(found, 0.0) if self.is_held else found

    def left(self, x: Any) -> list[Any]:
        """The time left of each that is under way, in order, then ``NEVER``."""
        now, count = getattr(x, self.clock), getattr(x, self.count)
        return [np.where(count > i + 0.5, getattr(x, name) - now, NEVER) for i, name in enumerate(self.due)]

    def numbers(self, x: Any, p: Any) -> tuple[Any, ...]:
        """The times left, and how far a tick may lie behind: a negative or infinite number tells a fault."""
        wait = self.wait(x, p)
        late = np.where(wait < 0.0, wait, OVER * wait if self.misses else NEVER)
        return *self.left(x), np.where(getattr(x, self.count) > len(self.due) + 0.5, np.inf, late)

    def fault(self, x: Any, p: Any) -> str:
        """What is wrong with a state that no run leaves, in words; empty if it is right."""
        count, busy = float(getattr(x, self.count)), float(getattr(x, self.busy))
        if not 0.0 <= count <= len(self.due):
            return f"{self.count!r} must be from 0 to {len(self.due)}; got {count:.6g}"
        if busy != (count > 0.0):
            return f"{self.busy!r} must be 1 while any is under way, else 0; got {busy:.6g}"
        left = [float(each) for each in self.left(x)[: int(count)]]
        if left != sorted(left):
            return f"{self.due[0]!r} to {self.due[len(left) - 1]!r} must not fall; got {left}"
        if left and not self.misses and left[0] < -OVER * float(self.wait(x, p)):
            return f"{self.due[0]!r} must not be less than {self.clock!r}: a tick was {-left[0]:.6g} ago"
        return ""

    def after(self, x: Any, wait: Any, fires: bool, begins: bool) -> dict[str, Any]:
        """The components after a jump at ``x``, which ``fires`` at a tick, or ``begins`` a wait, or both."""
        left, count = self.left(x), getattr(x, self.count)
        if self.misses:
            # Those that are over come first, then the one that fires.
            gone = sum([_truth(each < -OVER * wait) for each in left], float(fires))
            left, count = _without(left, gone), count - gone
        elif fires:
            left, count = [*left[1:], NEVER], count - 1.0
        if begins:
            left, count = _with(left, wait) if self.is_held else _behind(left, wait, count), count + 1.0
        due = {name: np.where(count > i + 0.5, left[i], 0.0) for i, name in enumerate(self.due)}
        return {self.clock: 0.0, **due, self.count: count, self.busy: _truth(count > 0.5)}


def _truth(condition: Any) -> Any:
    """1 where a condition holds, else 0."""
    return np.where(condition, 1.0, 0.0)


def _without(left: Sequence[Any], gone: Any) -> list[Any]:
    """The list without so many of its first entries."""
    return [
        reduce(lambda found, k: np.where(gone > k - 0.5, left[k + i] if k + i < len(left) else NEVER, found),
               range(1, len(left) + 1), left[i])
        for i in range(len(left))
    ]  # fmt: skip


def _behind(left: Sequence[Any], wait: Any, count: Any) -> list[Any]:
    """The list with one entry more, the last: what waits as long as all others ends after them."""
    return [np.where(abs(count - i) < 0.5, wait, each) for i, each in enumerate(left)]


def _with(left: Sequence[Any], wait: Any) -> list[Any]:
    """The list with one entry more, behind those that are equal; the last one falls out if it is full."""
    before = [wait < each for each in left]
    return [
        np.where(here, wait if i == 0 else np.where(before[i - 1], left[i - 1], wait), each)
        for i, (here, each) in enumerate(zip(before, left, strict=True))
    ]


@attrs.frozen
class UnderWay(Clock):
    """The clock of a `Delay` in its system: it ticks where the waits that are under way end.

    Attributes
    ----------
    delay
        The clock as its author wrote it.
    places
        The components that hold what is under way.
    when
        The condition of a tick as a function of the whole state.
    """

    delay: Delay
    places: Places
    when: Callable[..., Any] | None
    reads_time: ClassVar[bool] = False

    @property
    def kind(self) -> str:
        """What its author wrote."""
        return self.delay.kind

    @property
    def number(self) -> int:  # type: ignore[override]
        """That of the delay."""
        return self.delay.number

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """One for each number: resets move them all."""
        return (*self.places.due, self.places.count)

    @property
    def moving(self) -> tuple[int, ...]:  # type: ignore[override]
        """The places of the numbers that resets move: all."""
        return tuple(range(len(self.quantities)))

    @property
    def told(self) -> str:
        """When the clock ticks, in few words."""
        return self.delay.told

    def _numbers(self, x: Any, p: Any) -> tuple[Any, ...]:
        """The times left, and a number that tells what is wrong."""
        return self.places.numbers(x, p)

    def _since_tick(self, t: Any, numbers: Sequence[Any]) -> Any:
        """The time since the first tick that is not over, negative before it."""
        *left, late = numbers
        if not self.places.misses:
            return -left[0]
        return -reduce(lambda found, each: np.where(each < -late, found, each), reversed(left))

    def _fault(self, numbers: Sequence[float], moving: bool = False) -> str:
        """What is wrong with the numbers."""
        *left, last = numbers
        if last < 0.0:
            return self.delay._fault([last])
        if last == math.inf:
            return f"places must be more than {len(left)}, as more are under way"
        bad = [each for each in left if not math.isfinite(each)]
        return f"duration must be finite; got {bad[0]:.6g}" if bad else ""
