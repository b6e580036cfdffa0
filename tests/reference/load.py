"""The stored reference answers, by name."""

import json
from pathlib import Path
from typing import Any


def reference(name: str) -> Any:
    return json.loads(Path(__file__).with_name(f"{name}.json").read_text(encoding="utf-8"))


def complex_pairs(pairs: list[list[float]]) -> list[complex]:
    """Complex numbers from ``[[re, im], ...]``, sorted for comparison."""
    return sorted((complex(*pair) for pair in pairs), key=lambda m: (round(m.real, 9), m.imag))
