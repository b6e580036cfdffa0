"""What computes the runs and derivatives that the properties judge."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hybrid.compiler.agreement import compiled_value
from hybrid.compiler.compiled import CompiledSystem, compile_system
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.saltation import saltation_matrix
from hybrid.simulation.simulate import simulate
from hybrid.system.functions import ModelFunction
from hybrid.system.graph import HybridSystem


class Engine:
    """Computes runs and derivatives: with the library, unless a subclass tests something else.

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid.testing import Case, Engine, check_saltation
    >>> class Forgetful(Engine):
    ...     def saltation_matrix(self, system, transition, t, x, parameters):
    ...         return np.eye(len(x))
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6, engine=Forgetful())
    >>> try:
    ...     check_saltation(case)
    ... except AssertionError:
    ...     print("a fault")
    a fault
    """

    def simulate(
        self, system: HybridSystem, x0: Any, t_span: tuple[float, float], **options: Any
    ) -> HybridArc:
        """As :func:`hybrid.simulate`."""
        return simulate(system, x0, t_span, **options)

    def saltation_matrix(
        self, system: HybridSystem, transition: str, t: float, x: Any, parameters: Mapping[str, float]
    ) -> np.ndarray:
        """As :func:`hybrid.saltation_matrix`."""
        return saltation_matrix(system, transition, t, x, parameters=parameters)

    def derivative(
        self,
        system: HybridSystem,
        function: ModelFunction,
        index: int,
        t: float,
        x: np.ndarray,
        parameters: np.ndarray,
    ) -> np.ndarray:
        """The derivative ``(rows, n + 1)`` of a field, guard or reset, as runs use it."""
        return compile_system(system).derivative(function, index, t, x, parameters)

    def value(
        self,
        compiled: CompiledSystem,
        function: ModelFunction,
        index: int,
        t: float,
        x: np.ndarray,
        parameters: np.ndarray,
    ) -> np.ndarray:
        """The values ``(rows,)`` of a field, guard, condition or reset, as runs use them."""
        return compiled_value(compiled, function, index, t, x, parameters)


LIBRARY = Engine()
