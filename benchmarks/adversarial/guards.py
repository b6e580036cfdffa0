"""Random guards: compositions of functions with sharpness, thresholds and places as parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.adversarial.flows import Flow, Range, evenly, logarithmically

PLACE = evenly(-1.0, 1.0)
LEVEL = evenly(0.1, 0.9)
SIGNED = evenly(-0.9, 0.9)
SHARP = logarithmically(1.0, 1e4)
# Sharpness for which an exponential does not overflow.
GENTLE = logarithmically(1.0, 150.0)
# U and V are two signals; each parameter of a family gets a unique name in the guard.
FAMILIES: dict[str, tuple[str, dict[str, Range]]] = {
    "affine": ("U - {a}", {"a": PLACE}),
    "tanh": ("np.tanh({k}*(U - {a})) - {c}", {"k": SHARP, "a": PLACE, "c": SIGNED}),
    "exp": ("np.exp({k}*(U - {a})) - {c}", {"k": GENTLE, "a": PLACE, "c": logarithmically(0.01, 10.0)}),
    "log1p": ("np.log1p(np.exp({k}*(U - {a}))) - {c}", {"k": GENTLE, "a": PLACE, "c": LEVEL}),
    "logistic": ("1/(1 + np.exp(-{k}*(U - {a}))) - {c}", {"k": GENTLE, "a": PLACE, "c": LEVEL}),
    "spike": ("np.exp(-{k}*(U - {a})**2) - {c}", {"k": SHARP, "a": PLACE, "c": LEVEL}),
    "spike in time": (
        "np.exp(-{k}*(t - {a})**2) - {c} - 0.01*U",
        {"k": SHARP, "a": evenly(0.5, 5.5), "c": LEVEL},
    ),
    "resonance": ("1/(1 + {k}*(U - {a})**2) - {c}", {"k": SHARP, "a": PLACE, "c": LEVEL}),
    "sin": ("np.sin({k}*(U - {a})) - {c}", {"k": logarithmically(1.0, 20.0), "a": PLACE, "c": SIGNED}),
    "cos": ("np.cos({k}*(U - {a})) - {c}", {"k": logarithmically(1.0, 20.0), "a": PLACE, "c": SIGNED}),
    "arctan": ("np.arctan({k}*(U - {a})) - {c}", {"k": SHARP, "a": PLACE, "c": SIGNED}),
    "cbrt": ("np.cbrt(U - {a})", {"a": PLACE}),
    "cbrt shifted": ("np.cbrt({k}*(U - {a})) - {c}", {"k": SHARP, "a": PLACE, "c": SIGNED}),
    "cube": ("(U - {a})**3", {"a": PLACE}),
    "fifth power": ("(U - {a})**5", {"a": PLACE}),
    "signed square": ("(U - {a})*np.abs(U - {a})", {"a": PLACE}),
    "abs": ("np.abs(U - {a}) - {c}", {"a": PLACE, "c": logarithmically(1e-3, 0.9)}),
    "root": ("np.sqrt((U - {a})**2 + 1/{k}) - {c}", {"k": SHARP, "a": PLACE, "c": LEVEL}),
    "root of abs": ("np.sqrt(np.abs(U - {a})) - {c}", {"a": PLACE, "c": LEVEL}),
    "sign": ("np.sign(U - {a})", {"a": PLACE}),
    "where, levels": ("np.where(U > {a}, 1.0, -{c})", {"a": PLACE, "c": LEVEL}),
    "where, slopes": (
        "np.where(U > {a}, {k}*(U - {a}) + {c}, U - {a})",
        {"k": SHARP, "a": PLACE, "c": LEVEL},
    ),
    "power": ("np.abs(U)**1.5 - {c}", {"c": LEVEL}),
    "negative power": ("(1 + U*U)**-0.75 - {c}", {"c": LEVEL}),
    "maximum": ("np.maximum(U - {a}, V - {b})", {"a": PLACE, "b": PLACE}),
    "minimum": ("np.minimum({k}*(U - {a}), V - {b})", {"k": SHARP, "a": PLACE, "b": PLACE}),
    "product": ("(U - {a})*(V - {b})", {"a": PLACE, "b": PLACE}),
    "quotient": ("(U - {a})/(0.01 + {k}*V*V)", {"k": SHARP, "a": PLACE}),
    "quotient, spike": ("1/(1 + {k}*V*V) - {c}*(1 + 0.3*U)", {"k": SHARP, "c": evenly(0.1, 0.6)}),
}
# Functions that may be applied to a signal first; values stay of order one.
INNER: tuple[tuple[str, dict[str, Range]], ...] = (
    ("np.sin({m}*U)", {"m": evenly(0.5, 4.0)}),
    ("np.tanh({m}*U)", {"m": evenly(0.5, 5.0)}),
    ("(U*np.abs(U))", {}),
    ("(np.sqrt(1 + U*U) - 1)", {}),
    ("(2*U/(1 + U*U))", {}),
    ("np.arctan({m}*U)", {"m": evenly(0.5, 5.0)}),
    ("np.log1p(U*U)", {}),
    ("np.exp(-U*U)", {}),
    ("np.maximum(U, {m}*V)", {"m": evenly(-1.0, 1.0)}),
    ("(np.abs(U) - {m})", {"m": evenly(0.1, 1.0)}),
    ("(U + {m}*np.sin(2*t))", {"m": evenly(-0.5, 0.5)}),
    ("(U*U - {m})", {"m": evenly(0.2, 1.0)}),
    ("np.cbrt(U - {m})", {"m": PLACE}),
    ("(U + {m}*V*V)", {"m": evenly(-0.5, 0.5)}),
)
# Combinations of two guards into one.
PAIRS = ("({A})*({B})", "np.maximum({A}, {B})", "np.minimum({A}, {B})", "np.where(V > 0.1, {A}, {B})")


class RandomGuard(NamedTuple):
    """A guard as text, with its parameters, its family, and the names of the sharpness parameters."""

    text: str
    parameters: dict[str, Range]
    family: str
    sharpness: tuple[str, ...]
    direction: int
    # Whether the transition has a reset, which increments a counter and keeps the other states.
    counts: bool


class _Namer:
    def __init__(self, prefix: str) -> None:
        self.prefix, self.parameters, self.sharp = prefix, {}, []

    def named(self, text: str, ranges: dict[str, Range]) -> str:
        names = {}
        for name, how in ranges.items():
            full = f"{self.prefix}{len(self.parameters)}"
            self.parameters[full] = how
            names[name] = f"p.{full}"
            if name == "k":
                self.sharp.append(full)
        return text.format(**names)


def random_guard(rng: np.random.Generator, flow: Flow, prefix: str, family: str) -> RandomGuard:
    """A guard of a family on a flow, with randomly composed signals."""
    namer = _Namer(prefix)

    def signal() -> str:
        text = str(rng.choice(flow.signals))
        if rng.random() < 0.4:
            inner, ranges = INNER[rng.integers(len(INNER))]
            text = filled(namer.named(inner, ranges), text, str(rng.choice(flow.signals)))
        return text

    def one(name: str) -> str:
        text, ranges = FAMILIES[name]
        return filled(namer.named(text, ranges), signal(), signal())

    text = one(family)
    if rng.random() < 0.15:
        other = str(rng.choice(list(FAMILIES)))
        pair = str(rng.choice(PAIRS)).replace("{A}", text).replace("{B}", one(other))
        text, family = filled(pair, "", str(rng.choice(flow.signals))), "two in one"
    direction = int(rng.choice((-1, 0, 0, 1)))
    return RandomGuard(
        text, namer.parameters, family, tuple(namer.sharp), direction, bool(rng.random() < 0.3)
    )


def filled(text: str, first: str, second: str) -> str:
    """``text`` with its signals in place of U and V."""
    signals = {"U": f"({first})", "V": f"({second})"}
    return "".join(signals.get(letter, letter) for letter in text)
