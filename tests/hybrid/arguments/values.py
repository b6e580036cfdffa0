"""Values that an argument of a kind must refuse."""

import math
from fractions import Fraction

import numpy as np

import hybrid
import models
from hybrid import Guard, HybridSystem

BALL, OSCILLATOR = models.bouncing_ball(), models.impact_oscillator()
PERIOD = OSCILLATOR.forcing_period()


class Odd:
    """An object that no function accepts."""

    def __repr__(self):
        return "<odd>"


class Hostile:
    """An object that raises an error of its own wherever it is converted or iterated."""

    def _raise(self, *arguments, **options):
        raise RuntimeError("converted")

    __array__ = __float__ = __iter__ = __len__ = __index__ = _raise

    def __repr__(self):
        return "<hostile>"


TEXTS = ["a", "1", b"1"]
# NumPy counts durations among its integers.
DURATIONS = [np.timedelta64(2), np.timedelta64(2, "s")]
NO_NUMBERS = [
    *DURATIONS,
    *TEXTS,
    True,
    np.bool_(True),
    1j,
    np.array([1.0, 2.0]),
    np.array([None, "a"]),
    [1.0],
    Odd(),
    {},
]
INFINITE = [math.nan, math.inf, -math.inf, 10**400]
NUMBER = [None, *NO_NUMBERS, *INFINITE]
OPTIONAL_NUMBER = NUMBER[1:]
POSITIVE = [*NUMBER, 0.0, -1.0, -1e300]
OPTIONAL_POSITIVE = POSITIVE[1:]
# Infinity is allowed.
LIMIT = [None, *NO_NUMBERS, math.nan, -math.inf, -1.0, 0.0]
NOT_NEGATIVE = [*NUMBER, -1.0]
COUNT = [*NUMBER, Hostile(), 2.7, 3.0, 1e300, -1, 10**30, Fraction(5, 2)]
FLAG = [None, "yes", 1, 0, 1.0, math.nan, [True], np.array([True]), Odd()]
NUMBERS = [
    None,
    "a",
    "10",
    True,
    [True, 0.5],
    ["0.5", "0"],
    [1j, 0.0],
    [[1.0], [2.0, 3.0]],
    {},
    Odd(),
    [None, 1.0],
]
NUMBERS += [Hostile(), [np.timedelta64(2), 0.0], np.array([1, 2], "m8"), np.array([1, 2], "m8[ns]")]
NUMBERS += [bytearray(b"ab"), np.ma.array([1.0, 2.0], mask=[False, True]), np.ma.masked]
NUMBERS += [np.array(["a", "b"]), np.array([None, Odd()]), np.array([True, False]), np.array([1j, 2j])]
STATE = [
    *NUMBERS,
    (0.5,),
    (0.5, 0.0, 0.0),
    0.5,
    [[0.5, 0.0]],
    (math.nan, 0.0),
    (0.5, math.inf),
    (10**400, 0.0),
]
SPAN = [
    None,
    "01",
    "a",
    1.0,
    (0.0,),
    (0.0, 1.0, 2.0),
    (1.0, 0.0),
    ("0", "1"),
    (0.0, math.nan),
    (0.0, math.inf),
    (0.0, np.timedelta64(1)),
    Hostile(),
]
SPAN += [b"ab", bytearray(b"ab"), {0.0, 1.0}, np.ma.array([0.0, 1.0], mask=[False, True])]
SPAN += [(False, True), (0.0, 1j), np.array([None, 1.0]), (0.0, None), Odd()]
SAMPLES = [*NUMBERS[1:], 0.5, [[0.1, 0.2]], [0.5, 0.1], [-1.0], [0.1, math.nan], [2.0], [math.inf]]
TANGENT = [
    *NUMBERS[1:3],
    *NUMBERS[4:],
    1.0,
    np.eye(3),
    np.zeros((2, 0)),
    [math.nan, 0.0],
    np.zeros((2, 2, 2)),
]
NAME = ["nope", 3, 1.5, True, math.nan, [1], np.array(["a", "b"]), Odd()]
ANGLES = [3, "a", [1.0], {"z": 1.0}, {3: 1.0}, {"q": 0.0}, {"q": -1.0}, {"q": "1"}, {"q": np.inf}]
UNITS = [[1], "a", 3, {"nope": "m"}, {3: "m"}, {"q": 3}, {"q": None}, Odd()]
TEXT = [None, 3, True, [1], Odd()]
SYSTEM = [None, "a", 3, models.bouncing_ball, HybridSystem, [BALL], Odd()]
EMPTY = ["", [], (), np.array([]), np.array(["1", "2"]), np.ma.masked]
PARAMETERS = [
    *EMPTY,
    [1],
    "a",
    3,
    True,
    ["c"],
    {"nope": 1.0},
    {3: 1.0},
    Odd(),
    *({"c": value} for value in NUMBER),
]
OF_BALL = [
    *EMPTY,
    [1],
    "a",
    3,
    True,
    ["e"],
    {"nope": 1.0},
    {3: 1.0},
    Odd(),
    *({"e": value} for value in NUMBER),
]
SOLVER = ["DOP853", hybrid.DOP853, 3, 0, False, "", [hybrid.DOP853()], Odd()]
FUNCTION = ["a", 3, True, [1], np.array([1.0])]
OUTPUTS = [
    *FUNCTION,
    Odd(),
    {"f": 3},
    {"f": "a"},
    {"f": {}},
    {"f": {"a": 3}},
    {"f": {3: abs}},
    {"": abs},
    {3: abs},
]
OUTPUT_NAMES = [None, "a", 3, True, ["nope"], [3], [None], [[1]], Odd(), Hostile()]
QUANTITY = [None, "1a", True, [1, None], 1j, Odd(), math.nan, -1.0, 0.0]
GUARD = [None, "a", 3, lambda t, x, p: x.q, Guard, Odd()]
LIST = [Hostile(), None, "a", 3, True, math.nan, Odd()]
AXES = ["a", 3, math.nan, True, Odd()]
RANGES = [
    [1],
    "a",
    3,
    {"nope": 1.0},
    *({"q": bad} for bad in ("a", None, math.nan, True, (2.0, 1.0), (0.0,), 1j)),
]
EXECUTOR = [0, -1, 1.5, True, "a", math.nan, Odd(), {}]
COMPONENT = [np.timedelta64(0), "nope", 2, -3, 1.5, True, math.nan, [0], Odd()]
LABELS = ["a", 3, ("a",), math.nan]

RUN = {"system": SYSTEM, "x0": STATE, "mode": NAME, "parameters": PARAMETERS, "solver": SOLVER}
BIG_TIMES = [1e300, -1e300, 1e17]
EXPONENTS = {
    **RUN,
    "intervals": [0, *COUNT],
    "interval": [*OPTIONAL_POSITIVE, 1e-300, 1e308],
    "transient": COUNT,
    "t0": [*NUMBER, *BIG_TIMES],
    "progress": FLAG,
}


def call(function, *positional, **options):
    """A valid call, of which the test replaces one argument at a time."""
    return function, positional, options
