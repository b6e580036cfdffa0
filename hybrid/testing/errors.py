"""How a property fails, and how an example is passed over."""

from __future__ import annotations

from typing import Any, NoReturn

from hypothesis.errors import UnsatisfiedAssumption

# Under this name pytest looks for what says whether it leaves the lines of a module out of a traceback.
HIDDEN_FROM_PYTEST = "__tracebackhide__"


class PropertyError(AssertionError):
    """A property that a system should have fails; the message gives the case and the likely cause.

    Attributes
    ----------
    time
        The time on the run at which it fails; None if it is not known.

    Examples
    --------
    >>> import attrs, models
    >>> from hybrid.testing import PropertyError, check_reads
    >>> unread = attrs.evolve(models.bouncing_ball(), parameters={"g": 9.81, "e": 0.8, "mass": 1.0})
    >>> try:
    ...     check_reads(unread)
    ... except PropertyError as error:
    ...     print(str(error).splitlines()[1].strip())
    no function reads parameter 'mass'
    """

    def __init__(self, text: str, time: float | None = None) -> None:
        super().__init__(text)
        self.time = time


# The name under which it is imported and printed.
PropertyError.__module__ = __name__.rpartition(".")[0]


def is_property_error(caught: Any) -> bool:
    """Whether pytest has caught a property that fails, for which the lines of this library say nothing."""
    return isinstance(caught.value, PropertyError)


def discard(reason: str) -> NoReturn:
    """Discard an example that cannot be judged; Hypothesis then draws another one.

    Examples
    --------
    >>> from hybrid.testing import Case, discard
    >>> def rises_at_first(case: Case) -> None:
    ...     if case.x0[1] <= 0.0:
    ...         discard("the ball does not start upwards")
    ...     assert case.run.arc["q"].max() > case.x0[0]
    """
    raise UnsatisfiedAssumption(reason)
