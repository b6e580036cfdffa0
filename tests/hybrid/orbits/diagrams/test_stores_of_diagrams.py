"""Diagrams and branches of equilibria on disk: a call that was cut short goes on, and gives the same."""

import shutil
import signal

import numpy as np
import pytest

import models
from hybrid import (
    ArgumentError,
    Every,
    HybridSystem,
    Mode,
    Reset,
    StatusCode,
    Transition,
    basin_fractions,
    continue_all,
    continue_bifurcation,
    continue_equilibrium,
    equilibrium,
    open_branch,
    open_diagram,
    periodic_orbit,
    switch_branch,
)
from hybrid.measures import maximum
from hybrid.orbits.diagrams import walker

SPAN = (7.0, 10.0)
TOP = {"top": maximum("y")}


@pytest.fixture(scope="module")
def rest():
    return equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))


@pytest.fixture(scope="module")
def whole(rest):
    return continue_all(rest, "q", SPAN, outputs=TOP)


@pytest.fixture
def folder(tmp_path):
    pytest.importorskip("zarr")
    return tmp_path / "valve"


@pytest.fixture
def python_hears_interrupts():
    """A process that runs tests for another one may ignore them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def assert_same(one, other):
    assert one.to_xarray().drop_attrs().equals(other.to_xarray().drop_attrs())
    assert [each.status.message for each in one] == [each.status.message for each in other]
    assert one.notes == other.notes
    assert str(one.status) == str(other.status)


@pytest.mark.as_given
def test_a_call_that_was_killed_goes_on_from_its_branches(rest, whole, folder, monkeypatch):
    continue_all(rest, "q", SPAN, outputs=TOP, store=folder, most=1)
    shutil.rmtree(folder / "diagram")
    with pytest.raises(ArgumentError, match=r"no call with store=.* has ended yet. Repeat the call"):
        open_diagram(rest.system, folder)
    monkeypatch.setattr(walker, "continue_equilibrium", None)
    assert_same(continue_all(rest, "q", SPAN, outputs=TOP, store=folder), whole)
    monkeypatch.setattr(walker, "continue_orbit", None)
    again = continue_all(rest, "q", SPAN, outputs=TOP, store=folder)
    assert_same(again, whole)
    assert_same(open_diagram(rest.system, folder), whole)
    assert again.origins[1].bifurcation is again[0].of("Hopf")[0]
    saved = open_branch(rest.system, folder / "branch-1")
    np.testing.assert_array_equal(saved["top"], whole[1]["top"])


@pytest.mark.as_given
@pytest.mark.parametrize("place", ["switch_branch", "continue_orbit"])
def test_ctrl_c_gives_what_there_is(rest, whole, folder, monkeypatch, python_hears_interrupts, place):
    function = getattr(walker, place)

    def pressed(*args, **options):
        signal.raise_signal(signal.SIGINT)
        return function(*args, **options)

    monkeypatch.setattr(walker, place, pressed)
    part = continue_all(rest, "q", SPAN, outputs=TOP, store=folder)
    assert part.status.code == StatusCode.INTERRUPTED
    assert len(part) == (1 if place == "switch_branch" else 2)
    np.testing.assert_array_equal(part[0].x, whole[0].x)
    assert len(open_diagram(rest.system, folder)) == len(part)
    monkeypatch.undo()
    assert_same(continue_all(rest, "q", SPAN, outputs=TOP, store=folder), whole)


def test_a_store_belongs_to_one_call(rest, folder):
    continue_all(rest, "q", (9.0, 9.5), store=folder)
    other = equilibrium(models.relief_valve(), (2.5, 0.0, 12.5), parameters={"q": 9.1})
    for start, span, options, told in (
        (rest, (9.0, 9.6), {}, r"span was .*9\.5.*, and is now .*9\.6"),
        (rest, (9.0, 9.5), {"depth": 1}, "depth was '2', and is now '1'"),
        (rest, (9.0, 9.5), {"outputs": TOP}, "output_top was '\\(none\\)', and is now .*maximum"),
        (other, (9.0, 9.5), {}, "start 1 was .*, and is now"),
    ):
        with pytest.raises(ArgumentError, match=f"store: .*valve' was made by another call: {told}"):
            continue_all(start, "q", span, store=folder, **options)
    (folder.parent / "notes").mkdir()
    (folder.parent / "notes" / "a.txt").touch()
    with pytest.raises(ArgumentError, match="notes' is not empty, and is not the store of a diagram"):
        continue_all(rest, "q", (9.0, 9.5), store=folder.parent / "notes")
    with pytest.raises(ArgumentError, match="store must be the path of a folder; got 3"):
        continue_all(rest, "q", (9.0, 9.5), store=3)


def test_a_damaged_branch_in_a_store_is_named(rest, folder):
    continue_all(rest, "q", (9.0, 9.5), store=folder)
    shutil.rmtree(folder / "branch-0" / "x")
    (folder / "branch-0" / ".zmetadata").unlink()
    with pytest.raises(ArgumentError, match="branch-0' is incomplete: 'x' is missing"):
        continue_all(rest, "q", (9.0, 9.5), store=folder)


@pytest.mark.as_given
def test_a_store_of_a_diagram_with_a_sweep(folder):
    """Of the map ``u -> a - u^2`` once per unit of time, whose orbits of period three begin at 7/4."""
    system = HybridSystem(
        state=("u",),
        parameters={"a": 0.5},
        modes=[Mode("on", lambda t, x, p: (0.0,))],
        transitions=[Transition("on", "on", Every(1.0), Reset(lambda t, x, p: (p.a - x.u**2,)), name="tick")],
        period=lambda p: 1.0,
    )
    seen = basin_fractions(system, {"u": (0.2, 0.4)}, along={"a": [0.6, 1.0, 1.76]}, starts=3)
    start = periodic_orbit(system, (0.36,))
    given = {"depth": 0, "sweep": seen, "outputs": {"top": maximum("u")}}
    whole = continue_all(start, "a", (0.3, 1.8), **given)
    assert len(whole) == 3
    assert whole[2].of("fold")[0].value == pytest.approx(1.75, abs=1e-9)
    for most in (2, 50):
        found = continue_all(start, "a", (0.3, 1.8), store=folder, most=most, **given)
    assert_same(found, whole)
    np.testing.assert_array_equal(found.sweep["branch"].values[:, 2], [0, 1, 2])


def test_a_branch_of_equilibria_is_opened_again(rest):
    branch = continue_equilibrium(rest, "q", SPAN)
    again = open_branch(rest.system, branch.to_xarray())
    assert repr(again) == repr(branch)
    np.testing.assert_array_equal(again.x, branch.x)
    np.testing.assert_array_equal(again["outflow"], branch["outflow"])
    one, other = again.of("Hopf")[0], branch.of("Hopf")[0]
    assert str(one) == str(other)
    assert (one.coefficient, one.period, one.stable) == (other.coefficient, other.period, other.stable)
    # Which point of the cycle is found may change with a last bit.
    assert switch_branch(one).period == pytest.approx(switch_branch(other).period, rel=1e-6)
    box = {"q": (8.4, 8.6), "kappa": (1.2, 1.3)}
    curves = [continue_bifurcation(each, box) for each in (one, other)]
    np.testing.assert_allclose(curves[0].values, curves[1].values, rtol=1e-9)
    with pytest.raises(ArgumentError, match="a branch of a system with the states y, v, P; got a system"):
        open_branch(models.bouncing_ball(), branch.to_xarray())
