"""Write the JSON files beside this script: exact or high-precision answers, computed without the library.

All are computed with thirty digits or more and rounded to doubles at the end, so every digit counts.
Run ``python tests/reference/make_reference.py``; it takes some minutes.
"""

from __future__ import annotations

import json
from pathlib import Path

import founding_system
import friction
import impacts
import switched
import walking

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
    "dry_friction_oscillator": friction.dry_friction_oscillator,
    "simplest_walker": walking.simplest_walker,
    "slip_hopper": walking.slip_hopper,
}

if __name__ == "__main__":
    for name, answers in ANSWERS.items():
        path = Path(__file__).with_name(f"{name}.json")
        path.write_text(json.dumps(answers(), indent=1) + "\n")
        print(path.name)
