"""Outputs on the page stand where components stand."""

import attrs
import numpy as np
import pytest

import models
from hybrid.explorer.page import Page
from hybrid.explorer.subject import subject
from tests.hybrid.explorer.pages import said


class TestOutputs:
    @staticmethod
    def oscillator():
        """The driven oscillator at a stop, with an energy."""
        system = models.impact_oscillator()
        more = {
            "stored": lambda t, x, p: x.v**2 / 2 + p.k * x.x**2 / 2,
            "drive": {"flight": lambda t, x, p: p.A * np.cos(p.w * t)},
        }
        return attrs.evolve(system, outputs=system.outputs | more)

    @pytest.fixture
    def page(self):
        page = Page(subject(self.oscillator(), ""), {"columns": "6", "points": "50"}, lambda act: act())
        assert page.worker.wait(120)
        yield page
        page.close()

    @staticmethod
    def stored(x):
        return x[:, 1] ** 2 / 2 + x[:, 0] ** 2 / 2

    def column(self, page, source, name):
        return np.asarray(source.data[page.board.figures.states.column(name)])

    def test_none_is_computed_until_it_is_shown(self, page):
        points = page.board.figures.section.points
        assert np.isnan(self.column(page, points, "stored")).all()

    def test_in_the_plane_and_over_time(self, page):
        page.change(up="stored", over_time="drive")
        assert page.worker.wait(120)
        figures, live = page.board.figures, page.board.live
        found = self.column(page, figures.section.points, "stored")
        np.testing.assert_allclose(found, self.stored(live.points.x), rtol=1e-12)
        assert np.isfinite(self.column(page, figures.arc.curves[0], "drive")).any()
        assert figures.arc.portrait.yaxis[0].axis_label == "stored"
        assert figures.arc.series_axes.wanted[1] == pytest.approx((-1.0, 1.0), abs=1e-3)
        assert np.isfinite(self.column(page, figures.arc.start, "stored")).all()
        after = f"b{figures.states.names.index('stored')}"
        assert np.isfinite(np.asarray(figures.arc.jumps.data[after])).all()

    def test_in_the_diagram_and_on_the_branch(self, page):
        page.widgets.switches["orbit"].value = True
        page.widgets.switches["branch"].value = True
        page.change(across="stored")
        assert page.worker.wait(120)
        diagram = page.board.figures.diagram
        drawn, x = self.column(page, diagram.points, "stored"), self.column(page, diagram.points, "x")
        np.testing.assert_allclose(
            drawn, self.stored(np.column_stack([x, self.column(page, diagram.points, "v")])), rtol=1e-12
        )
        assert np.isfinite(self.column(page, diagram.stable, "stored")).any()
        assert "outputs=['stored']" in page.script()
        assert np.isfinite(self.column(page, page.board.figures.section.orbit, "stored")).all()

    def test_the_point_that_runs_and_jumps(self, page):
        page.change(up="stored")
        assert page.worker.wait(120)
        page.tick()
        assert np.isfinite(self.column(page, page.board.figures.arc.at, "stored")).all()
        page.step(1)
        assert np.isfinite(self.column(page, page.board.figures.arc.at, "stored")).all()

    def test_an_output_is_no_coordinate_of_a_start(self, page):
        page.change(up="stored")
        before = page.scene.x0
        page.start_here(0.1, 0.2)
        assert page.scene.x0 == before
        assert "an output is no coordinate of a start" in said(page)
        page.widgets.switches["basins"].value = True
        assert page.worker.wait(120)
        assert "must be two components of the state" in page.board.words["basins"]

    def test_an_address_and_a_saved_picture(self, page):
        page.change(up="stored")
        assert page.worker.wait(120)
        assert page.shared()["up"] == "stored"
        assert page.saved("section", "png").read()[:4] == b"\x89PNG"
        assert page.saved("portrait", "png").read()[:4] == b"\x89PNG"
        page.reset()
        assert page.scene.up == "v"
