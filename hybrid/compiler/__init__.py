"""From generated text to machine code, without numba's inference of types."""

# The functions of a model, each with the index of a mode or of a transition first, in parts that are compiled
# when a run first needs them. Every run needs those at a point.
POINT, VARIATIONAL, SERIES, TANGENT_SERIES = "point", "variational", "series", "tangent series"
PARTS = {
    POINT: ("flow", "flow_jacobian", "guard", "guard_gradient", "reset", "reset_jacobian"),
    VARIATIONAL: ("variational_flow",),
    SERIES: ("series",),
    TANGENT_SERIES: ("tangent_series",),
}
