"""What calls that make a system pass on to it: arguments of `HybridSystem`, written down once for all."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, TypedDict

from hybrid.shared import Shared, fields_of
from hybrid.system.laws import Laws
from hybrid.system.periodicity import Period

OF_A_SYSTEM = "As for `HybridSystem`."


class Described(TypedDict, total=False):
    """What is said of a system besides its functions."""

    period: Annotated[Period, Shared(None, OF_A_SYSTEM)]
    name: Annotated[str, Shared("", OF_A_SYSTEM)]
    units: Annotated[Mapping[str, str] | None, Shared(None, OF_A_SYSTEM)]
    angles: Annotated[Mapping[str, float] | None, Shared(None, OF_A_SYSTEM)]
    outputs: Annotated[Mapping[str, Any] | None, Shared(None, OF_A_SYSTEM)]
    laws: Annotated[Laws | None, Shared(None, OF_A_SYSTEM)]


class DescribedWithShifts(Described, total=False):
    """Besides, along which components it is the same everywhere."""

    cyclic: Annotated[Iterable[str], Shared((), OF_A_SYSTEM)]


OPTIONAL = {name for name, (_, each) in fields_of(DescribedWithShifts).items() if each.default is None}


def passed_on(asked: Described) -> dict[str, Any]:
    """The arguments of `HybridSystem` that a call was given; it has its own defaults for those left out."""
    return {name: value for name, value in asked.items() if value is not None or name not in OPTIONAL}
