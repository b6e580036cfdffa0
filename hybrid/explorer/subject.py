"""What a page is about: a system, where its runs start, and how far its sliders go."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError, HybridError
from hybrid.simulation.simulate import simulate
from hybrid.system.graph import HybridSystem, as_system
from hybrid.testing.case import Case
from hybrid.testing.starts import start_in
from hybrid.testing.strategies import default_duration

# Starts that are tried where none is given: rest, then states of a fixed random sequence.
STARTS_TRIED = 24
# A start is judged over so many times the span of the cases of hybrid.testing: a drive takes its time.
LONG = 10
# A slider goes from half of the declared value to one and a half of it, and from -1 to 1 around zero.
SHARE = 0.5


@attrs.frozen(eq=False)
class Subject:
    """A system with a start.

    Attributes
    ----------
    system
        The model.
    text
        Lines of Python that make ``system``.
    x0, mode, values
        Start by component, mode there (None: the mode that the start allows), values of all parameters.
    ranges
        Ends ``(low, high)`` of the slider of each parameter.
    """

    system: HybridSystem
    text: str
    x0: Mapping[str, float]
    mode: str | None
    values: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]

    @property
    def title(self) -> str:
        """The name of the model."""
        return self.system.name or "Hybrid system"

    @cached_property
    def is_forced(self) -> bool:
        """Whether the system declares a forcing period."""
        return self.system.forcing_period(self.values) is not None

    @cached_property
    def typical_time(self) -> float:
        """Time in which an unforced state moves by about its size, to one digit."""
        return float(f"{default_duration(self.system, self.values) / 10:.1g}")

    def unit_of_time(self, values: Mapping[str, float]) -> float:
        """The forcing period with these parameters, or the typical time."""
        period = self.system.forcing_period(values)
        return self.typical_time if period is None else period


def subject(
    system: HybridSystem,
    text: str,
    x0: Any = None,
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
) -> Subject:
    """A system with everything that was not given.

    Raises
    ------
    ArgumentError
        If a name does not exist, a value is not allowed, or no start is found.
    """
    as_system("system", system)
    system.parameter_values(parameters)
    values = {**system.parameters, **system.variables.overrides(parameters)}
    ends = {name: _range(value) for name, value in values.items()}
    for name, given in (ranges or {}).items():
        arguments.known("ranges: Parameter", name, system.parameters, "Parameters")
        low, high = arguments.time_span(f"ranges: Range of {name!r}", given)
        if not low < high:
            raise arguments.refusal(f"ranges: Range of {name!r}", "be (low, high) with low < high", given)
        ends[name] = (low, high)
    if x0 is None:
        x0, mode = _found_start(system, values, mode)
    else:
        x0 = simulate(system, x0, (0.0, 0.0), mode=mode, parameters=values).x[0]
    start = dict(zip(system.state_names, map(float, x0), strict=True))
    return Subject(system, text, start, mode, values, ends)


def _range(value: float) -> tuple[float, float]:
    if value == 0.0:
        return (-1.0, 1.0)
    low, high = sorted(float(f"{share * value:.9g}") for share in (1 - SHARE, 1 + SHARE))
    return (low, high)


def _found_start(
    system: HybridSystem, values: Mapping[str, float], mode: str | None
) -> tuple[tuple[float, ...], str | None]:
    """A start from which the most happens: jumps, else motion, else anything that runs."""
    rng = np.random.default_rng(20240507)
    n, last = system.dimension, LONG * default_duration(system, values)
    modes = [each for each in system.modes if mode in (None, each.name, each.part_of)]
    # A drive brings a small start to its own size; without a drive, the size stays.
    ends = (0.02, 2.0) if system.forcing_period(values) is not None else (2.0, 0.02)
    random = rng.uniform(-1.0, 1.0, (STARTS_TRIED, n)).round(3)
    random[:, system.tangent_dimension :] = 0.0
    tries = [np.zeros(n), *(np.geomspace(*ends, STARTS_TRIED)[:, None] * random)]
    best: tuple[float, tuple[float, ...], str | None] | None = None
    for x in tries:
        for part in modes:
            start = start_in(Case(system, dict(values), part.name, tuple(x.tolist()), 0.0, last), part.name)
            if start is None:
                continue
            # A mode that has been split is named as its author named it: the start tells the part.
            name = part.part_of or part.name
            try:
                arc = simulate(system, start, (0.0, last), mode=name, parameters=values, max_jumps=1000)
            except HybridError:
                continue
            moves = bool(np.any(np.ptp(arc.x, axis=0) > 0.0))
            worth = 4.0 * arc.status.ok + 2.0 * (arc.jump_count > 0) + moves
            if best is None or worth > best[0]:
                best = (worth, start, name)
        if best is not None and best[0] == 7.0:
            break
    if best is None:
        raise _no_start(system, values, mode)
    return best[1], best[2]


def _no_start(system: HybridSystem, values: Mapping[str, float], mode: str | None) -> ArgumentError:
    """The error where no start runs, with that of a run from rest as its cause: a model may be at fault."""
    text = "No start was found from which the system runs. Give one with x0=."
    try:
        simulate(system, np.zeros(system.dimension), (0.0, 0.0), mode=mode, parameters=values)
    except HybridError as error:
        found = ArgumentError(f"{text} From rest: {error}")
        found.__cause__ = error
        return found
    return ArgumentError(text)
