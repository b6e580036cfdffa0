"""Saltation matrices of guards whose gradient does not show their surface, but whose plain form does."""

from functools import cache

import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    Taylor,
    Transition,
    saltation_matrix,
    simulate,
)
from lyapunov import lyapunov_spectrum

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "RadauIIA": RadauIIA()}

# Guards with the surface ``e = 0``, and the same sides.
FORMS = {
    "third power": lambda e, t, x: e**3,
    "fifth power": lambda e, t, x: e**5,
    "cubic root": lambda e, t, x: np.cbrt(e),
    "square root": lambda e, t, x: np.sign(e) * np.sqrt(np.abs(e)),
    "tenth of a power": lambda e, t, x: np.sign(e) * np.abs(e) ** 0.1,
    "parabolas": lambda e, t, x: e * np.abs(e),
    "pole": lambda e, t, x: 1 / e,
    "kink": lambda e, t, x: np.where(e > 0, e, 7 * e),
    "sign": lambda e, t, x: np.sign(e),
    "steps": lambda e, t, x: np.where(e > 0, 2.0, -0.3),
    "jump from a slope": lambda e, t, x: np.where(e > 0, 1 + x.q**2, -1.0),
    "jump between like slopes": lambda e, t, x: np.where(e > 0, 2 + np.sin(x.z), -2 + np.sin(x.z)),
    "product": lambda e, t, x: e**3 * (2 + np.sin(x.v)),
    "smooth": lambda e, t, x: np.expm1(e) * (2 + np.sin(t)),
}
SURFACES = {
    "plane": lambda t, x: x.q + 0.2 * x.z - 0.3,
    "bent": lambda t, x: x.q - 0.2 + 0.03 * x.v**2 + 0.1 * x.z * x.q,
    "moving": lambda t, x: x.q - 0.3 * np.sin(1.3 * t) - 0.1 * x.z,
}


@cache
def machine(place, form=lambda e, t, x: e):
    impact = Reset(lambda t, x, p: (x.q, -0.8 * x.v + 0.05 * x.z, x.z + 0.1 * x.q))
    return HybridSystem(
        state=("q", "v", "z"),
        modes=[
            Mode("m", lambda t, x, p: (x.v, -x.q - 0.1 * x.z + 0.3 * np.cos(t), 0.5 - 0.2 * x.z + 0.1 * x.v))
        ],
        transitions=[
            Transition("m", "m", Guard(lambda t, x, p: form(place(t, x), t, x), +1), impact, name="hit")
        ],
    )


@cache
def by_gradient(place, solver):
    return simulate(
        machine(SURFACES[place]), (-1.0, 0.2, 0.1), (0.0, 8.0), tangent=True, solver=SOLVERS[solver]
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("place", SURFACES)
def test_the_fundamental_matrix_is_that_of_the_surface(place, form, solver):
    wanted = by_gradient(place, solver)
    options = {"solver": SOLVERS[solver], "mode": "m"}
    arc = simulate(
        machine(SURFACES[place], FORMS[form]), (-1.0, 0.2, 0.1), (0.0, 8.0), tangent=True, **options
    )
    assert arc.status.ok
    assert len(arc.jumps) == len(wanted.jumps) > 1
    assert {jump.kind for jump in arc.jumps} == {"transverse"}
    np.testing.assert_allclose(arc.fundamental, wanted.fundamental, rtol=0, atol=1e-8)
    # The matrices of a run without tangent vectors are computed when they are asked for.
    bare = simulate(machine(SURFACES[place], FORMS[form]), (-1.0, 0.2, 0.1), (0.0, 8.0), **options)
    assert {jump.kind for jump in bare.jumps} == {"transverse"}
    for one, other in zip(bare.jumps, wanted.jumps, strict=True):
        np.testing.assert_allclose(one.saltation, other.saltation, rtol=0, atol=1e-8)


@pytest.mark.parametrize("form", sorted(FORMS.keys() - {"smooth"}))
def test_exponents_of_an_impact_oscillator(form):
    """They do not depend on how the wall is written."""

    def oscillator(form):
        hit = Reset(lambda t, x, p: (x.q, -0.7 * x.v, x.z))
        return HybridSystem(
            state=("q", "v", "z"),
            modes=[Mode("m", lambda t, x, p: (x.v, -x.q - 0.1 * x.v + 2.0 * np.cos(t), x.q - x.z))],
            transitions=[Transition("m", "m", Guard(lambda t, x, p: form(x.q - 0.5, t, x), +1), hit)],
            period=2 * np.pi,
        )

    options = {"intervals": 20, "transient": 10, "mode": "m"}
    wanted = lyapunov_spectrum(oscillator(lambda e, t, x: e), (0.0, 0.0, 0.0), **options)
    found = lyapunov_spectrum(oscillator(FORMS[form]), (0.0, 0.0, 0.0), **options)
    assert found.status.ok
    np.testing.assert_allclose(found.exponents, wanted.exponents, rtol=0, atol=1e-7)


@pytest.mark.parametrize("form", ["third power", "cubic root", "sign", "steps"])
def test_at_a_point_on_the_surface(form):
    x = (0.28, 1.3, 0.1)
    wanted = saltation_matrix(machine(SURFACES["plane"]), "hit", 1.0, x)
    found = saltation_matrix(machine(SURFACES["plane"], FORMS[form]), "hit", 1.0, x)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(
    "form",
    [
        lambda e, t, x: np.where(e > 0, 3 + x.v, -3 + 0.1 * x.v),
        lambda e, t, x: np.sign(e) * (2 + 0.1 * x.z) + 0.2 * np.sin(t),
    ],
)
def test_a_jump_that_has_no_plain_form_has_no_matrix(form, solver):
    wanted = by_gradient("plane", solver)
    arc = simulate(
        machine(SURFACES["plane"], form),
        (-1.0, 0.2, 0.1),
        (0.0, 8.0),
        tangent=True,
        solver=SOLVERS[solver],
    )
    assert not arc.status.ok
    assert "saltation matrix" in arc.status.message
    assert arc.jumps[0].t == pytest.approx(wanted.jumps[0].t, rel=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("depth", [0.0, 1e-14, 1e-13])
def test_a_dip_of_a_guard_that_is_not_affine_still_grazes(depth, solver):
    """``sinh(q)`` with ``q = (t - 1)^2 - depth``: there is no surface to be found at a touch."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("fall", lambda t, x, p: (x.v, 2.0 + 0 * x.v))],
        transitions=[
            Transition(
                "fall",
                "fall",
                Guard(lambda t, x, p: np.sinh(x.q), -1),
                Reset(lambda t, x, p: (x.q, x.v + 1.0)),
            )
        ],
    )
    arc = simulate(system, (1.0 - depth, -2.0), (0.0, 1.5), tangent=True, solver=SOLVERS[solver])
    assert {jump.kind for jump in arc.jumps} <= {"grazing"}
    assert len(arc.jumps) + len(arc.grazings) == 1
