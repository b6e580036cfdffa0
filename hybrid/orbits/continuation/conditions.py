"""The condition of a transition as smooth functions, one of which is zero where the condition changes."""

from __future__ import annotations

from hybrid.expression.evaluation import expressed
from hybrid.expression.switches import heights_of
from hybrid.expression.tracing import TraceError, trace
from hybrid.system.elements import Function, Transition
from hybrid.system.variables import Variables


def comparisons(transition: Transition, variables: Variables) -> Function:
    """What is compared with zero in a transition's condition, as a function of ``(t, x, p)``.

    ``(q < a) | (v > 0)`` has the values ``a - q`` and ``v``. A condition that cannot be traced has itself.
    """
    when = transition.guard.when
    assert when is not None
    try:
        (condition,) = trace(when, variables.components, variables.parameter_names)
    except TraceError:
        return lambda t, x, p: [when(t, x, p)]
    return expressed(heights_of(condition))
