"""Basins over the plane of the section."""

import pytest

import models
from hybrid import Guard, HybridSystem, Mode, Transition

# Both modes allow -0.5 < q < 0.5, and each has a rest of its own.
OVERLAP = HybridSystem(
    state=("q", "u"),
    parameters={"d": 0.5},
    modes=[Mode("up", lambda t, x, p: (1.0 - x.q, -x.u)), Mode("down", lambda t, x, p: (-1.0 - x.q, -x.u))],
    transitions=[
        Transition("up", "down", Guard(lambda t, x, p: x.q + p.d, -1)),
        Transition("down", "up", Guard(lambda t, x, p: x.q - p.d, +1)),
    ],
)


@pytest.mark.parametrize(("mode", "rest"), [("up", 1.0), ("down", -1.0)])
def test_basins_of_modes_that_overlap_are_those_of_the_mode_at_the_start(opened, mode, rest):
    page = opened(lambda: OVERLAP, x0=(0.0, 0.3), mode=mode)
    page.widgets.switches["basins"].value = True
    assert page.worker.wait(120)
    assert f"all are in mode '{mode}'" in page.board.words["basins"]
    assert "1 equilibrium" in page.board.words["basins"]
    assert page.board.calls["basins"][0].keywords["mode"] == mode
    found = page.board.results["basins"]
    assert found.points.values[0, 0, 0] == pytest.approx(rest, abs=1e-3)
    # Beyond its guard the mode does not allow a start.
    allowed = found.q.values * rest > -0.5
    assert (found.label.sel(q=allowed) == 1).all()
    assert (found.label.sel(q=~allowed) == -1).all()


def test_basins_of_modes_that_do_not_overlap_are_left_to_the_guards(opened):
    page = opened(models.vibroimpact, query={"columns": "2", "points": "300"})
    page.worker.want([])
    page.widgets.switches["basins"].value = True
    assert page.worker.wait(300)
    assert "mode" not in page.board.calls["basins"][0].keywords
