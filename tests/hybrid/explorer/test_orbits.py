"""The orbit near the end of a section has as many periods as it has dots; its branch waits for it."""

import numpy as np
import pytest

from hybrid import Every, Guard, HybridSystem, Mode, Reset, Transition
from hybrid.explorer.page import Page
from hybrid.explorer.subject import subject


def logistic(t, x, p):
    return p.r * x.u * (1 - x.u)


# The logistic map, once per forcing period, and at each passage of a clock hand.
FORCED = HybridSystem(
    state=("u",),
    parameters={"r": 3.83},
    period=1.0,
    modes=[Mode("on", lambda t, x, p: (0.0,))],
    transitions=[Transition("on", "on", Every(1.0, offset=0.5), Reset(lambda t, x, p: (logistic(t, x, p),)))],
)
FREE = HybridSystem(
    state=("q", "u"),
    parameters={"r": 3.83},
    modes=[Mode("on", lambda t, x, p: (1.0, 0.0))],
    transitions=[
        Transition(
            "on",
            "on",
            Guard(lambda t, x, p: x.q - 1.0, +1),
            Reset(lambda t, x, p: (0.0, logistic(t, x, p))),
        )
    ],
)
# A map with the fixed points sin(u) = a / k while |a| <= k, and none beyond the fold there.
K = 0.1
DRIFT = HybridSystem(
    state=("u",),
    parameters={"a": 0.2},
    period=1.0,
    modes=[Mode("on", lambda t, x, p: (0.0,))],
    transitions=[
        Transition("on", "on", Every(1.0, offset=0.5), Reset(lambda t, x, p: (x.u + p.a - K * np.sin(x.u),)))
    ],
)
# By r: periods of the attractor, known in closed form where it attracts: 1 up to 3, 2 up to 1 + sqrt(6), ...
PERIODS = {2.8: 1, 3.2: 2, 3.5: 4, 3.83: 3}


@pytest.fixture
def opened():
    pages = []

    def make(system, x0, *, query=None, **options):
        page = Page(subject(system, "", x0, **options), {"columns": "4", **(query or {})}, lambda act: act())
        pages.append(page)
        assert page.worker.wait(60)
        return page

    yield make
    for page in pages:
        page.close()


def found(page, *switches):
    for each in switches or ("orbit",):
        page.widgets.switches[each].value = True
    assert page.worker.wait(60)
    return page.board.results.get("orbit")


def multiplier(r, periods):
    """The derivative of the map along its attracting cycle."""
    u = 0.4
    for _ in range(4000):
        u = r * u * (1 - u)
    product = 1.0
    for _ in range(periods):
        product *= r * (1 - 2 * u)
        u = r * u * (1 - u)
    return product


@pytest.mark.parametrize(("r", "periods"), PERIODS.items())
@pytest.mark.parametrize("section", ["once per period", "at each jump"])
def test_a_forced_orbit_has_as_many_periods_as_dots(opened, r, periods, section):
    page = opened(FORCED, (0.4,), parameters={"r": r}, query={"section": section})
    orbit = found(page)
    assert orbit.forcing_periods == periods
    np.testing.assert_allclose(orbit.multipliers.real, [multiplier(r, periods)], atol=1e-6)
    said = page.board.words["orbit"]
    assert f"repeats after {periods} forcing period" in said
    assert f"Tried: {periods} forcing period" in said


@pytest.mark.parametrize(("r", "periods"), PERIODS.items())
def test_an_unforced_orbit_has_as_many_laps_as_dots(opened, r, periods):
    page = opened(FREE, (0.0, 0.4), parameters={"r": r})
    orbit = found(page)
    assert orbit.period == pytest.approx(periods, rel=1e-9)
    largest = np.delete(orbit.multipliers, np.argmin(np.abs(orbit.multipliers - 1.0)))
    np.testing.assert_allclose(largest.real, [multiplier(r, periods)], atol=1e-6)
    assert f"The section repeats after {periods} point" in page.board.words["orbit"]


def test_a_section_without_end_is_said_to_have_no_dots_to_count(opened):
    """In chaos the orbits of few periods are tried: one is the fixed point 1 - 1/r, with multiplier 2 - r."""
    page = opened(FORCED, (0.4,), parameters={"r": 3.9})
    orbit = found(page)
    assert "does not repeat within 16 forcing periods" in page.board.words["orbit"]
    u = orbit.x0[0]
    np.testing.assert_allclose(3.9 * u * (1 - u), u, rtol=1e-9)


def test_a_number_of_periods_may_be_chosen(opened):
    page = opened(FORCED, (0.4,), parameters={"r": 3.83}, query={"periods": "1"})
    orbit = found(page)
    assert orbit.forcing_periods == 1
    np.testing.assert_allclose(orbit.multipliers.real, [2 - 3.83], rtol=1e-9)
    assert "Tried: 1 forcing period (this orbit)." in page.board.words["orbit"]
    page.change(periods=3)
    assert page.worker.wait(60)
    assert page.board.results["orbit"].forcing_periods == 3


def test_more_periods_than_points_are_refused(opened):
    page = opened(FREE, (0.0, 0.4), query={"points": "20", "periods": "20"})
    assert found(page) is None
    assert "periods of the orbit must be below 20" in page.board.words["orbit"]


def test_a_branch_is_tried_again_with_the_next_orbit(opened):
    """Beyond the fold there is no orbit; where the parameter of the diagram moves back there is one."""
    page = opened(DRIFT, (0.4,), ranges={"a": (0.0, 0.3)})
    assert found(page, "orbit", "branch") is None
    assert "no orbit was found near here" in page.board.words["branch"]
    assert page.board.words["branch"] == page.board.words["orbit"]
    assert "Tried: 1 forcing period (NOT_CONVERGED), 2 forcing periods" in page.board.words["orbit"]
    page.move("a", 0.05)
    assert page.worker.wait(60)
    assert page.board.results["orbit"].multipliers.real == pytest.approx(
        [1 - K * np.cos(np.arcsin(0.5))], rel=1e-9
    )
    folds = [each.value for each in page.board.results["branch"].bifurcations if each.kind == "fold"]
    assert folds == pytest.approx([K], rel=1e-6)
    assert "fold at 0.1" in page.board.words["branch"]


def test_a_branch_stays_while_its_parameter_moves(opened):
    page = opened(DRIFT, (0.4,), ranges={"a": (0.0, 0.3)}, parameters={"a": 0.05})
    found(page, "branch")
    before = page.board.results["branch"]
    page.move("a", 0.2)
    assert page.worker.wait(60)
    assert page.board.results["branch"] is before
