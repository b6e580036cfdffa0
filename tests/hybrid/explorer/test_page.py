"""The page without a browser: what is shown, what is said, and the script that gives the same."""

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

import models
from hybrid import Guard, HybridSystem, Mode, Reset, Transition, from_equations
from hybrid.errors import ArgumentError
from hybrid.explorer.page import Page
from hybrid.explorer.subject import subject
from tests.hybrid.explorer.pages import FALL, RELAY, said
from tests.hybrid.transform.contacts.scenes import block


def run(script):
    made = {}
    exec(compile(script, "explored.py", "exec"), made)
    plt.close("all")
    return made


# A parameter may be declared at the end of its range, as a restitution of 1.
@pytest.mark.as_given
@pytest.mark.parametrize("name", models.__all__)
def test_every_model_opens(opened, name):
    page = opened(getattr(models, name), query={"columns": "4"})
    assert page.board.live is not None
    assert len(page.board.live.arc.t) > 1
    assert "diagram" in page.board.calls or not page.scene.over


def test_the_script_gives_what_is_shown(opened):
    page = opened(models.impact_oscillator, ranges={"w": (0.6, 2.0)})
    for switch in ("orbit", "branch", "basins"):
        page.widgets.switches[switch].value = True
        assert page.worker.wait(120)
    page.move("w", 0.9)
    assert page.worker.wait(120)
    found, board = run(page.script()), page.board
    np.testing.assert_array_equal(found["section"].x, board.live.points.x)
    np.testing.assert_array_equal(found["arc"].x, board.live.arc.x)
    np.testing.assert_array_equal(found["spectrum"].exponents, board.results["exponents"].exponents)
    np.testing.assert_array_equal(found["orbit"].x0, board.results["orbit"].x0)
    np.testing.assert_array_equal(found["branch"].parameter, board.results["branch"].parameter)
    np.testing.assert_array_equal(found["painted"].label, board.results["basins"].label)
    drawn = board.figures.diagram.largest.data
    order = np.argsort(drawn["parameter"])
    np.testing.assert_array_equal(found["diagram"].exponents.values[:, 0], np.array(drawn["value"])[order])


@pytest.mark.parametrize(
    "query", [{"section": "at each jump"}, {"section": "v", "level": "0.1", "part": "from the start"}]
)
def test_the_script_of_other_sections(opened, query):
    page = opened(models.impact_oscillator, query={"points": "50", **query})
    found = run(page.script())
    points = found["section"].x if "section" in found else found["run"].jumps.x_minus[200:]
    np.testing.assert_array_equal(points, page.board.live.points.x)
    np.testing.assert_array_equal(found["arc"].x, page.board.live.arc.x)
    assert 40 < len(points) <= 50


def test_the_branch_has_its_bifurcations(opened):
    page = opened(models.impact_oscillator, ranges={"w": (0.8, 2.0)})
    page.widgets.switches["branch"].value = True
    assert page.worker.wait(120)
    marks = page.board.figures.diagram.bifurcations.data
    # The fold of the closed form, and the grazing at w^2 = 2 - c^2.
    assert marks["kind"] == ["fold", "grazing"]
    np.testing.assert_allclose(marks["parameter"], [1.750142624, np.sqrt(1.99)], rtol=1e-8)
    assert "fold at 1.75014" in page.board.words["branch"]
    page.widgets.switches["branch"].value = False
    assert len(page.board.figures.diagram.bifurcations.data["kind"]) == 0


def test_an_unforced_orbit_is_judged_without_its_phase(opened):
    page = opened(models.rimless_wheel, x0=(0.1, 0.6))
    page.widgets.switches["orbit"].value = True
    assert page.worker.wait(120)
    assert "stable" in page.board.words["orbit"]
    assert "not stable" not in page.board.words["orbit"]
    # The speed after an impact is cos(2 alpha) of that before: the multiplier of the wheel.
    ratio = np.cos(2 * page.scene.values["alpha"]) ** 2
    assert f"largest multiplier {ratio:.6g}" in page.board.words["orbit"]


def test_a_click_starts_there(opened):
    page = opened(models.bouncing_ball, x0=(1.0, 0.0))
    page.start_here(0.5, 2.0)
    assert page.worker.wait(60)
    assert page.scene.x0 == {"q": 0.5, "v": 2.0}
    np.testing.assert_allclose(page.board.live.arc.x[0], [0.5, 2.0], rtol=1e-14)


def test_a_click_beyond_a_wall_is_answered(opened):
    page = opened(models.impact_oscillator)
    page.start_here(5.0, 0.0)
    assert page.worker.wait(60)
    assert page.board.live is not None


