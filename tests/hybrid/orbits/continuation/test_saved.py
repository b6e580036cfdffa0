"""Branches on disk and in other processes: what comes back is what was saved, or an error that says so."""

import pickle
import shutil

import cloudpickle
import numpy as np
import pytest

import hybrid
import models
from hybrid import After, Guard, HybridSystem, Mode, Reset, Transition, continue_orbit, periodic_orbit
from hybrid.errors import ArgumentError, ModelError


@pytest.fixture(scope="module")
def impacts():
    """One impact per period, over the frequency of the forcing, with folds and grazings."""
    return continue_orbit(periodic_orbit(models.impact_oscillator(), (0.9, 1.0)), "w", (0.68, 1.9))


@pytest.fixture
def folder(impacts, tmp_path):
    pytest.importorskip("zarr")
    impacts.to_xarray().to_zarr(tmp_path / "branch", zarr_format=2)
    return tmp_path / "branch"


def files_of(folder):
    return sorted(each for each in folder.rglob("*") if each.is_file())


@pytest.mark.filterwarnings("ignore")  # of zarr, about texts in its format 3
@pytest.mark.parametrize("zarr_format", [2, 3])
def test_a_branch_is_saved_and_opened_again(impacts, tmp_path, zarr_format):
    pytest.importorskip("zarr")
    impacts.to_xarray().to_zarr(tmp_path / "branch", zarr_format=zarr_format)
    again = hybrid.open_branch(impacts.system, tmp_path / "branch")
    np.testing.assert_array_equal(again.parameter, impacts.parameter)
    np.testing.assert_array_equal(again.multipliers, impacts.multipliers)
    assert [str(each) for each in again.bifurcations] == [str(each) for each in impacts.bifurcations]
    i = len(again) // 2
    assert again.orbit(i).transitions == impacts.orbit(i).transitions
    np.testing.assert_allclose(again.orbit(i).fundamental, impacts.orbit(i).fundamental, rtol=1e-6)
    assert continue_orbit(again.orbit(i), "w", (1.5, 1.9)).status.ok


def refusal_of(branch, folder):
    """Why a folder is refused; empty if it gives the whole branch."""
    try:
        again = hybrid.open_branch(branch.system, folder)
    except ArgumentError as error:
        return str(error)
    for name in ("parameter", "x0", "mode", "period", "multipliers", "stable"):
        np.testing.assert_array_equal(getattr(again, name), getattr(branch, name))
    assert [str(each) for each in again.bifurcations] == [str(each) for each in branch.bifurcations]
    assert [each.stable for each in again.bifurcations] == [each.stable for each in branch.bifurcations]
    assert again.status.code == branch.status.code
    return ""


@pytest.mark.parametrize("how", ["lost", "cut short", "emptied", "changed"])
def test_no_damaged_file_gives_another_branch(impacts, folder, how):
    refused = []
    for file in files_of(folder):
        whole = file.read_bytes()
        damaged = {
            "lost": None,
            "cut short": whole[: len(whole) // 2],
            "emptied": b"",
            "changed": whole[:-3] + bytes([whole[-3] ^ 1]) + whole[-2:],
        }[how]
        if damaged is None:
            file.unlink()
        else:
            file.write_bytes(damaged)
        refused.append(refusal_of(impacts, folder))
        file.write_bytes(whole)
    # Metadata of axes, and copies of metadata, may change without a change of the branch.
    assert sum(map(bool, refused)) >= len(impacts.to_xarray().data_vars)
    assert all(str(folder) in each for each in refused if each)
    assert not refusal_of(impacts, folder)


@pytest.mark.parametrize("lost", ["state", "w", "mode", "x0", "multipliers_there"])
def test_a_save_without_a_variable_is_incomplete(impacts, folder, lost):
    shutil.rmtree(folder / lost)
    (folder / ".zmetadata").unlink()
    with pytest.raises(ArgumentError, match=f"branch' is incomplete: '{lost}' is missing. Copy it again"):
        hybrid.open_branch(impacts.system, folder)


def test_a_save_that_has_only_begun_is_incomplete(impacts, tmp_path):
    pytest.importorskip("zarr")
    impacts.to_xarray().drop_attrs()[[]].to_zarr(tmp_path / "branch", zarr_format=2)
    with pytest.raises(ArgumentError, match="branch' is incomplete: the attribute 'checksums' is missing"):
        hybrid.open_branch(impacts.system, tmp_path / "branch")


def test_a_file_that_holds_no_dataset_is_named(impacts, tmp_path):
    (tmp_path / "branch.nc").write_bytes(b"CDF\x01" + bytes(20))
    with pytest.raises(ArgumentError, match=r"saved: the .*file .*branch\.nc' cannot be read"):
        hybrid.open_branch(impacts.system, tmp_path / "branch.nc")


def test_a_dataset_that_was_changed_is_refused(impacts):
    changed = impacts.to_xarray()
    changed["period"] = 2.0 * changed.period
    with pytest.raises(ArgumentError, match="saved is not what was saved: 'period' is damaged or changed"):
        hybrid.open_branch(impacts.system, changed)
    arc = hybrid.simulate(impacts.system, (0.0, 0.0), (0.0, 1.0))
    with pytest.raises(ArgumentError, match="saved must be the dataset of a branch"):
        hybrid.open_branch(impacts.system, arc.to_xarray())


def test_a_branch_is_pickled_with_all_that_it_holds(impacts):
    again = pickle.loads(pickle.dumps(impacts))
    np.testing.assert_array_equal(again.x0, impacts.x0)
    for one, other in zip(again.orbits, impacts.orbits, strict=True):
        np.testing.assert_array_equal(one.fundamental, other.fundamental)
    assert [str(each) for each in again.bifurcations] == [str(each) for each in impacts.bifurcations]
    box = {"w": (0.5, 1.9), "c": (0.05, 0.2)}
    curves = [hybrid.continue_bifurcation(each.bifurcations[0], box) for each in (again, impacts)]
    np.testing.assert_allclose(curves[0].values, curves[1].values, rtol=1e-9)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(curves[1])).values, curves[1].values)


def test_an_opened_branch_is_pickled(impacts):
    again = pickle.loads(pickle.dumps(hybrid.open_branch(impacts.system, impacts.to_xarray())))
    np.testing.assert_array_equal(again.orbit(3).x0, impacts.orbit(3).x0)


def spiking():
    """A neuron that rests after each spike: derivatives of its runs know how long it has rested."""
    return HybridSystem(
        state=("v",),
        parameters={"I": 1.5},
        start="charge",
        modes=[Mode("charge", lambda t, x, p: (p.I - x.v,)), Mode("rest", lambda t, x, p: (0.0,))],
        transitions=[
            Transition("charge", "rest", Guard(lambda t, x, p: x.v - 1.0), Reset(lambda t, x, p: (0.0,))),
            Transition("rest", "charge", After(0.2)),
        ],
    )


def test_a_branch_of_a_system_with_dwell_times_is_pickled():
    branch = continue_orbit(periodic_orbit(spiking(), (0.5,), period=1.3), "I", (1.4, 1.6))
    again = pickle.loads(cloudpickle.dumps(branch))
    i = len(branch) // 2
    assert again.orbit(i).period == pytest.approx(0.2 - np.log(1.0 - 1.0 / branch.parameter[i]), rel=1e-9)


def test_what_cannot_be_pickled_says_what_to_do():
    branch = continue_orbit(periodic_orbit(spiking(), (0.5,), period=1.3), "I", (1.4, 1.6))
    with pytest.raises(ModelError, match=r"cannot be pickled: .* or pickle with cloudpickle"):
        pickle.dumps(branch)
