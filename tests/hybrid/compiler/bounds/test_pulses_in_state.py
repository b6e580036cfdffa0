"""Narrow pulses of a field in the state: bumps that a mass passes in a small part of a step."""

from fractions import Fraction
from functools import cache

import attrs
import numpy as np
import pytest
from scipy.integrate import quad

from hybrid import DOP853, HybridSystem, Mode, RadauIIA, Taylor, Tsit5, simulate
from hybrid.compiler.bounds.forcing import Forcing, forcings
from hybrid.expression.operations import Absolute, Cosh, Exp, Log, Maximum, Minimum, Several, Sin, Tanh
from hybrid.expression.tracing import model_symbols
from hybrid.kernels.types.codes import ARGUMENTS, TERMS

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}
# Bumps of the height and width one, and their integrals from one side to the other.
BUMPS = {
    "gauss": (lambda z: np.exp(-z * z), np.sqrt(np.pi)),
    "sech": (lambda z: 1 / np.cosh(z), np.pi),
    "square of sech": (lambda z: 1 / np.cosh(z) ** 2, 2.0),
    "two switches": (lambda z: 0.5 * (np.tanh(z + 1) - np.tanh(z - 1)), 2.0),
    "two logistics": (lambda z: 1 / (1 + np.exp(-z - 2)) - 1 / (1 + np.exp(2 - z)), 4.0),
    "power": (lambda z: 10.0 ** (-z * z), np.sqrt(np.pi / np.log(10))),
}


