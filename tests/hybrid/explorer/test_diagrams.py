"""The bifurcation diagram: what it shows, why it is empty, and how it is saved."""

from base64 import b64decode

import attrs
import pytest

import models
from hybrid import Mode
from hybrid.explorer.diagrams import diagram_call
from hybrid.explorer.page import Page
from hybrid.explorer.subject import subject
from hybrid.explorer.worker import Job, Outcome
from hybrid.status import StatusCode
from tests.hybrid.explorer.pages import FALL, said


def test_the_diagram_keeps_while_its_parameter_moves(opened):
    page = opened(models.impact_oscillator)
    before = list(page.board.figures.diagram.points.data["parameter"])
    page.move("w", 1.1)
    assert page.worker.wait(60)
    assert list(page.board.figures.diagram.points.data["parameter"]) == before
    page.move("c", 0.11)
    assert page.worker.wait(60)
    assert len(page.board.figures.diagram.largest.data["parameter"]) == 12


def test_the_ends_of_the_diagram_are_typed_one_after_the_other(opened):
    page = opened(models.impact_oscillator)
    page.change(low=5.0)
    assert "Diagram: it needs from" in said(page)
    page.change(low=0.5)
    assert "it needs from" not in said(page)
    page.change(low=5.0)
    page.change(high=6.0)
    assert page.worker.wait(60)
    assert (page.scene.low, page.scene.high) == (5.0, 6.0)
    assert min(page.board.figures.diagram.largest.data["parameter"]) == 5.0


def test_words_about_columns_are_those_of_a_column_that_ended(opened):
    """A column that reached its end may carry a remark; it is not why another one ended early."""
    page = opened(models.impact_oscillator)
    chart = diagram_call(page.subject, page.scene).result(progress=False)
    chart["message"] = chart.message.astype(object)
    chart.message[:2] = ["a remark", "the cause"]
    chart.status[1] = StatusCode.NON_FINITE
    job = Job("diagram", "another", (lambda: None,))
    page.show(Outcome(job, 0, (page.scene, chart), "", 0.0))
    at = float(chart["w"][1])
    assert page.board.words["diagram"] == f"1 column ended early; at w = {at:.6g}: the cause"


WITH_GRAVITY = attrs.evolve(FALL, parameters={"g": 9.81}, modes=[Mode("fall", lambda t, x, p: (x.v, -p.g))])


class TestADiagramWithoutColumnsSaysWhy:
    @staticmethod
    def why(page):
        assert not len(page.board.figures.diagram.points.data["parameter"])
        assert page.board.words["diagram"] in page.widgets.messages["diagram"].text.replace("&#x27;", "'")
        return page.board.words["diagram"]

    def test_every_run_ends_early(self, opened):
        page = opened(lambda: WITH_GRAVITY, x0=(1.0, 0.0))
        assert self.why(page).startswith("it has no column, since every run ended early; at g = ")
        assert "'ground'" in self.why(page)

    def test_no_run_passes_the_section(self, opened):
        page = opened(models.impact_oscillator, query={"section": "x", "level": "50.0", "columns": "2"})
        assert "no run passes the section. Choose another section, or another level" in self.why(page)

    def test_the_parameter_cannot_have_these_values(self, opened):
        page = opened(models.impact_oscillator)
        page.change(low=-1.0)
        page.change(high=-0.5)
        assert page.worker.wait(60)
        assert "period must be positive" in self.why(page)
        assert page.saved("diagram", "png") is None

    def test_there_is_no_parameter(self, opened):
        page = opened(lambda: FALL, x0=(1.0, 0.0))
        assert "the model has no parameter to draw it over" in self.why(page)

    def test_it_is_not_there_yet(self):
        waiting = []
        page = Page(subject(models.impact_oscillator(), ""), {}, waiting.append)
        assert "Diagram: being computed." in page.widgets.messages["diagram"].text
        assert self.why(page) == "being computed."
        page.widgets.switches["branch"].value = True
        assert "Branch and diagram: being computed." in page.widgets.messages["diagram"].text
        page.close(wait=False)

    def test_it_is_silent_where_there_are_columns(self, opened):
        page = opened(models.impact_oscillator)
        assert page.board.words["diagram"] == ""


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_pictures_are_saved(opened, suffix):
    page = opened(models.impact_oscillator)
    for picture in ("portrait", "section", "time series", "exponents", "diagram"):
        file = page.saved(picture, suffix).read()
        assert file[:4] == b"\x89PNG" if suffix == "png" else b"<svg" in file
    assert page.saved("orbit", suffix) is None
    assert "nothing has been drawn of &#x27;orbit&#x27; yet" in said(page)


def test_a_saved_diagram_shows_its_branch_and_is_named_after_the_model(opened):
    page = opened(models.impact_oscillator, ranges={"w": (0.8, 2.0)})
    alone = page.saved("diagram", "svg").read()
    page.widgets.switches["branch"].value = True
    assert page.worker.wait(120)
    page.widgets.picture.value, page.widgets.format.value = "diagram", "svg"
    page.widgets.save_picture.param.trigger("clicks")
    name, url, number = page.widgets.sent.tags
    assert name == "impact_oscillator_diagram.svg"
    assert b64decode(url.partition("base64,")[2]).count(b"<path") > alone.count(b"<path")
    page.widgets.save_picture.param.trigger("clicks")
    # The browser saves it again, too.
    assert page.widgets.sent.tags[2] == number + 1
