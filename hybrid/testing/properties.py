"""All properties of a system, in the order in which they are checked."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hybrid.system.graph import HybridSystem
from hybrid.system.laws import Laws
from hybrid.testing.case import Case
from hybrid.testing.contacts import (
    COEFFICIENTS,
    FORCES,
    GAPS,
    IMPACTS,
    check_coefficients,
    check_contact_forces,
    check_gaps,
    check_impacts,
)
from hybrid.testing.crossings import CROSSINGS, check_crossings
from hybrid.testing.derivatives import DERIVATIVES, check_derivatives
from hybrid.testing.elastic import ELASTIC, check_elastic
from hybrid.testing.ends import ENDS, SIDES_AFTER, check_ends, check_sides_after
from hybrid.testing.events import JUMPS, SIDES, check_jumps, check_sides
from hybrid.testing.functions import (
    ANGLES,
    COMPILED,
    PERIOD,
    check_angles,
    check_compiled,
    check_period,
)
from hybrid.testing.invariance import (
    CUT,
    NAMES,
    ORDER,
    SAMPLES,
    SCALE,
    SPLIT,
    check_cut,
    check_names,
    check_order,
    check_samples,
    check_scale,
    check_split,
)
from hybrid.testing.landing import LANDINGS, LIMITS, check_landings, check_limits
from hybrid.testing.laws import declared_too, law_checks
from hybrid.testing.outputs import OUTPUTS, check_outputs
from hybrid.testing.saltation import (
    CONTINUITY,
    EXTENSION,
    FLOW_DIRECTION,
    SALTATION,
    SUM_RULE,
    check_continuity,
    check_extension,
    check_flow_direction,
    check_saltation,
    check_sum_rule,
)
from hybrid.testing.ticks import check_ticks
from hybrid.testing.units import UNITS, check_units
from hybrid.testing.waits import TICKS
from hybrid.transform.contacts.growth import contacts_of

# Properties of the functions, at the start of a case, and of the whole run; laws are others.
OF_CONTACTS = {
    COEFFICIENTS: check_coefficients,
    GAPS: check_gaps,
    FORCES: check_contact_forces,
    IMPACTS: check_impacts,
}

WITHOUT_RUN = (DERIVATIVES, COMPILED, PERIOD, ANGLES, SIDES_AFTER, LIMITS, ENDS, *OF_CONTACTS)


def properties_of(
    system: HybridSystem, laws: Laws, flip: Callable[[np.ndarray], np.ndarray] | None
) -> dict[str, Callable[[Case], None]]:
    """The properties in the order in which they are checked: what is nearest to the author's text first."""
    touching = {} if contacts_of(system) is None else OF_CONTACTS
    properties: dict[str, Callable[[Case], None]] = {
        **touching,
        DERIVATIVES: check_derivatives,
        COMPILED: check_compiled,
        PERIOD: check_period,
        ANGLES: check_angles,
        SIDES_AFTER: check_sides_after,
        LIMITS: check_limits,
        **law_checks(laws),
        ENDS: lambda case: declared_too(case, check_ends),
        SIDES: check_sides,
        LANDINGS: check_landings,
        CROSSINGS: check_crossings,
        TICKS: check_ticks,
        JUMPS: check_jumps,
        OUTPUTS: check_outputs,
        UNITS: check_units,
        NAMES: check_names,
        ORDER: check_order,
        SCALE: check_scale,
        SPLIT: check_split,
        SAMPLES: check_samples,
        CUT: check_cut,
        CONTINUITY: check_continuity,
        EXTENSION: check_extension,
        FLOW_DIRECTION: check_flow_direction,
        SALTATION: check_saltation,
        SUM_RULE: check_sum_rule,
    }
    applies = {
        PERIOD: system.period is not None,
        ANGLES: bool(system.angles),
        OUTPUTS: bool(system.outputs),
        LANDINGS: any(each.reset is not None for each in system.transitions),
        TICKS: any(each.clock for each in system.transitions),
        LIMITS: any(each.accumulates_to for each in system.transitions),
        ORDER: len(system.transitions) > 1 and not system.listed_order,
    }
    properties = {name: check for name, check in properties.items() if applies.get(name, True)}
    if flip is not None:
        properties[ELASTIC] = lambda case: check_elastic(case, flip)
    return properties
