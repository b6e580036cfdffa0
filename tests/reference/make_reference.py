"""Write the JSON files beside this script: exact or high-precision answers, computed without the library.

Every number is correct to the last digit or two of a double, since all are computed with at least 25 digits and rounded
at the end. Run ``python tests/reference/make_reference.py`` (about two minutes).
"""

from __future__ import annotations

import json
from pathlib import Path

import founding_system
import impacts
import switched

ANSWERS = {
    "founding_system": founding_system.answers,
    "impact_oscillator": impacts.impact_oscillator,
    "bouncing_ball": impacts.bouncing_ball,
    "solvable_oscillator": switched.solvable_oscillator,
    "rimless_wheel": switched.rimless_wheel,
    "buck_converter": switched.buck_converter,
    "switched_linear": switched.switched_linear,
    "stick_slip": switched.stick_slip,
    "saltation": switched.saltation,
}

if __name__ == "__main__":
    for name, answers in ANSWERS.items():
        path = Path(__file__).with_name(f"{name}.json")
        path.write_text(json.dumps(answers(), indent=1) + "\n")
        print(path.name)