def test_a_click_where_modes_overlap_takes_the_nearest(opened):
    """A relay with hysteresis: both modes allow -0.5 < q < 0.5."""
    system = HybridSystem(
        state=("q",),
        modes=[Mode("up", lambda t, x, p: (1.0,)), Mode("down", lambda t, x, p: (-1.0,))],
        transitions=[
            Transition("up", "down", Guard(lambda t, x, p: x.q - 0.5, +1)),
            Transition("down", "up", Guard(lambda t, x, p: x.q + 0.5, -1)),
        ],
    )
    page = Page(subject(system, "", (0.0,), mode="down"), {}, lambda act: act())
    assert page.worker.wait(60)
    page.start_here(0.2, 0.2)
    assert page.worker.wait(60)
    assert page.scene.mode in ("up", "down")
    assert page.board.live.arc.status.ok
    page.close()


def test_jumps_are_stepped_through(opened):
    page = opened(models.bouncing_ball, x0=(1.0, 0.0))
    page.step(1)
    first = page.board.live.arc.jumps[0]
    assert "Jump 1 of" in page.widgets.event.object
    assert f"{first.transversality:.6g}" in page.widgets.event.object
    assert f"{first.saltation[1, 0]:.6g}" in page.widgets.event.object
    assert page.board.figures.arc.at.data["t"][0] == first.t
    page.step(1)
    assert "Jump 2 of" in page.widgets.event.object
    page.step(-5)
    assert "Jump 1 of" in page.widgets.event.object


def test_a_system_whose_modes_are_made_later_is_played_with(opened):
    """The modes of contacts are not those that the system had when the page was opened."""
    page = opened(block, query={"columns": "4"}, x0=(0.0, 1.0, 2.0, 0.0))
    arc = page.board.live.arc
    assert {"free", "floor sticks"} <= set(map(str, arc.mode))
    drawn = {
        name
        for name, place in page.board.figures.states.modes.items()
        if place in page.board.figures.arc.curves
    }
    assert set(map(str, arc.mode)) <= drawn
    page.step(1)
    assert "floor" in page.widgets.event.object
    for _ in range(3):
        page.tick()
    page.move("mu", 0.4)
    assert page.worker.wait(60)
    assert page.board.live.arc.status.ok


def test_the_point_runs_along_the_arc(opened):
    page = opened(models.bouncing_ball, x0=(1.0, 0.0))
    for _ in range(40):
        page.tick()
    data = page.board.figures.arc.at.data
    arc = page.board.live.arc
    np.testing.assert_allclose([data["x0"][0], data["x1"][0]], arc(arc.t[0] + data["t"][0]))
    assert "Jump" in page.widgets.event.object


def test_what_ends_early_is_said(opened):
    page = opened(models.bouncing_ball, x0=(1.0, 0.0))
    assert "ACCUMULATION" in said(page)
    assert "accumulates_to" in said(page)


def test_a_parameter_that_cannot_be_is_said_and_the_page_lives(opened):
    page = opened(models.impact_oscillator)
    page.move("w", 0.0)
    assert page.worker.wait(60)
    assert "period" in said(page)
    page.move("w", 1.0)
    assert page.worker.wait(60)
    assert page.board.words["portrait"] == page.board.words["section"] == ""


def test_hold_and_let_go(opened):
    page = opened(models.impact_oscillator)
    page.hold(True)
    np.testing.assert_array_equal(page.board.figures.section.held.data["x0"], page.board.live.points.x[:, 0])
    page.move("w", 1.2)
    assert page.worker.wait(60)
    assert page.board.figures.section.held.data["x0"][0] != page.board.live.points.x[0, 0]
    page.hold(False)
    assert len(page.board.figures.section.held.data["x0"]) == 0


def test_a_shared_address_opens_the_same_page(opened):
    page = opened(models.impact_oscillator)
    page.move("w", 0.9)
    page.change(points=100, up="x")
    assert page.worker.wait(60)
    again = opened(models.impact_oscillator, query=page.shared())
    np.testing.assert_array_equal(again.board.live.points.x, page.board.live.points.x)
    again.reset()
    assert again.worker.wait(60)
    assert again.scene.values["w"] == 1.0


def test_one_cause_is_said_once(opened):
    """All pictures end with the jumps that accumulate, and one sentence says so."""
    page = opened(models.bouncing_ball, x0=(1.0, 0.0))
    top = page.widgets.messages["top"].text
    assert "Portrait, section and exponents: ACCUMULATION" in top
    assert said(page).count("ACCUMULATION") == 1
    for switch in ("orbit", "branch"):
        page.widgets.switches[switch].value = True
    page.move("e", -1e300)
    assert page.worker.wait(60)
    sentences = [each for each in said(page).replace("</p>", "<p>").split("<p>") if each.strip()[:1] != "<"]
    assert len(sentences) == len(set(sentences))


