"""Saltation matrices of guards whose gradient does not show their surface: flat, vertical, jumping ones."""

from functools import cache
from types import SimpleNamespace

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
from hybrid.kernels.events import surface
from lyapunov import lyapunov_spectrum
from tests.hybrid.kernels.plain import plain

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
    "staircase": lambda e, t, x: np.floor(e / 5.0) + 0.5,
    "switch": lambda e, t, x: np.tanh(1e12 * e),
    "jump of other terms": lambda e, t, x: np.where(e > 0, 3 + x.v, -3 + 0.1 * x.v),
    "jump from a slope": lambda e, t, x: np.where(e > 0, 1 + x.q**2, -1.0),
    "jump between like slopes": lambda e, t, x: np.where(e > 0, 2 + np.sin(x.z), -2 + np.sin(x.z)),
    "jump in time": lambda e, t, x: np.sign(e) * (2 + x.q**2 + 0.1 * x.z) + 0.2 * np.sin(t),
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


@pytest.mark.parametrize("form", sorted(FORMS.keys() - {"jump in time", "smooth"}))
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


@pytest.mark.parametrize("form", ["third power", "cubic root", "sign", "jump of other terms"])
def test_at_a_point_on_the_surface(form):
    x = (0.28, 1.3, 0.1)
    wanted = saltation_matrix(machine(SURFACES["plane"]), "hit", 1.0, x)
    found = saltation_matrix(machine(SURFACES["plane"], FORMS[form]), "hit", 1.0, x)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)


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


class TestKernels:
    """A guard ``g(t, x)`` of two components on the path ``x + s f`` with ``f = (2, -1)`` from ``(1, 3)``."""

    X, FIELD = np.array([1.0, 3.0]), np.array([2.0, -1.0])

    def setup_of(self, guard, gradient=lambda t, x: (0.0, 0.0, 0.0)):
        def write_guard(transition, t, x, parameters, out):
            out[0] = guard(t, x)

        def write_gradient(transition, t, x, parameters, out):
            with np.errstate(all="ignore"):
                out[:] = gradient(t, x)

        model = SimpleNamespace(
            dimension=2,
            parameters=None,
            affine_guard=np.array([1, 0]),
            guard=write_guard,
            guard_gradient=write_gradient,
        )
        work = SimpleNamespace(
            field=self.FIELD,
            state=np.zeros(2),
            scalar=np.zeros(1),
            gradient=np.full(3, 9.0),
            stages=np.zeros((2, 3)),
        )
        return model, work

    def test_the_guard_on_parallels(self):
        model, work = self.setup_of(lambda t, x: 100 * t + 10 * x[0] + x[1])
        found = plain(surface).value_on_parallel(model, 1, 5.0, self.X, 0.5, 1, 0.25, work)
        assert found == 550.0 + 20.0 + 2.75

    def test_noise_is_that_of_rounding(self):
        model, work = self.setup_of(lambda t, x: x[0] - x[1])
        value, noise = plain(surface).value_and_noise(model, 1, 0.0, self.X, 0.5, work)
        assert value == -0.5
        assert noise == pytest.approx(surface.ROUNDING * 4.5, rel=0.1)

    def test_the_unit_of_time(self):
        for field, x, unit in (
            ((2.0, -1.0), (1.0, 3.0), 1.5),
            ((2.0, 0.0), (1.0, 3.0), 0.5),
            ((0.0, 0.0), (1.0, 3.0), 1.0),
            ((2.0, -1.0), (0.0, 0.0), 1.0),
        ):
            work = SimpleNamespace(field=np.array(field))
            assert plain(surface).unit_of_time(SimpleNamespace(dimension=2), np.array(x), work) == unit

    @pytest.mark.parametrize("rises", [1.0, -1.0])
    def test_a_jump_on_a_parallel(self, rises):
        """``x_0 - 3 x_1 / 2 + 7 / 2`` is zero at the start of the path, with the speed 7/2."""
        model, work = self.setup_of(lambda t, x: rises * np.sign(x[0] - 1.5 * x[1] + 3.5))
        tested = plain(surface)
        for i, shift, wanted in ((0, 0.01, -0.01 / 3.5), (0, -0.01, 0.01 / 3.5), (1, 0.02, 0.03 / 3.5)):
            found = tested.time_of_jump(model, 1, 0.0, self.X, (i, shift), (1e-7, 0.1), rises, work)
            assert found == pytest.approx(wanted, rel=1e-9)
        assert np.isnan(tested.time_of_jump(model, 1, 0.0, self.X, (0, 1.0), (1e-7, 0.1), rises, work))
        assert np.isnan(tested.time_of_jump(model, 1, 0.0, self.X, (0, 0.01), (1e-7, 0.1), -rises, work))

    @pytest.mark.parametrize("rises", [1.0, -1.0])
    def test_the_plane_of_a_jump(self, rises):
        model, work = self.setup_of(lambda t, x: rises * np.sign(t + x[0] - 1.5 * x[1] + 3.5))
        assert plain(surface).plane_of_jump(model, 1, 0.0, self.X, 1.5, 1e-7, rises, work)
        np.testing.assert_allclose(work.gradient, np.array([1.0, -1.5, 1.0]) / 4.5, rtol=1e-9)

    def test_a_plane_beside(self):
        """Of the cube of the same; a corner of the surface has none."""
        edge = np.array([1.0, -1.5, 1.0])

        def cube(t, x):
            return 3 * (t + x[0] - 1.5 * x[1] + 3.5) ** 2 * edge

        model, work = self.setup_of(None, cube)
        assert plain(surface).plane_beside(model, 1, 0.0, self.X, 1.5, 1e-7, work)
        np.testing.assert_allclose(work.gradient, edge / 4.5, rtol=1e-12)

        def corner(t, x):
            return edge * (1.0, 1.0 if t > 0 else 1.01, 1.0)

        model, work = self.setup_of(None, corner)
        assert not plain(surface).plane_beside(model, 1, 0.0, self.X, 1.5, 1e-7, work)
        model, work = self.setup_of(None, lambda t, x: (0.0, 0.0, 0.0))
        with np.errstate(invalid="ignore"):
            assert not plain(surface).plane_beside(model, 1, 0.0, self.X, 1.5, 1e-7, work)

    @pytest.mark.parametrize(
        ("guard", "explained", "turn"),
        [
            (lambda e: np.sign(e), 1e-9, 1),
            (lambda e: -np.sign(e), 1e-9, -1),
            (lambda e: np.sign(e) + 2.0, 1e-9, 0),
            (lambda e: np.sign(e), 0.01, 0),
            (lambda e: e, 0.0, 0),
            (lambda e: np.cbrt(e), 0.0, 0),
            (lambda e: np.tanh(1e12 * e), 0.0, 1),
        ],
    )
    def test_whether_it_jumps(self, guard, explained, turn):
        model, work = self.setup_of(lambda t, x: guard(x[0] - 1.0))
        assert plain(surface).jumps_across(model, 1, 0.0, self.X, 1e-7, explained, work) == turn

    def test_an_affine_guard_and_a_smooth_one_show_it_themselves(self):
        model, work = self.setup_of(
            lambda t, x: np.expm1(x[0] - 1.0), lambda t, x: (np.exp(x[0] - 1.0), 0.0, 0.0)
        )
        assert not plain(surface).finds_surface(model, 0, 0.0, self.X, 2.0, work)
        assert work.gradient.tolist() == [9.0, 9.0, 9.0]
        assert not plain(surface).finds_surface(model, 1, 0.0, self.X, 2.0, work)
        assert work.gradient.tolist() == [1.0, 0.0, 0.0]
