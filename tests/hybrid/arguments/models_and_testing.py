"""Models, contact laws and tests of systems: valid calls, and what each argument must refuse."""

import math

import hybrid
import hybrid.testing
import models
from models import contact
from models.dry_friction_oscillator import den_hartog_amplitude
from models.one_impact import one_impact_orbits
from tests.hybrid.arguments.values import (
    BALL,
    COUNT,
    LIST,
    NAME,
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    QUANTITY,
    RANGES,
    SOLVER,
    SPAN,
    SYSTEM,
    Odd,
    call,
)

BY_NAME = [3, [3], {"a": 3}, {"a": None}, {3: abs}]
LAWS = {
    **dict.fromkeys(("invariant", "equal", "conserved", "dissipated", "across"), BY_NAME),
    "balance": [*BY_NAME, {"a": abs}, {"a": (abs, 3)}],
    "continuous": [3, [3], [None]],
    "elastic": ["nope", 3, ["nope"], [3], [None]],
    "alike": [3, [3], [None], ["nope"]],
}
OF_SYSTEMS = ("check_system", "check_reads", "check_dimensions")


def checks():
    case = hybrid.testing.Case(BALL, dict(BALL.parameters), "flight", (1.0, 0.0), 0.0, 0.3)
    return [
        (call(hybrid.testing.states, BALL), {"system": SYSTEM, "ranges": RANGES}),
        (
            call(hybrid.testing.parameters, BALL),
            {"system": SYSTEM, "ranges": [*RANGES[:4], {"g": "a"}, {"g": (2, 1)}]},
        ),
        *(
            (
                call(function, BALL),
                {
                    "system": SYSTEM,
                    "states": RANGES,
                    "parameters": [*RANGES[:4], {"g": "a"}, {"g": True}],
                    "t_span": [*SPAN[1:], (1.0, 1.0)],
                    "mode": NAME,
                    "solver": SOLVER,
                    "engine": [None, "a", 3, Odd()],
                    "passable": [None, 3, ["nope"], "nope", [3]],
                    "laws": [3, "a", {}, BALL, Odd()],
                    **(
                        {}
                        if function is hybrid.testing.cases
                        else {"examples": [0, *COUNT], "progress": [3, "a"]}
                    ),
                },
            )
            for function in (hybrid.testing.cases, hybrid.testing.check_system)
        ),
        (call(hybrid.testing.small_systems), {}),
        (
            call(hybrid.testing.piecewise_affine_fields),
            {name: [None, 3, "ab", (1,), (0, 1), (2, 1), (1.5, 2)] for name in ("dimensions", "switches")},
        ),
        *(
            (call(getattr(hybrid.testing, name), None), {"case": [None, "a", 3, BALL]})
            for name in hybrid.testing.__all__
            if name.startswith("check_") and name not in (*OF_SYSTEMS, "check_elastic")
        ),
        (call(hybrid.Laws.joined, hybrid.Laws(), hybrid.Laws()), {"other": [None, "a", 3, {}, BALL]}),
        (call(hybrid.Laws), LAWS | {"elastic": ["nope", 3, [3], [None]], "alike": [3, [3], [None]]}),
        *((call(getattr(hybrid.testing, name), BALL), {"system": SYSTEM}) for name in OF_SYSTEMS[1:]),
        (
            call(hybrid.testing.check_elastic, case, ["v"]),
            {
                "case": [None, "a", 3, BALL],
                "flip": [None, "v", 3, ["nope"], [3], [None]],
            },
        ),
    ]


def laws():
    return [
        (call(models.interleaved_converter, 2), {"phases": [0, *COUNT]}),
        (call(models.pulse_coupled_neurons, 2), {"count": [0, *COUNT]}),
        (call(models.verge_escapement), {"teeth": [0, *COUNT]}),
        (call(models.newtons_cradle), {"balls": [0, *COUNT], "impacts": [None, 3, "hertz", Odd()]}),
        (call(models.shaken_stack), {"boxes": [0, *COUNT]}),
        (call(models.dosing_schedule), {"times": [*QUANTITY[:-2], [], [math.nan]]}),
        (call(models.infusion_schedule), {"frame": [*LIST, [], {"t": []}]}),
        (call(models.vibroimpact), {"contact": ["a", 3, 0, False, contact.Rigid, Odd()]}),
        (
            call(contact.hertz_stiffness),
            {
                "E": POSITIVE,
                "nu": [*NUMBER, 1.0, -1.0],
                "A": POSITIVE,
                "B": POSITIVE,
                "q": POSITIVE,
            },
        ),
        (
            call(one_impact_orbits, 1.0, 0.1, 0.5, 0.8, 1.0, 0.7),
            {
                **dict.fromkeys("kcAd", NUMBER),
                "w": POSITIVE,
                "r": NOT_NEGATIVE,
                "n": [0, *COUNT],
            },
        ),
        (call(den_hartog_amplitude, 0.1, 1.0, 0.5), {"f": NOT_NEGATIVE, "A": NUMBER, "w": POSITIVE}),
        (call(contact.Rigid), {"e": NOT_NEGATIVE}),
        (call(contact.Hertz, 1e8), {"K": POSITIVE}),
        (call(contact.HuntCrossley, 1e8, 0.1), {"K": POSITIVE, "alpha": NOT_NEGATIVE}),
        (call(contact.KelvinVoigt, 1e8, 0.1), {"k": POSITIVE, "c": NOT_NEGATIVE}),
        (
            call(contact.HuntCrossley.from_restitution, 0.8, 1e8, 0.4),
            {
                "e": [*POSITIVE, 1.1],
                "K": POSITIVE,
                "speed": POSITIVE,
            },
        ),
        (
            call(contact.KelvinVoigt.from_restitution, 0.8, 90.0, 0.01),
            {
                "e": [*POSITIVE, 1.1],
                "mass": POSITIVE,
                "duration": POSITIVE,
            },
        ),
        (
            call(contact.matched_laws, 1e8, 90.0, 0.4),
            {
                "e": [*POSITIVE, 1.1],
                "K": POSITIVE,
                "mass": POSITIVE,
                "speed": POSITIVE,
            },
        ),
    ]
