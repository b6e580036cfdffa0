"""Outputs of sections, periodic orbits and branches."""

import attrs
import numpy as np
import pytest

import hybrid
import models
from hybrid import ArgumentError, Guard, Mode, continue_orbit, periodic_orbit, poincare_section
from hybrid import stroboscopic_section as strobe


def outputs():
    return {
        "energy": lambda t, x, p: x.v**2 / 2 + p.w * x.x**2 / 2,
        "drive": {"flight": lambda t, x, p: np.cos(p.w * t)},
    }


@pytest.fixture(scope="module")
def system():
    return attrs.evolve(models.impact_oscillator(), outputs=outputs(), units={}, laws=hybrid.Laws())


@pytest.fixture(scope="module")
def orbit(system):
    return periodic_orbit(system, (0.9, 1.0))


@pytest.fixture(scope="module")
def branch(orbit):
    return continue_orbit(orbit, "w", (0.9, 1.8))


def energy(x, w):
    return x[..., 1] ** 2 / 2 + w * x[..., 0] ** 2 / 2


class TestSections:
    def test_once_per_period(self, system):
        section = strobe(system, (0.0, 0.0), periods=20, t0=0.5)
        np.testing.assert_allclose(section["energy"], energy(section.x, 1.0), rtol=1e-13)
        np.testing.assert_allclose(section["drive"], np.cos(0.5), rtol=1e-9)
        np.testing.assert_array_equal(section["x"], section.x[:, 0])

    def test_at_a_surface_with_other_parameters(self, system):
        surface = Guard(lambda t, x, p: x.x - 0.3, +1)
        section = poincare_section(system, (0.0, 0.0), surface, points=10, parameters={"w": 1.2})
        assert section.system is system
        np.testing.assert_allclose(section["energy"], energy(section.x, 1.2), rtol=1e-13)
        np.testing.assert_allclose(section["drive"], np.cos(1.2 * section.t), rtol=1e-12)

    def test_its_dataset_and_its_picture(self, system):
        section = strobe(system, (0.0, 0.0), periods=5)
        found = section.to_xarray()
        np.testing.assert_array_equal(found.outputs.sel(output="energy"), section["energy"])
        ax = hybrid.plot.plot_section(section, "x", "energy")
        assert ax.get_ylabel() == "energy"

    def test_an_unknown_name(self, system):
        with pytest.raises(ArgumentError, match="State component or output 'enrgy' does not exist"):
            strobe(system, (0.0, 0.0), periods=2)["enrgy"]


class TestOrbits:
    def test_its_arc(self, orbit):
        arc = orbit.arc()
        np.testing.assert_allclose(arc["energy"], energy(arc.x, 1.0), rtol=1e-13)

    def test_its_dataset_has_those_at_its_point(self, orbit):
        found = orbit.to_xarray().outputs.sel(output="energy")
        assert float(found) == pytest.approx(energy(orbit.x0, 1.0))

    def test_its_picture(self, orbit):
        ax = hybrid.plot.plot_orbit(orbit, "x", "energy")
        assert ax.get_ylabel() == "energy"


class TestBranches:
    def test_each_point_has_its_own_parameter(self, branch):
        np.testing.assert_allclose(branch["energy"], energy(branch.x0, branch.parameter), rtol=1e-13)
        np.testing.assert_array_equal(branch["v"], branch.x0[:, 1])

    def test_the_time_of_a_point(self, branch):
        np.testing.assert_allclose(branch["drive"], np.cos(branch.parameter * branch.t0), rtol=1e-13)

    def test_its_dataset(self, branch, system):
        found = branch.to_xarray()
        np.testing.assert_array_equal(found.outputs.sel(output="energy"), branch["energy"])
        there = found.outputs_there.sel(output="energy").values
        for value, each in zip(there, branch.bifurcations, strict=True):
            assert value == pytest.approx(energy(each.orbit.x0, each.value))
        np.testing.assert_array_equal(hybrid.open_branch(system, found)["energy"], branch["energy"])

    def test_its_picture(self, branch):
        ax = hybrid.plot.plot_branch(branch, "energy")
        assert ax.get_ylabel() == "energy"
        drawn = np.concatenate([line.get_ydata() for line in ax.lines])
        assert drawn.max() >= branch["energy"].max()

    def test_an_autonomous_one_has_the_times_of_its_points(self):
        pendulum = hybrid.HybridSystem(
            state=("q", "v"),
            parameters={"a": 0.1},
            modes=[Mode("turn", lambda t, x, p: (x.v, -x.q + p.a * (1 - x.q**2) * x.v))],
            outputs={"speed": lambda t, x, p: abs(x.v)},
        )
        branch = continue_orbit(periodic_orbit(pendulum, (2.0, 0.0), period=6.3), "a", (0.1, 0.2))
        assert branch.t0.shape == branch.parameter.shape
        np.testing.assert_allclose(branch["speed"], np.abs(branch.x0[:, 1]), rtol=1e-13)
