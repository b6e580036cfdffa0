"""Loops for statements that repeat compute what the statements compute, and are as short as the pattern."""

import json
import re
from itertools import count
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid import HybridSystem, Mode
from hybrid.compiler.emit import emit
from hybrid.compiler.llvm.functions import compiled_part
from hybrid.compiler.llvm.wanted import SERIES_SIGNATURE
from hybrid.compiler.parts import FIELDS, PARTS, TANGENT_SERIES, VARIATIONAL
from hybrid.compiler.statements.code import at, call, do, either, get, less, loop, put, several, when, whole
from hybrid.compiler.statements.rolled import rolled
from hybrid.compiler.taylor.coefficients import OUT
from hybrid.kernels.types.codes import NARROW
from tests.hybrid.code import both, called, functions_in, interpreted

NUMBERS, LANES = ([f"{letter}{i}" for i in range(14)] for letter in "nl")
X, P = np.random.default_rng(20261127).normal(size=40), np.array([0.375])
# Columns of the matrix: single numbers and four numbers at once, at a number and counted from a variable.
# Row 1 is only read, as what convolutions read.
FROM_V, FOUR, FROM_W, END = 30, 64, 144, 240
ROWS = (2, 3, get("o"))


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
        row, column, shift = self.choice(*ROWS), self.varying(12), self.random.randrange(6)
        start = self.choice(None, None, get("v"), get(f"c{shift}"))
        return lambda i: (row, column(i) if start is None else start + column(i) if i % 2 else start + shift)

    def four(self):
        """The row and the first column of four numbers."""
        row, column, start = self.choice(*ROWS), self.varying(12), self.choice(FOUR, get("w"))
        return lambda i: (row, start + 4 * column(i))

    def constant(self):
        one = self.choice(-0.0, 1.5)
        return self.choice(
            lambda i: one, lambda i: self.choice(0.0, -0.0), lambda i: self.random.gauss(0.0, 1.0)
        )

    def number(self, depth):
        if not depth or not self.random.randrange(4):
            place, entry, k = self.varying(40), self.entry(), self.random.randrange(5)
            leaves = self.constant(), lambda i: k, lambda i: get("t"), lambda i: at("p", 0)
            return self.choice(
                *leaves,
                *[self.name(NUMBERS)] * 3,
                lambda i: at("x", place(i)),
                lambda i: at("out", *entry(i)),
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
        mark, left = next(self.fresh), self.varying(13)
        name, pair = self.name(NUMBERS), lambda i: several([get(LANES[left(i)]), get(LANES[left(i) + 1])])
        set_v = lambda i: put(get("v"), FROM_V + 1), lambda i: put(get("w"), FROM_W + 4)
        return self.choice(
            [lambda i: put(name(i), number(i))],
            [lambda i: put(at("out", *entry(i)), number(i))],
            [lambda i: put(get(LANES[left(i)]), lanes(i))],
            [lambda i: do("store", OUT, *four(i), lanes(i))],
            [lambda i: put(at("out", *entry(i)), number(i)), lambda i: do("store", OUT, *four(i), lanes(i))],
            [
                lambda i: put(
                    several([get(f"a{mark}_{i}"), get(f"b{mark}_{i}")]), several([lanes(i), number(i)])
                ),
                lambda i: do("store", OUT, *four(i), get(f"a{mark}_{i}") + get(f"b{mark}_{i}")),
            ],
            [
                lambda i: put(
                    pair(i),
                    call("convolved", OUT, 1, *map(several, ([left(i)], [FOUR + 4 * left(i)], [4])), 1),
                )
            ],
            # Variables that only one statement reads.
            [
                lambda i: put(get(f"u{mark}_{i}"), number(i)),
                lambda i: put(at("out", *entry(i)), get(f"u{mark}_{i}")),
            ],
            [lambda i: put(get("o"), self.choice(2, 3)), *set_v],
        )

    def row(self):
        names = several([get(self.choice(*NUMBERS)) if k % 3 else 0.5 for k in range(self.choice(3, 14))])
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
                inner, other, read = self.block(depth - 1), self.block(depth - 1), get(f"r{next(self.fresh)}")
                found += [put(read, self.number(1)(0)), put(at("out", *self.entry()(0)), read)]
                found.append(
                    self.choice(
                        when(less(read, 0.0), inner, other),
                        loop("g", 0, 3, [put(get("w"), FROM_W + 4 * get("g")), *inner]),
                        loop("o", 2, 4, inner),
                        self.row(),
                    )
                )
        return found

    def program(self):
        start = [whole(f"c{k}", self.random.randrange(10)) for k in range(6)]
        start += [put(get(name), place) for name, place in (("o", 2), ("v", FROM_V), ("w", FROM_W))]
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


seeds = st.integers(0, 2**32)


@settings(max_examples=200)
@given(seeds)
def test_random_statements_give_the_same_bits_in_loops(seed):
    program = Writer(seed).program()
    plain, in_loops = (interpreted([((), body)], SERIES_SIGNATURE) for body in (program, as_stored(program)))
    np.testing.assert_array_equal(bits(in_loops), bits(plain))


@settings(max_examples=15)
@given(seeds)
def test_so_does_their_machine_code(seed):
    program = Writer(seed).program()
    (_, plain), (_, in_loops) = both(program), both(as_stored(program))
    np.testing.assert_array_equal(bits(in_loops), bits(plain))


class Network:
    """Pendulums of which some pull at one another; the last node is the wall."""

    def __init__(self, n, edges, seed=None):
        self.n, (self.starts, self.ends) = n, np.array(edges).T
        m = len(edges)
        rng = np.random.default_rng(seed)
        self.k, self.a, self.b = (
            (np.full(m, 0.7), 0.4, 0.3) if seed is None else rng.uniform(0.2, 1.0, (3, m))
        )
        self.g = np.full(n, 1.25) if seed is None else rng.uniform(0.5, 1.5, n)
        self.x = np.random.default_rng(n).uniform(-0.7, 0.7, 2 * n)

    def added(self, forces):
        """The forces at the nodes, from those along the edges."""
        total = [0.0] * (self.n + 1)
        for i, j, force in zip(self.starts, self.ends, forces, strict=True):
            total[i], total[j] = total[i] + force, total[j] - force
        return total[:-1]

    def field(self, t, x, p):
        q, v = np.append(x[: self.n], 0.0), x[self.n :]
        d = q[self.ends] - q[self.starts]
        forces = self.added(self.k * d + self.a * d**2 + self.b * d**3)
        return np.concatenate([v, forces - self.g * np.sin(q[:-1]) - 0.125 * v])

    def system(self):
        return HybridSystem(state=2 * self.n, modes=[Mode("swing", self.field)])

    def jacobian(self, x):
        n, q = self.n, np.append(x[: self.n], 0.0)
        d, found = q[self.ends] - q[self.starts], np.zeros((n + 1, n + 1))
        for i, j, k in zip(
            self.starts, self.ends, self.k + 2.0 * self.a * d + 3.0 * self.b * d**2, strict=True
        ):
            found[[i, i, j, j], [i, j, i, j]] += [-k, k, k, -k]
        found = found[:n, :n] - np.diag(self.g * np.cos(q[:-1]))
        return np.block([[np.zeros((n, n)), np.eye(n)], [found, -0.125 * np.eye(n)]])

    def series(self, x, vectors, order):
        """Taylor coefficients of the solution and of tangent vectors, by products of power series."""
        n = self.n
        found = np.zeros((1 + len(vectors), order + 1, 2 * n))
        found[:, 0] = [x, *vectors]
        for o in range(order):
            q = np.concatenate([found[:, : o + 1, :n], np.zeros((len(found), o + 1, 1))], axis=2)
            d = q[..., self.ends] - q[..., self.starts]
            square, sine, cosine = times(d[0], d[0]), *sine_and_cosine(q[0, :, :-1])
            slope = 2.0 * self.a * d[0] + 3.0 * self.b * square
            forces = [self.k * d[0] + self.a * square + self.b * times(d[0], square)]
            forces += [self.k * each + times(slope, each) for each in d[1:]]
            pulls = [sine, *(times(cosine, each) for each in q[1:, :, :-1])]
            for each, force, pull in zip(found, forces, pulls, strict=True):
                rate = self.added(force[o]) - self.g * pull[o] - 0.125 * each[o, n:]
                each[o + 1] = np.concatenate([each[o, n:], rate]) / (o + 1)
        return found


def times(a, b):
    return np.array([sum(a[j] * b[o - j] for j in range(o + 1)) for o in range(len(a))])


def sine_and_cosine(q):
    s, c = np.zeros((2, *q.shape))
    s[0], c[0] = np.sin(q[0]), np.cos(q[0])
    for o in range(1, len(q)):
        s[o] = sum(j * q[j] * c[o - j] for j in range(1, o + 1)) / o
        c[o] = -sum(j * q[j] * s[o - j] for j in range(1, o + 1)) / o
    return s, c


def chain(n):
    return [(i, i + 1) for i in range(n)]


def ring(n):
    return [(i, (i + 1) % n) for i in range(n)]


def lattice(n):
    width = round(n**0.5)
    right = [(i, i + 1) for i in range(n) if (i + 1) % width]
    return [*right, *((i, i + width) for i in range(n - width)), (0, n)]


@pytest.mark.parametrize(("shape", "seed"), [(chain, None), (chain, 1), (ring, None), (lattice, 2)])
def test_networks_of_two_hundred_states(shape, seed):
    network = Network(100, shape(100), seed)
    n, x, order = 200, network.x, 6
    vectors = np.random.default_rng(5).normal(size=(5, n))
    emitted, jacobian = emit(network.system()), network.jacobian(x)
    y = np.concatenate([x, *vectors])
    [propagator], start = emitted.propagators, emitted.tangent_start
    stride = propagator.series.tangent_columns
    for part in (FIELDS, VARIATIONAL, TANGENT_SERIES):
        compiled = {name: called(each) for name, each in compiled_part(emitted.texts[part], part, {}).items()}
        for run in (functions_in(emitted.texts[part]), compiled):
            if part == FIELDS:
                out, slopes = np.zeros(n), np.zeros((n, n + 1))
                run["field"](0, 0.0, x, np.zeros(0), out)
                run["field_jacobian"](0, 0.0, x, np.zeros(0), slopes)
                np.testing.assert_allclose(out, network.field(0.0, x, None), rtol=1e-13, atol=1e-14)
                np.testing.assert_allclose(slopes[:, :n], jacobian, rtol=1e-13, atol=1e-14)
            elif part == VARIATIONAL:
                out = np.zeros(len(y) + 1)
                run["variational_field"](0, 0.0, y, np.zeros(0), out)
                wanted = [network.field(0.0, x, None), *(jacobian @ each for each in vectors)]
                np.testing.assert_allclose(out[:-1], np.concatenate(wanted), rtol=1e-12, atol=1e-13)
                assert out[-1] == pytest.approx(np.trace(jacobian), rel=1e-12)
            else:
                out = np.full((order + 3, start + 2 * stride), np.nan)
                [series] = (run[name] for name in PARTS[part])
                series(0, 0.0, y, np.zeros(0), order, out)
                wanted = network.series(x, vectors, order)
                columns = [
                    start + i // NARROW * stride + NARROW * np.arange(n) + i % NARROW for i in range(5)
                ]
                found = [out[: order + 1, each] for each in (np.arange(n), *columns)]
                np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-13)


def shapes_of(system):
    """The code without its numbers: lists are as long as one number."""
    numbers = r"-?\d+(\.\d+)?(e-?\d+)?"
    return {part: re.sub(rf"{numbers}(,{numbers})*", "0", text) for part, text in emit(system).texts.items()}


@pytest.mark.parametrize("seed", [None, 3], ids=["equal elements", "random elements"])
def test_a_long_chain_is_as_much_code_as_a_short_one(seed):
    short, long = (shapes_of(Network(n, chain(n), seed).system()) for n in (100, 200))
    assert short == long


def test_a_recursion_stays_as_it_is():
    """Each value waits for the one before: only independent factors could come from a loop."""
    names = [get(f"y{i}") for i in range(30)]
    body = [put(names[0], at("x", 0)), *(put(names[i], names[i - 1] * at("x", i)) for i in range(1, 30))]
    body += [put(at("out", 0, i), name) for i, name in enumerate(names)]
    for run in both(as_stored(body)):
        out = np.zeros((1, 30))
        run(0, 0.0, X, P, 0, out)
        np.testing.assert_allclose(out[0], np.cumprod(X[:30]), rtol=1e-14)
