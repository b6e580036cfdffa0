"""Loops for statements that repeat compute what the statements compute, and are as short as the pattern."""

import json
from itertools import count
from random import Random

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid.compiler.statements.code import at, call, do, either, get, less, loop, put, several, when, whole
from hybrid.compiler.statements.rolled import rolled
from hybrid.compiler.taylor.series import OUT
from tests.hybrid.code import both

NUMBERS, LANES = ([f"{letter}{i}" for i in range(14)] for letter in "nl")
X, P = np.random.default_rng(20261127).normal(size=40), np.array([0.375])
# Columns of the matrix: single numbers and four numbers at once, at a number and counted from a variable.
# Row 1 is only read, as what convolutions read.
SINGLE, FROM_V, FOUR, FROM_W, END = 0, 30, 64, 144, 240
ROWS = (0, 2, 3, get("o"))


class Writer:
    """Writes random statements; a pattern is a function of the turn, and is written many times."""

    def __init__(self, seed):
        self.random, self.fresh = Random(seed), count()

    def choice(self, *several):
        return self.random.choice(several)

    def varying(self, size):
        """Whole numbers below a size: one for all turns, one per turn, or any."""
        first = self.random.randrange(size)
        return self.choice(
            lambda i: first, lambda i: (first + i) % size, lambda i: self.random.randrange(size)
        )

    def name(self, names):
        place = self.varying(len(names))
        return lambda i: get(names[place(i)])

    def entry(self):
        """The row and the column of a single number."""
        row, column, shift = self.choice(*ROWS), self.varying(20), self.random.randrange(6)
        start = self.choice(None, None, get("v"), get(f"c{shift}"))
        return lambda i: (row, column(i) if start is None else start + column(i) if i % 2 else start + shift)

    def four(self):
        """The row and the first column of four numbers."""
        row, column, start = self.choice(*ROWS), self.varying(20), self.choice(FOUR, get("w"))
        return lambda i: (row, start + 4 * column(i))

    def constant(self):
        one = self.choice(0.0, -0.0, 1.5)
        return self.choice(
            lambda i: one, lambda i: self.choice(0.0, -0.0), lambda i: self.random.gauss(0.0, 1.0)
        )

    def number(self, depth):
        if not depth or not self.random.randrange(4):
            place, entry, k = self.varying(40), self.entry(), self.random.randrange(5)
            leaves = self.constant(), lambda i: k, lambda i: get("t"), lambda i: at("p", 0)
            return self.choice(
                *leaves, *[self.name(NUMBERS)] * 3, lambda i: at("x", place(i)), lambda i: at("out", *entry(i))
            )
        a, b = self.number(depth - 1), self.number(depth - 1)
        return self.choice(
            *(lambda i, sign=sign: call(sign, a(i), b(i)) for sign in "+-*"),
            lambda i: a(i) / (1.0 + call("abs", b(i))),
            lambda i: call("neg", a(i)),
            lambda i: call("max", a(i), b(i)),
            lambda i: either(less(a(i), b(i)), b(i), a(i)),
        )

    def lanes(self, depth):
        if not depth or not self.random.randrange(3):
            place, number = self.four(), self.number(1)
            return self.choice(
                self.name(LANES),
                lambda i: call("load", OUT, *place(i)),
                lambda i: call("four_times", 1.0 * number(i)),
            )
        a, b, number = self.lanes(depth - 1), self.lanes(depth - 1), self.number(1)
        signs = [lambda i, sign=sign: call(sign, a(i), b(i)) for sign in "+-*"]
        return self.choice(*signs, lambda i: number(i) * a(i), lambda i: -a(i))

    def patterns(self):
        """Some patterns that belong together."""
        entry, four, number, lanes = self.entry(), self.four(), self.number(3), self.lanes(2)
        other, mark, lane, left = self.number(1), next(self.fresh), self.varying(12), self.varying(20)
        name, many = self.name(NUMBERS), self.random.sample(range(14), 2)
        set_v = [lambda i, v=v, at=at: put(get(v), at) for v, at in (("v", FROM_V + 1), ("w", FROM_W + 4))]
        return self.choice(
            [lambda i: put(name(i), number(i))],
            [lambda i: put(at("out", *entry(i)), number(i))],
            [lambda i: put(get(LANES[left(i) % 14]), lanes(i))],
            [lambda i: do("store", OUT, *four(i), lanes(i))],
            [lambda i: put(several([get(NUMBERS[k]) for k in many]), several([number(i), other(i)]))],
            [
                lambda i: put(
                    several([get(LANES[lane(i)]), get(LANES[lane(i) + 1])]),
                    call("convolved", OUT, 2, 1, left(i), FOUR + 4 * left(i), 8, 8),
                )
            ],
            # Variables that only one statement reads.
            [
                lambda i: put(get(f"u{mark}_{i}"), number(i)),
                lambda i: put(at("out", *entry(i)), get(f"u{mark}_{i}")),
            ],
            [lambda i: put(get("o"), self.choice(0, 2, 3)), *set_v],
        )

    def row(self):
        values = [self.number(1) for _ in range(self.choice(3, 14))]
        names = several([get(self.choice(*NUMBERS)) if k % 3 else 0.5 for k in range(len(values))])
        return do("store_row", OUT, self.choice(*ROWS), self.random.randrange(4), names)

    def block(self, depth):
        found = []
        for _ in range(self.random.randrange(1, 6)):
            patterns, turns = self.patterns(), range(self.choice(1, 3, 13, 16))
            if self.choice(True, False):
                found += [pattern(i) for pattern in patterns for i in turns]
            else:
                found += [pattern(i) for i in turns for pattern in patterns]
            if depth and not self.random.randrange(3):
                condition, inner = less(self.number(1)(0), get(self.choice(*NUMBERS))), self.block(depth - 1)
                found.append(
                    self.choice(
                        when(condition, inner, self.block(depth - 1)),
                        loop("g", 0, 3, [put(get("w"), FROM_W + 4 * get("g")), *inner]),
                        loop("o", 2, 4, inner),
                        self.row(),
                    )
                )
        return found

    def program(self):
        start = [whole(f"c{k}", self.random.randrange(10)) for k in range(6)]
        start += [put(get(name), place) for name, place in (("o", 0), ("v", FROM_V), ("w", FROM_W))]
        start += [put(get(name), at("x", i)) for i, name in enumerate(NUMBERS)]
        start += [put(get(name), call("load", OUT, 0, FOUR + 4 * i)) for i, name in enumerate(LANES)]
        end = [put(at("out", 4, i), get(name)) for i, name in enumerate(NUMBERS)]
        end += [do("store", OUT, 4, FOUR + 4 * i, get(name)) for i, name in enumerate(LANES)]
        return [*start, *self.block(2), *end]


def bits(run):
    """The bits of the matrix after a run; those of a nan may differ."""
    matrix = np.random.default_rng(1).normal(size=(5, END))
    run(0, 0.25, X, P, 3, matrix)
    matrix[np.isnan(matrix)] = np.nan
    return matrix.view(np.int64)


def as_stored(statements):
    return json.loads(json.dumps(rolled(statements)))


@settings(max_examples=40)
@given(st.integers(0, 2**32))
def test_random_statements_give_the_same_bits_in_loops(seed):
    program = Writer(seed).program()
    for plain, in_loops in zip(both(program), both(as_stored(program)), strict=True):
        np.testing.assert_array_equal(bits(in_loops), bits(plain))
