"""The parts in which the functions of a model are compiled, each when a run first needs it."""

# The functions of a model, each with the index of a mode or of a transition first, in parts. A part is
# compiled when a run first needs it; every run needs fields, events and the slopes of these. Systems that
# differ in their guards alone, such as one and its sections, share the fields.
FIELDS, EVENTS, SLOPES, VARIATIONAL = "fields", "events", "slopes", "variational field"
SERIES, TANGENT_SERIES = "series", "tangent series"
ABREAST_SERIES, ABREAST_TANGENT_SERIES = "series abreast", "tangent series abreast"
PARTS = {
    FIELDS: ("field", "field_jacobian"),
    EVENTS: ("guard", "reset"),
    SLOPES: ("guard_gradient", "guard_curvature", "reset_jacobian"),
    VARIATIONAL: ("variational_field",),
    SERIES: ("series",),
    TANGENT_SERIES: ("tangent_series",),
    ABREAST_SERIES: ("series_abreast",),
    ABREAST_TANGENT_SERIES: ("tangent_series_abreast",),
}
# What runs without tangent vectors, and single ones, do without. A system that grows has a new text for each
# stage, so it writes these parts when a run asks for them.
LATER = (VARIATIONAL, TANGENT_SERIES, ABREAST_SERIES, ABREAST_TANGENT_SERIES)
