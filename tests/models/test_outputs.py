"""Forces that models name are those that move them."""

import numpy as np
import pytest

import models
from hybrid import simulate
from models.contact import HuntCrossley, KelvinVoigt, Rigid


def rates(arc):
    """The time derivatives ``(N, n)`` of the state at the points of an arc."""
    system, p = arc.system, arc.system.variables.parameter_view(list(arc.parameters.values()))
    fields = {mode.name: mode.field for mode in system.modes}
    return np.array(
        [
            fields[str(mode)](t, system.variables.state_view(x), p)
            for t, x, mode in zip(arc.t, arc.x, arc.mode, strict=True)
        ]
    )


def close(found, expected, scale=1.0):
    known = ~np.isnan(found)
    assert known.any()
    np.testing.assert_allclose(found[known], expected[known], rtol=1e-9, atol=1e-9 * scale)


@pytest.mark.parametrize(
    ("model", "mode", "start"),
    [(models.stick_slip, None, (0.5, 0.2)), (models.coulomb_stick_slip, "stick", (0.5, 0.2))],
)
def test_friction_is_what_the_spring_leaves(model, mode, start):
    arc = simulate(model(), start, (0.0, 20.0), mode=mode)
    assert len(set(arc.mode)) > 1
    close(arc["friction"], rates(arc)[:, 1] + arc["x"])


def test_friction_of_the_driven_oscillator():
    arc = simulate(models.dry_friction_oscillator(), (0.1, 0.0), (0.0, 40.0), parameters={"A": 0.6})
    assert "sliding" in arc.mode
    drive = 0.6 * np.cos(0.8 * arc.t)
    close(arc["friction"], rates(arc)[:, 1] + arc["x"] - drive)
    assert np.abs(arc["friction"]).max() <= 0.5 + 1e-9


def test_force_of_the_stops():
    arc = simulate(models.stop_oscillator(), (0.0, 3.0), (0.0, 20.0))
    others = np.cos(arc.t) - 0.1 * arc["v"] - arc["x"]
    close(arc["force"], rates(arc)[:, 1] - others)
    assert np.isnan(arc["force"][arc.mode == "free"]).all()


def test_force_of_the_leg():
    arc = simulate(models.slip_hopper(), (0.0, 0.95, 5.1, 0.0), (0.0, 0.6), mode="descent")
    ax, ay = rates(arc)[:, 2:].T
    close(arc["force"], 80.0 * np.hypot(ax, ay + 9.81), 1e4)
    np.testing.assert_allclose(arc["energy"], arc["energy"][0], rtol=1e-9)


@pytest.mark.parametrize("law", [None, HuntCrossley(1.537e11, 0.2), KelvinVoigt(1e9, 1e5)])
def test_force_of_a_contact(law):
    arc = simulate(models.vibroimpact(law), (-0.03, 0.0, 0.5, 0.0), (0.0, 1.0), mode="free")
    touches = arc.mode == "contact"
    assert touches.any()
    free = arc.system.modes[0].field
    p = arc.system.variables.parameter_view(list(arc.parameters.values()))
    without = np.array(
        [free(t, arc.system.variables.state_view(x), p)[3] for t, x in zip(arc.t, arc.x, strict=True)]
    )
    close(arc["force"], 100.0 * (rates(arc)[:, 3] - without), 1e4)
    np.testing.assert_array_equal(np.isfinite(arc["force"]), touches)


def test_a_rigid_contact_has_no_force():
    assert [*models.vibroimpact(Rigid(0.8)).outputs] == ["energy", "drive"]


def test_the_table_carries_the_weight_of_a_ball_at_rest():
    arc = simulate(models.bouncing_table(), (0.0, 0.0), (0.0, 1.0), mode="rest", parameters={"w": 30.0})
    assert set(arc.mode) == {"rest"}
    close(arc["force"], 9.81 - 0.01 * 30.0**2 * np.sin(30.0 * arc.t))


def test_the_voltage_of_a_cell_jumps_where_it_is_cut_off():
    arc = simulate(models.battery_cell(), (0.05, 0.0), (0.0, 2000.0))
    [cut] = arc.jumps
    assert arc.jumps.before("voltage")[0] == pytest.approx(3.0, abs=1e-9)
    assert arc.jumps.after("voltage")[0] > 3.0
    assert arc.jumps.after("current")[0] == 0.0
    assert cut.target == "off"
