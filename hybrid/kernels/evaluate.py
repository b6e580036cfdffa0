"""The compiled functions of a model, called from Python."""

from hybrid.kernels.arithmetic.slopes import whole_jacobian
from hybrid.kernels.types.kinds import INTEGER, MATRIX, REAL, VECTOR
from hybrid.kernels.types.layout import Model
from hybrid.kernels.types.options import exported


@exported(None, Model, INTEGER, INTEGER, REAL, VECTOR, VECTOR)
def vector_function(model, function, index, t, x, out):
    """Value of a field (function 0), guard (1) or reset (2), or the gradient of a guard (3), into ``out``."""
    if function == 0:
        model.field(index, t, x, model.parameters, out)
    elif function == 1:
        model.guard(index, t, x, model.parameters, out)
    elif function == 2:
        model.reset(index, t, x, model.parameters, out)
    else:
        model.guard_gradient(index, t, x, model.parameters, out)


@exported(None, Model, INTEGER, INTEGER, REAL, VECTOR, MATRIX)
def matrix_function(model, function, index, t, x, out):
    """Jacobian ``(n, n + 1)`` of a field (function 0) or a reset (2) into ``out``."""
    if function == 0:
        whole_jacobian(model, index, t, x, out)
    else:
        model.reset_jacobian(index, t, x, model.parameters, out)
