"""From generated text to machine code, without numba's inference of types."""

# The functions of a model, each with the index of a mode or of a transition first.
ROLES = (
    "flow",
    "flow_jacobian",
    "variational_flow",
    "guard",
    "guard_gradient",
    "reset",
    "reset_jacobian",
    "series",
)
