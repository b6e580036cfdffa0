"""What the searches for attractors ask alike: arguments with their types, defaults and descriptions."""

from collections.abc import Mapping
from typing import Annotated, Any, TypedDict

from hybrid.shared import Shared
from hybrid.solvers import Solver
from hybrid.system.elements import Guard

OF_A_RUN = "As for :func:`hybrid.simulate`."


class AskedOfRuns(TypedDict, total=False):
    """Where runs begin, and when they are near an attractor."""

    mode: Annotated[str | None, Shared(None, OF_A_RUN)]
    parameters: Annotated[Mapping[str, float] | None, Shared(None, OF_A_RUN)]
    solver: Annotated[Solver | None, Shared(None, OF_A_RUN)]
    t0: Annotated[
        float,
        Shared(0.0, "Time at the starts; its phase is that of the section of a forced system."),
    ]
    interval: Annotated[
        float | None,
        Shared(
            None,
            "Time between two points of an autonomous system without a section; by default the time scale of "
            "its field.",
        ),
    ]
    periods: Annotated[int, Shared(1000, "Points that a run has to settle.")]
    recurrences: Annotated[
        int,
        Shared(10, "Points in succession near one attractor that decide a start."),
    ]
    tolerance: Annotated[
        float,
        Shared(
            0.01,
            "Two states are near each other if no component differs by more than this share of the distance "
            "by which it changes along the attractor's orbit.",
        ),
    ]


class AskedOfSearch(AskedOfRuns, total=False):
    """Besides, where the points of runs are taken, and what tells attractors apart."""

    section: Annotated[
        Guard | None,
        Shared(None, "Surface for the points, for autonomous systems or in place of the forcing period."),
    ]
    features: Annotated[
        Any,
        Shared(
            None,
            "What tells attractors apart in place of their points: a function of an arc that gives one "
            'number, such as ``maximum("x")`` of `hybrid.measures`; several such functions; or a mapping of '
            "names to them. Each is taken of stretches of ``recurrences`` points, of which more make "
            "features of chaos scatter less; ``tolerance`` is not needed.",
        ),
    ]
    together: Annotated[
        float | Mapping[str, float] | None,
        Shared(
            None,
            "The widest gap in a feature that a group of runs may have, in its unit: a number, "
            "or a mapping of each feature to one. By default the runs tell it.",
        ),
    ]