@cache
def slope(bump):
    """A mass in a plane potential with a narrow step at ``a``, of the height ``jump``."""
    function, area = BUMPS[bump]
    return HybridSystem(
        state=("q", "v"),
        parameters={"a": 1.0, "w": 1e-3, "jump": 0.5, "g": 0.1},
        modes=[
            Mode(
                "m",
                lambda t, x, p: (x.v, -p.g * x.q - p.jump / (p.w * area) * function((x.q - p.a) / p.w)),
            )
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("bump", BUMPS)
def test_a_narrow_bump_of_the_field_is_not_stepped_over(bump, solver):
    """The energy changes by the height of the step, however narrow the bump is."""
    random = np.random.default_rng(len(bump))
    for width in (1e-2, 1e-3, 1e-4):
        speed, a, jump = random.uniform(1.2, 2.0), random.uniform(0.3, 1.0), random.uniform(0.1, 0.5)
        parameters = {"a": a, "w": width, "jump": jump, "g": 0.1}
        arc = simulate(
            slope(bump),
            (-0.5, speed),
            (0.0, 2.0 / speed + 1.5),
            parameters=parameters,
            solver=SOLVERS[solver],
        )
        q, v = arc.x[-1]
        assert arc.status.ok
        assert q > a + 40 * width
        lost = 0.5 * (speed**2 - v**2) + 0.05 * (0.25 - q * q)
        assert np.isclose(lost, jump, rtol=0, atol=1e-8)


# Bumps of the height one without exponentials, and their integrals from 0 to z.
ALGEBRAIC = {
    "square of a resonance": (
        lambda z: 1 / (1 + z**2) ** 2,
        lambda z: 0.5 * (z / (1 + z * z) + np.arctan(z)),
    ),
    "sixth power": (
        lambda z: z**2 / (1 + z**6),
        lambda z: np.arctan(z**3) / 3,
    ),
    "tent": (
        lambda z: np.maximum(1 - np.abs(z), 0),
        lambda z: np.sign(z) * (0.5 - 0.5 * max(1 - abs(z), 0) ** 2),
    ),
    "box": (lambda z: np.where(np.abs(z) < 1, 1.0, 0.0), lambda z: np.clip(z, -1, 1)),
    "two signs": (lambda z: 0.5 * (np.sign(z + 1) - np.sign(z - 1)), lambda z: np.clip(z, -1, 1)),
}


@cache
def barrier(bump):
    function, _ = ALGEBRAIC[bump]
    return HybridSystem(
        state=("q", "v"),
        parameters={"a": 1.0, "w": 1e-3, "h": 0.5},
        modes=[Mode("m", lambda t, x, p: (x.v, -0.1 * x.q - p.h / p.w * function((x.q - p.a) / p.w)))],
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("bump", ALGEBRAIC)
def test_a_narrow_bump_without_exponentials_is_not_stepped_over(bump, solver):
    """The energy is conserved: tails of a bump, a kink or a jump tell no solver where it is."""
    random = np.random.default_rng(len(bump))
    potential = ALGEBRAIC[bump][1]
    for width in (1e-2, 1e-4, 1e-6):
        speed, a, h = random.uniform(1.6, 2.0), random.uniform(0.3, 1.0), random.uniform(0.1, 0.3)
        arc = simulate(
            barrier(bump),
            (-0.5, speed),
            (0.0, 2.0 / speed + 1.5),
            parameters={"a": a, "w": width, "h": h},
            solver=SOLVERS[solver],
        )
        energy = [
            0.5 * v * v + 0.05 * q * q + h * float(potential((q - a) / width)) for q, v in arc.x[[0, -1]]
        ]
        assert arc.status.ok
        assert arc.x[-1, 0] > a + 0.1
        assert np.isclose(*energy, rtol=0, atol=1e-7)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("size", [1e-1, 1e-3, 1e-5])
def test_a_mass_does_not_pass_the_core_of_a_steep_repulsion(size, solver):
    """It turns round in ``4 ((size/q)**12 - (size/q)**6)``, which is all rounding at the start."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"s": 1.0},
        modes=[Mode("m", lambda t, x, p: (x.v, 24 * (2 * (p.s / x.q) ** 12 - (p.s / x.q) ** 6) / x.q))],
    )
    arc = simulate(system, (1.0, -1.0), (0.0, 3.0), parameters={"s": size}, solver=SOLVERS[solver])
    assert arc.status.ok
    assert arc.x[-1, 1] > 0.9
    energy = [0.5 * v * v + 4 * ((size / q) ** 12 - (size / q) ** 6) for q, v in arc.x[[0, -1]]]
    assert np.isclose(*energy, rtol=0, atol=1e-8)


@cache
def bumper():
    """A mass on a spring of stiffness one that just reaches another one, of stiffness ``k``, at ``wall``."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"k": 1e4, "wall": 1.0},
        modes=[Mode("m", lambda t, x, p: (x.v, -x.q - p.k * np.maximum(x.q - p.wall, 0.0)))],
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("depth", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
def test_a_shallow_contact_is_not_stepped_over(depth, solver):
    """In contact the mass swings, much faster, about another place, and leaves with the speed it came with.

    Wherever the steps begin: a stage of a method may lie in the contact while the solution does not, or the
    solution while no stage does.
    """
    tolerance = {"DOP853": (1e-6, 1e-9), "Tsit5": (1e-6,), "RadauIIA": (1e-6,)}.get(solver, (1e-9,))
    wall, before = 1.0 - depth, np.arcsin(1.0 - depth)
    for rtol in tolerance:
        for start in np.linspace(-3.0, 0.5, 8):
            for k in (1e4, 1e6):
                fast, center = np.sqrt(1 + k), wall / (1 + k)
                lasts = 2 * np.arctan(np.cos(before) / fast / center) / fast
                end = np.pi - before + (2.5 - lasts - before)
                arc = simulate(
                    bumper(),
                    (np.sin(start), np.cos(start)),
                    (start, 2.5),
                    parameters={"k": k, "wall": wall},
                    solver=attrs.evolve(SOLVERS[solver], rtol=rtol, atol=1e-2 * rtol),
                )
                assert arc.status.ok
                # The impulse is as sensitive to the depth as the square root of that.
                error = 200 * rtol * max(1.0, 0.1 * fast * np.sqrt(depth), 0.01 / np.sqrt(depth))
                np.testing.assert_allclose(arc.x[-1], [np.sin(end), np.cos(end)], rtol=0, atol=error)


@pytest.mark.parametrize("bump", BUMPS)
def test_the_integrals_of_the_bumps(bump):
    function, area = BUMPS[bump]
    assert np.isclose(quad(function, -30, 30, points=[-2, 0, 2])[0], area, rtol=1e-9)


def test_a_field_whose_series_overflows_is_taken_on_by_another_method():
    """Far from its pulse ``1/cosh`` has a series whose terms overflow one after the other."""
    for start in np.linspace(-0.24, -0.12, 13):
        parameters = {"a": 0.5, "w": 1e-3, "jump": 0.1, "g": 1.0}
        arc = simulate(slope("sech"), (start, 1.0), (0.0, 1.0), parameters=parameters)
        exact = simulate(slope("sech"), (start, 1.0), (0.0, 1.0), parameters=parameters, solver=DOP853())
        assert arc.status.ok
        assert arc.steps < 100
        assert np.allclose(arc.x[-1], exact.x[-1], rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("term", "arguments"),
    [
        (lambda x, y: Exp(-(x**2)) * y, lambda x, y: [-(x**2)]),
        (lambda x, y: 1 / Cosh(x - 2), lambda x, y: [x - 2]),
        (lambda x, y: Tanh(x) ** 2, lambda x, y: [Maximum(Minimum(x, 20), -20)]),
        (lambda x, y: 2 ** (-(x**2)), lambda x, y: [-(x**2) * Log(2)]),
        # Exponentials of affine functions are no pulses.
        (lambda x, y: Exp(x - y) * Exp(-x), None),
        (lambda x, y: x**3 * Sin(y), None),
        # The tails of gravity show, those of a dipole do not.
        (lambda x, y: x * (x**2 + y**2) ** Fraction(-3, 2), None),
        (
            lambda x, y: (x**2 + y**2) ** Fraction(-3, 2),
            lambda x, y: [-Fraction(3, 2) * Log(Absolute(x**2 + y**2))],
        ),
    ],
)
def test_which_terms_may_be_pulses(term, arguments):
    symbols = model_symbols(2, 1)
    x, y = symbols.x
    found = [each for each in forcings([y, x + term(x, y)], [], symbols) if each.expression is not None]
    if arguments is None:
        assert found == []
    else:
        assert found[0] == Forcing(Several(*arguments(x, y)), -1, ARGUMENTS)
        assert found[1:] == [Forcing(term(x, y), 1, TERMS)]
