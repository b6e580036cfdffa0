"""Results as datasets, which are saved and read again."""

import json

import numpy as np
import pytest

import hybrid
import lyapunov
import models
from hybrid import ArgumentError, simulate
from hybrid.simulation.labelled import Names
from tests.hybrid import systems

SPAN = (0.0, 2.0)
START = {"x1": -0.00765806, "x2": -0.00411675, "v1": 0.05565196, "v2": -0.35621583}


def results():
    ball, forced = models.bouncing_ball(), models.vibroimpact()
    arc = hybrid.simulate(ball, (1.0, 0.0), SPAN, tangent=np.eye(2))
    return {
        "arc": arc,
        "jumps": arc.jumps,
        "strobe": hybrid.stroboscopic_section(forced, START, periods=3),
        "spectrum": lyapunov.lyapunov_spectrum(forced, START, k=2, intervals=20, transient=2),
        "orbit": hybrid.periodic_orbit(forced, START),
    }


@pytest.fixture(scope="module")
def found():
    return results()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["arc", "jumps", "strobe", "spectrum", "orbit"])
def test_what_was_saved_comes_back(found, name, tmp_path):
    pytest.importorskip("zarr")
    labelled = found[name].to_xarray()
    labelled.to_zarr(tmp_path / "saved.zarr", zarr_format=3, consolidated=False)
    assert labelled.identical(hybrid.open_store(tmp_path / "saved.zarr"))
    if name != "orbit":
        labelled.to_netcdf(tmp_path / "saved.nc")
        with hybrid.open_store(tmp_path / "saved.nc") as other:
            for variable in labelled.data_vars:
                np.testing.assert_array_equal(other[variable].values, labelled[variable].values)


def test_an_arc_over_time(found):
    arc = found["arc"]
    labelled = arc.to_xarray()
    np.testing.assert_array_equal(labelled.x.sel(state="q"), arc["q"])
    np.testing.assert_array_equal(labelled.t, arc.t)
    assert labelled.attrs["model"] == arc.system.name
    assert json.loads(labelled.attrs["model_parameters"]) == dict(arc.parameters)
    assert (labelled.attrs["status"], labelled.attrs["message"]) == ("SUCCESS", arc.status.message)
    assert labelled.fundamental.dims == ("state", "tangent")
    jumps = arc.jumps.to_xarray()
    np.testing.assert_array_equal(jumps.x_plus.sel(state="v"), [jump.x_plus[1] for jump in arc.jumps])


def test_units_come_from_the_model(found):
    assert found["strobe"].to_xarray().t.units == "s"
    assert found["strobe"].to_xarray().unit.values.tolist() == ["m", "m", "m/s", "m/s"]
    spectrum = found["spectrum"].to_xarray()
    assert (spectrum.exponents.units, spectrum.interval.units, spectrum.time.units) == ("1/s", "s", "s")
    assert found["orbit"].to_xarray().period.units == "s"
    assert "unit" not in simulate(models.impact_oscillator(), (0.0, 0.0), (0.0, 1.0)).to_xarray().coords


def test_samples_of_runs_are_a_sweep():
    ball, times = models.bouncing_ball(), np.linspace(0.0, 2.0, 5)
    swept = hybrid.sweep(
        lambda p: hybrid.simulate(ball, (1.0, 0.0), SPAN, parameters=p, samples=times), {"e": [0.7, 0.8]}
    )
    assert swept.x.dims == ("e", "t", "state")
    one = hybrid.simulate(ball, (1.0, 0.0), SPAN, parameters={"e": 0.8}, samples=times)
    np.testing.assert_array_equal(swept.x.sel(e=0.8), one.x)


def test_units_are_checked():
    with pytest.raises(ArgumentError, match=r"HybridSystem: units: Name 'w' does not exist"):
        systems.ball(units={"w": "m"})
    with pytest.raises(ArgumentError, match=r"HybridSystem: units\['v'\] must be"):
        systems.ball(units={"v": 3})


def test_names_of_which_some_have_units():
    names = Names(("q", "v"), {"v": "m/s", "t": "s"})
    assert names.coords() == {"state": ("state", ["q", "v"]), "unit": ("state", ["", "m/s"])}
    assert (names.of("v"), names.of("q"), names.rate) == ({"units": "m/s"}, {}, {"units": "1/s"})
    without = Names(("q", "v"), {"t": "s"})
    assert without.coords() == {"state": ("state", ["q", "v"])}
    assert Names(("q",), {"q": "m"}).rate == {}
