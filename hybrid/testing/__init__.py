"""Properties that every hybrid system must have, checked on randomly drawn runs of a model.

``check_system(system)`` checks all of them. Each property is also a function of one :class:`Case`, for your
own tests with ``@given(cases(system))``.
"""

import sys

from hybrid.testing.case import Case
from hybrid.testing.check import check_system
from hybrid.testing.contacts import (
    check_coefficients,
    check_contact_forces,
    check_gaps,
    check_impacts,
)
from hybrid.testing.crossings import check_crossings
from hybrid.testing.derivatives import check_derivatives
from hybrid.testing.dimensions import check_dimensions
from hybrid.testing.elastic import check_elastic
from hybrid.testing.ends import check_ends, check_sides_after
from hybrid.testing.engine import Engine
from hybrid.testing.errors import (
    HIDDEN_FROM_PYTEST,
    PropertyError,
    discard,
    is_property_error,
)
from hybrid.testing.events import check_jumps, check_sides
from hybrid.testing.fields import PiecewiseAffineField, piecewise_affine_fields
from hybrid.testing.functions import check_angles, check_compiled, check_period
from hybrid.testing.invariance import (
    check_cut,
    check_names,
    check_order,
    check_samples,
    check_scale,
    check_split,
)
from hybrid.testing.landing import check_landings, check_limits
from hybrid.testing.laws import check_laws
from hybrid.testing.outputs import check_outputs
from hybrid.testing.reads import check_reads
from hybrid.testing.report import PropertyReport, SystemReport
from hybrid.testing.run import Run
from hybrid.testing.saltation import (
    check_continuity,
    check_extension,
    check_flow_direction,
    check_saltation,
    check_sum_rule,
)
from hybrid.testing.small import small_systems
from hybrid.testing.strategies import cases, parameters, run_settings, states
from hybrid.testing.ticks import check_ticks
from hybrid.testing.units import check_units

__all__ = [
    "Case",
    "Engine",
    "PiecewiseAffineField",
    "PropertyError",
    "PropertyReport",
    "Run",
    "SystemReport",
    "cases",
    "check_angles",
    "check_coefficients",
    "check_compiled",
    "check_contact_forces",
    "check_continuity",
    "check_crossings",
    "check_cut",
    "check_derivatives",
    "check_dimensions",
    "check_elastic",
    "check_ends",
    "check_extension",
    "check_flow_direction",
    "check_gaps",
    "check_impacts",
    "check_jumps",
    "check_landings",
    "check_laws",
    "check_limits",
    "check_names",
    "check_order",
    "check_outputs",
    "check_period",
    "check_reads",
    "check_saltation",
    "check_samples",
    "check_scale",
    "check_sides",
    "check_sides_after",
    "check_split",
    "check_sum_rule",
    "check_system",
    "check_ticks",
    "check_units",
    "discard",
    "parameters",
    "piecewise_affine_fields",
    "run_settings",
    "small_systems",
    "states",
]

# Below the line of a test that fails pytest tells the property, and not the way to it through this package.
for _module in [module for name, module in sys.modules.items() if name.startswith("hybrid.testing.")]:
    setattr(_module, HIDDEN_FROM_PYTEST, is_property_error)
