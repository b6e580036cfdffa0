"""Outputs of many runs, of sweeps and of charts."""

import attrs
import numpy as np
import pytest

import hybrid
import models
from hybrid import DOP853, ArgumentError, Guard, Laws, StatusCode, simulate, simulate_many, split, sweep
from lyapunov import chart
from lyapunov.plot import plot_bifurcation, plot_chart


def energy(t, x, p):
    return x.v**2 / 2 + p.w * x.x**2 / 2


@pytest.fixture(scope="module")
def system():
    outputs = {"energy": energy, "drive": {"flight": lambda t, x, p: np.cos(p.w * t)}}
    return attrs.evolve(
        models.impact_oscillator(), outputs=outputs, units={"energy": "J", "x": "m"}, laws=Laws()
    )


STARTS = np.column_stack([np.linspace(-1.0, 0.9, 6), np.zeros(6)])


class TestManyRuns:
    def test_at_the_ends(self, system):
        ends = simulate_many(system, STARTS, (0.0, 10.0), outputs=["energy", "drive"], parameters={"w": 1.1})
        x = ends.x_end.values
        found = ends.outputs_end
        np.testing.assert_allclose(found.sel(output="energy"), x[:, 1] ** 2 / 2 + 1.1 * x[:, 0] ** 2 / 2)
        np.testing.assert_allclose(found.sel(output="drive"), np.cos(11.0))
        assert found.output_unit.values.tolist() == ["J", ""]

    def test_they_are_computed_when_asked_for(self, system):
        assert "output" not in simulate_many(system, STARTS, (0.0, 1.0)).dims

    def test_in_a_picture(self, system):
        ends = simulate_many(system, STARTS, (0.0, 10.0), outputs=["energy"])
        ax = hybrid.plot(ends, x="x", y="energy")
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("x (m)", "energy (J)")

    def test_of_a_system_that_grows(self):
        rubbing = hybrid.from_equations(
            lambda t, x, p: (x.v, -x.q - 0.1 * np.sign(x.v) - np.floor(x.q)),
            state=("q", "v"),
            outputs={"twice": lambda t, x, p: 2.0 * x.q},
        )
        ends = simulate_many(split(rubbing), {"q": [1.0, 2.5], "v": 0.0}, (0.0, 5.0), outputs=["twice"])
        assert ends.outputs_end.values[:, 0] == pytest.approx(2.0 * ends.x_end.values[:, 0])

    def test_an_unknown_name(self, system):
        with pytest.raises(
            ArgumentError, match=r"outputs: Output 'enrgy' does not exist\. Outputs: energy, drive"
        ):
            simulate_many(system, STARTS, (0.0, 1.0), outputs=["enrgy"])
        with pytest.raises(ArgumentError, match="outputs must be a list of names of outputs"):
            simulate_many(system, STARTS, (0.0, 1.0), outputs="energy")


def test_a_task_of_a_sweep_returns_what_it_asks_an_arc_for(system):
    def task(point):
        return {"peak": simulate(system, (0.0, 0.0), (0.0, 20.0), parameters=point)["energy"].max()}

    found = sweep(task, {"w": [0.9, 1.1]})
    assert found.peak.values[0] == task({"w": 0.9})["peak"]


@pytest.fixture(scope="module")
def made(system):
    over = {"w": [0.9, 1.0, 1.1]}
    return chart(system, over, (0.0, 0.0), intervals=50, section=5, outputs=["energy", "drive"])


class TestCharts:
    def test_at_the_points_of_the_section(self, made):
        x, w = made.section.values, made.w.values[:, None]
        expected = x[..., 1] ** 2 / 2 + w * x[..., 0] ** 2 / 2
        np.testing.assert_allclose(made.section_outputs.sel(output="energy"), expected, rtol=1e-12)
        np.testing.assert_allclose(made.section_outputs.sel(output="drive"), 1.0, rtol=1e-9)

    @pytest.mark.parametrize("at", [Guard(lambda t, x, p: x.x - 0.2, +1), "jumps"])
    def test_at_a_surface_and_at_jumps(self, system, at):
        made = chart(
            system, {"w": [0.9]}, (0.0, 0.0), intervals=50, section=5, at=at, outputs=["energy", "drive"]
        )
        x = made.section.values
        expected = x[..., 1] ** 2 / 2 + 0.9 * x[..., 0] ** 2 / 2
        np.testing.assert_allclose(made.section_outputs.sel(output="energy"), expected, rtol=1e-12)
        assert np.all(np.abs(made.section_outputs.sel(output="drive")) <= 1.0)

    def test_in_pictures(self, made):
        assert plot_bifurcation(made, "energy").get_ylabel() == "energy (J)"
        assert plot_chart(made, "energy")[0].get_ylabel() == "energy (J)"

    def test_below_a_branch(self, made, system):
        branch = hybrid.continue_orbit(hybrid.periodic_orbit(system, (0.9, 1.0)), "w", (0.95, 1.05))
        ax = hybrid.plot.plot_branch(branch, "energy", over=made)
        np.testing.assert_array_equal(
            np.sort(ax.collections[0].get_offsets()[:, 1]),
            np.sort(made.section_outputs.sel(output="energy").values.ravel()),
        )

    def test_a_row_that_fails_has_none(self, system):
        short = DOP853(max_steps=50)
        made = chart(
            system, {"w": [0.9]}, (0.0, 0.0), intervals=5, section=5, outputs=["energy"], solver=short
        )
        assert made.status.values[0] == StatusCode.MAX_STEPS
        assert np.isnan(made.section_outputs.values).all()

    def test_errors(self, system):
        with pytest.raises(ArgumentError, match="outputs: Output 'enrgy' does not exist"):
            chart(system, {"w": [0.9]}, (0.0, 0.0), intervals=5, section=5, outputs=["enrgy"])
        with pytest.raises(ArgumentError, match=r"this chart has none\. Give section=100 too"):
            chart(system, {"w": [0.9]}, (0.0, 0.0), intervals=5, outputs=["energy"])