def test_what_follows_the_section_ends_as_it_does(opened):
    page = opened(models.impact_oscillator, query={"p.w": "0"})
    for switch in ("orbit", "branch"):
        page.widgets.switches[switch].value = True
    assert page.worker.wait(60)
    assert page.board.words["orbit"] == page.board.words["branch"] == page.board.words["section"] != ""
    assert "Portrait, section, exponents, orbit and branch: " in page.widgets.messages["top"].text
    assert said(page).count(page.board.words["section"].replace("'", "&#x27;")) == 1


def test_an_unforced_orbit_of_one_state_is_told(opened):
    """Its only multiplier is that of the phase."""
    page = opened(lambda: RELAY, x0=(0.0,), mode="up")
    page.widgets.switches["orbit"].value = True
    assert page.worker.wait(60)
    assert page.board.words["orbit"].startswith("period 2, 2 jumps, ")
    assert "stable" in page.board.words["orbit"]


def test_basins_need_a_plane(opened):
    page = opened(lambda: RELAY, x0=(0.0,), mode="up")
    page.widgets.switches["basins"].value = True
    assert page.worker.wait(60)
    assert "must be two components" in page.board.words["basins"]


def test_a_run_that_ends_has_no_orbit(opened):
    page = opened(lambda: FALL, x0=(1.0, 0.0))
    page.widgets.switches["orbit"].value = True
    assert page.worker.wait(60)
    assert "the arc ends before it can come back" in page.board.words["orbit"]
    assert page.saved("exponents", "png") is None
    assert "nothing has been drawn of &#x27;exponents&#x27; yet" in said(page)


def test_the_page_has_the_limits_of_an_address(opened):
    page = opened(models.impact_oscillator)
    before = page.scene
    for field, value in (("points", 10**9), ("window", -1.0), ("level", float("nan")), ("columns", 10**9)):
        page.change(**{field: value})
        assert page.scene is before
        assert f"{field} must be" in said(page)
    page.change(points=100)
    assert page.scene.points == 100
    assert "must be" not in said(page)


def test_a_click_beyond_a_slider_moves_its_end(opened):
    page = opened(models.impact_oscillator)
    page.move("w", 9.0)
    assert page.worker.wait(60)
    slider = page.widgets.sliders["w"]
    assert (slider.value, slider.end) == (9.0, 9.0)


def test_a_picture_that_is_not_there_can_be_held(opened):
    page = opened(models.vibroimpact, query={"p.omega": "0", "columns": "2"})
    assert page.board.live is None
    page.hold(True)
    page.hold(False)


def test_a_system_without_parameters_or_jumps(opened):
    system = HybridSystem(state=("x", "v"), modes=[Mode("free", lambda t, x, p: (x.v, -x.x))])
    page = Page(subject(system, "", (1.0, 0.0)), {}, lambda act: act())
    assert page.worker.wait(60)
    assert page.scene.section == "x"
    page.step(1)
    assert "no jumps" in said(page)
    page.close()


def test_starts_lie_on_the_near_side_of_guards():
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("flight", lambda t, x, p: (x.v, -9.81))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q - 30.0, -1),
                Reset(lambda t, x, p: (30.0, -0.5 * x.v)),
            )
        ],
    )
    with pytest.raises(ArgumentError, match="No start was found"):
        subject(system, "")
    assert subject(system, "", (31.0, 0.0)).x0 == pytest.approx({"q": 31.0, "v": 0.0}, rel=1e-14)


@pytest.mark.parametrize(
    ("ranges", "said"),
    [
        ({"wrong": (0.0, 1.0)}, "ranges: Parameter 'wrong' does not exist"),
        ({"w": (2.0, 1.0)}, "ranges: Range of 'w'"),
        ({"w": (1.0, 1.0)}, "must be (low, high) with low < high"),
    ],
)
def test_ranges_are_checked(ranges, said):
    with pytest.raises(ArgumentError) as raised:
        subject(models.impact_oscillator(), "", ranges=ranges)
    assert said in str(raised.value)


def test_a_split_system_starts_in_a_mode_that_its_author_named():
    equations = from_equations(
        lambda t, x, p: (x.v, -x.q - 0.3 * np.sign(x.v) + np.cos(t)), state=("q", "v"), period=2 * np.pi
    )
    found = subject(equations, "")
    assert found.mode in {each.part_of for each in equations.modes}
    page = Page(found, {"mode": found.mode}, lambda act: act())
    assert page.worker.wait(120)
    assert page.board.words["address"] == ""
    assert page.board.live.arc.status.ok
    page.close()
