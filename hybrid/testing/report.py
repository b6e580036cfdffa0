"""What a check of a system found: what matters first, then what holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import attrs

from hybrid.display.tables import table

# A property is reported as hardly checked if less than this share of its examples could be judged.
HARDLY = 0.1
# Reasons told of each kind, the most frequent ones.
MOST_TOLD = 3
COLUMNS = ("", "examples", "not judged", "property", "why not judged")


@attrs.frozen
class PropertyReport:
    """Result for one property.

    Attributes
    ----------
    name
        The property, as a sentence.
    examples
        Number of examples on which the property was checked and held.
    discarded
        Number of examples that could not be judged, by reason.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import check_system
    >>> report = check_system(models.bouncing_ball(), examples=5)
    >>> one = report.properties[0]
    >>> one.name, one.checked
    ('Given, traced and numerical derivatives agree', True)
    """

    name: str
    examples: int
    discarded: Counter[str]

    @property
    def checked(self) -> bool:
        """Whether the property was checked on any example."""
        return self.examples > 0

    @property
    def hardly(self) -> bool:
        """Whether it was checked on few of its examples."""
        return self.checked and self.examples < HARDLY * (self.examples + self.discarded.total())

    @property
    def row(self) -> tuple[str, str, str, str, str]:
        """The result as a row of a table: see ``COLUMNS``."""
        verdict = "HARDLY CHECKED" if self.hardly else "holds" if self.checked else "NOT CHECKED"
        passed = str(self.discarded.total() or "")
        why = _most_common(self.discarded) if self.discarded else ""
        return verdict, str(self.examples), passed, self.name, why

    def __str__(self) -> str:
        if not self.checked:
            return f"{self.name} ({_most_common(self.discarded)})"
        lost = f", {self.discarded.total()} not ({_most_common(self.discarded)})" if self.discarded else ""
        return f"{self.name}: held on {self.examples} examples{lost}"


@attrs.frozen
class SystemReport:
    """What :func:`check_system` checked; every property held.

    Attributes
    ----------
    properties
        One :class:`PropertyReport` per property.
    unfit
        Number of runs that could not be judged, by reason; only the laws and the model functions were checked
        on them.
    cut
        Number of runs of which only a part was judged, by reason.
    ends
        Number of runs that ended before their time, by how they ended.
    jumps
        How often each transition was taken, by name, on whole runs.
    visits
        How often each mode was entered or started in, by name.
    one_sided
        Transitions that were taken, and whose condition has refused no crossing.
    dead_ends
        Modes that no transition leaves although the state moves in them, modes that none enters, and modes
        that each run leaves at once.
    numbers
        Numbers that the model functions read from modules and closures, by name.
    discontinuities
        Where the field of a mode is discontinuous, by mode: tangent vectors are not valid beyond.
    gains
        How often an impact has gained energy as its law allows, by transition.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import check_system
    >>> report = check_system(models.bouncing_ball(), examples=5)
    >>> report.never_seen, report.visits["flight"] > 0
    ((), True)
    """

    name: str
    properties: tuple[PropertyReport, ...]
    unfit: Counter[str]
    cut: Counter[str]
    ends: Counter[str]
    jumps: Counter[str]
    visits: Counter[str]
    one_sided: tuple[str, ...]
    dead_ends: tuple[str, ...]
    numbers: Mapping[str, float]
    discontinuities: Mapping[str, str]
    gains: Mapping[str, int] = attrs.field(factory=dict)

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Properties that were checked on no example."""
        return tuple(found.name for found in self.properties if not found.checked)

    @property
    def never_seen(self) -> tuple[str, ...]:
        """Transitions that no run took and modes that no run visited."""
        return tuple(name for count in (self.jumps, self.visits) for name in count if not count[name])

    def __str__(self) -> str:
        lines = [f"{self.name}: no property failed.", *self._matters()]
        # What is hardly known comes first.
        order = sorted(self.properties, key=lambda found: (found.checked, not found.hardly))
        lines.append(table(COLUMNS, [found.row for found in order]))
        return "\n".join(lines)

    def _matters(self) -> list[str]:
        lines = []
        if self.never_seen:
            lines.append(f"- NEVER SEEN: {', '.join(self.never_seen)}. Give ranges that reach them.")
        lines += [f"- {dead_end}" for dead_end in self.dead_ends]
        if self.one_sided:
            lines.append(
                f"- ONE SIDE ONLY: the condition of {', '.join(self.one_sided)} has refused no crossing. "
                "Give ranges where it does not hold."
            )
        if self.unfit:
            lines.append(f"- NOT JUDGED: {_reasons(self.unfit)}. Laws and functions were checked there.")
        if self.ends:
            lines.append(f"- ENDED EARLY: {_reasons(self.ends)}.")
        if self.cut:
            lines.append(f"- CUT, for all but laws and ends: {_reasons(self.cut)}.")
        for mode, jumps in self.discontinuities.items():
            lines.append(
                f"- The field of mode {mode!r} jumps where {jumps}: tangent vectors are not valid beyond. "
                "Make its pieces modes joined by guards there."
            )
        if self.gains:
            told = ", ".join(f"{count} times at {name}" for name, count in self.gains.items())
            lines.append(
                f"- IMPACTS GAIN ENERGY, as Newton's law may with friction or several restitutions: {told}. "
                'mechanics(impacts="poisson") does not.'
            )
        if self.numbers:
            told = ", ".join(f"{name} = {value:.6g}" for name, value in self.numbers.items())
            lines.append(f"- Read from outside the model, and never varied: {told}.")
        return lines


def _most_common(reasons: Counter[str]) -> str:
    reason, most = reasons.most_common(1)[0]
    share = "" if most == reasons.total() else f"{most} of them: "
    return f"{share}{reason.rstrip('.')}"


def _reasons(reasons: Counter[str]) -> str:
    """Counts with their reasons, the most frequent first."""
    told = [f"{count} runs ({reason.rstrip('.')})" for reason, count in reasons.most_common(MOST_TOLD)]
    others = reasons.total() - sum(count for _, count in reasons.most_common(MOST_TOLD))
    return ", ".join([*told, *([f"{others} others"] if others else [])])
