"""The memory of a run is as large as its description says: kernels write to it unchecked."""

import numpy as np
import pytest

import hybrid
from hybrid.kernels.types import codes
from hybrid.kernels.types.layout import COUNTERS, NUMBERS
from hybrid.simulation import memory
from hybrid.simulation.plan import kernel_method

# States, tangent vectors, columns of series and rows of programs.
N, K, COLUMNS, ROWS = 3, 2, 11, 7
LENGTH = N * (1 + K)


@pytest.fixture
def shapes(monkeypatch):
    """The layouts as plain shapes."""
    monkeypatch.setattr(memory, "Layout", lambda kind, shapes: shapes)
    return lambda layout, *sizes: layout.__wrapped__(*sizes)


@pytest.mark.parametrize(
    ("solver", "stages", "degree", "coupled", "order", "nodes", "places"),
    [
        # Stages with those of the interpolant, its degree, coupled stages, order of the series, nodes, of
        # which those of a series are more than those of Radau; nodes and stages of the interpolant alone.
        (hybrid.DOP853(), 16, 7, 0, 0, 8, 8 + 3),
        (hybrid.Tsit5(), 7, 4, 0, 0, 6, 6),
        (hybrid.Taylor(rtol=1e-9), 16, 7, 0, None, 8, 8 + 3),
        (hybrid.RadauIIA(), 4, 3, 3, 0, 6, 4),
    ],
)
def test_a_workspace(shapes, solver, stages, degree, coupled, order, nodes, places):
    method = kernel_method(solver, solver.by_series)
    order = method.order if order is None else order
    # Whole registers of eight columns; three more rows than the order for the error and two of scratch.
    series = (codes.HIGHEST_ORDER + 3, 16) if order else (0, 0)
    width = (max(degree, codes.HIGHEST_ORDER) if order else degree) + 4
    assert shapes(memory.work_layout, method, N, K, COLUMNS, ROWS) == {
        "stages": (stages, LENGTH + 1),
        "speeds": (stages,),
        **dict.fromkeys(("trial", "new", "error", "second_error"), (LENGTH,)),
        **dict.fromkeys(("jacobian", "reset_jacobian"), (N, N + 1)),
        "gradient": (N + 1,),
        "scalar": (1,),
        **dict.fromkeys(("field", "field_after", "state", "settled", "departure", "scale_before"), (N,)),
        **dict.fromkeys(("saltation", "sizes"), (N, N)),
        "rounding": (4, N),
        "path": (degree + 1, N),
        "polynomial": (width,),
        "stack": (64, width),
        "intervals": (64, 2),
        # The matrix of the stages, that of the filter, the right-hand side, and the last step with four more.
        "systems": (N + coupled * N + coupled + 4, coupled * N),
        "pivots": ((coupled + 1) * N,),
        "series": series,
        "weights": (1, 16),
        "registers": (ROWS, 6),
        "samples": (nodes + 1, 2 * ROWS),
        "places": (places, N + 1),
    }


def test_a_record(shapes):
    assert shapes(memory.record_layout, N, 7, 11, 13) == {
        "used": (4,),
        **dict.fromkeys(("step_time", "step_place"), (11, 3)),
        "step_coefficients": (11, 8, N + 1),
        "jump_time": (13, 2),
        "jump_place": (13, 4),
        "jump_states": (13, 2, N),
        "jump_saltation": (13, N, N),
        **dict.fromkeys(("grazing_time", "grazing_place"), (13, 3)),
        "grazing_state": (13, N),
    }


def test_a_run(shapes):
    assert shapes(memory.run_layout, N, K, 4, 5) == {
        "counters": (len(COUNTERS),),
        "numbers": (len(NUMBERS),),
        "y": (LENGTH,),
        **dict.fromkeys(("side", "on_guard", "due"), (5,)),
        "recent": (64,),
        "rehearsal": (4, 5),
        "passed": (5,),
        "visits": (64, N + 2),
        **dict.fromkeys(("first_step", "stay"), (4,)),
        **dict.fromkeys(("scale", "stretch"), (N,)),
        **dict.fromkeys(("growth", "growth_before"), (K,)),
        "trail": (4, N + 1),
        "before": (N * K,),
        "instant": (N * (1 + N),),
    }


def test_a_fresh_run_is_in_no_mode_and_has_not_jumped():
    system = hybrid.compile_system(hybrid.HybridSystem(
        state=("x", "y"), modes=[hybrid.Mode("m", lambda t, x, p: (0.0, 0.0))], period=2.0
    ))  # fmt: skip
    tangent = np.array([[1.0, 2.0], [3.0, 4.0]])
    layout = memory.run_layout(2, 2, 1, 0)
    run, phase = memory.fresh_run(layout, system.model(), np.array([5.0, -6.0]), tangent, 7.0)
    assert (run.cycle, run.phase, phase) == (3, 1.0, 1.0)
    # State, then one tangent vector after the other.
    assert run.y.tolist() == [5.0, -6.0, 1.0, 3.0, 2.0, 4.0]
    assert run.scale.tolist() == [5.0, 6.0]
    assert (run.stage, run.last_fired, run.pending, run.previous_mode) == (
        codes.ENTERING,
        codes.NO_TRANSITION,
        codes.NO_TRANSITION,
        codes.NO_MODE,
    )
    assert np.isnan(run.last_jump_phase)
    assert (run.steps, run.jumps) == (0, 0)


def test_records_keep_nothing_at_first_and_implicit_methods_have_no_last_step():
    assert memory.empty_record(2, 7, 5, 3).used.tolist() == [0, 0, 0, 0]
    for solver, last in ((hybrid.RadauIIA(), -1.0), (hybrid.DOP853(), None)):
        work = memory.workspace(kernel_method(solver, solver.by_series), 2, 0, 8)
        assert work.systems[-1].tolist() == ([] if last is None else [last] * 6)


class TestRecordsThatFillTheMemory:
    """An oscillator of frequency one, with a marker of each upward passage through zero."""

    SYSTEM = hybrid.HybridSystem(
        state=("q", "v"),
        modes=[hybrid.Mode("swing", lambda t, x, p: (x.v, -x.q))],
        transitions=[hybrid.Transition("swing", "swing", hybrid.Guard(lambda t, x, p: x.q, +1))],
    )

    @pytest.fixture
    def small(self, monkeypatch):
        monkeypatch.setattr("hybrid.simulation.simulate.memory_for_records", lambda: 1e6)

    def test_the_run_ends_with_what_it_has(self, small):
        arc = hybrid.simulate(self.SYSTEM, (0.0, 1.0), (0.0, 1e6), mode="swing")
        assert arc.status.code == hybrid.StatusCode.OUT_OF_MEMORY
        assert not arc.status.ok
        assert "samples=" in arc.status.remedy
        assert f"at t = {arc.t[-1]:.12g} in mode 'swing'" in arc.status.message
        assert 100.0 < arc.t[-1] < 1e5
        np.testing.assert_allclose(arc.x[:, 0], np.sin(arc.t), rtol=0, atol=1e-9)
        np.testing.assert_allclose(arc(50.0), [np.sin(50.0), np.cos(50.0)], rtol=0, atol=1e-9)

    def test_samples_need_no_steps(self, small):
        end = 2e4
        arc = hybrid.simulate(self.SYSTEM, (0.0, 1.0), (0.0, end), mode="swing", samples=[1.0, end])
        assert arc.status.ok
        np.testing.assert_allclose(arc.x[:, 0], np.sin([1.0, end]), rtol=0, atol=1e-8)

    def test_jumps_count_too(self, small):
        arc = hybrid.simulate(
            self.SYSTEM, (0.0, 1.0), (0.0, 1e6), mode="swing", samples=[1e6], keep_jumps=True
        )
        assert arc.status.code == hybrid.StatusCode.OUT_OF_MEMORY
        assert len(arc.jumps) == int(arc.jumps[-1].t / (2 * np.pi) + 0.5)

    def test_without_its_jumps_a_run_of_samples_keeps_nothing_that_grows(self, small):
        end = 2e5
        arc = hybrid.simulate(
            self.SYSTEM, (0.0, 1.0), (0.0, end), mode="swing", samples=[1.0, end], max_jumps=10**6
        )
        assert arc.status.ok
        assert arc.jump_count == int(end / (2 * np.pi))
        assert not arc.keeps_jumps
        assert repr(arc) == f"<HybridArc t = 1 to 200000, {arc.jump_count} jumps, SUCCESS>"
        with pytest.raises(hybrid.ArgumentError, match=r"did not keep its jumps.*keep_jumps=True"):
            len(arc.jumps)

    def test_the_jumps_of_a_whole_arc_belong_to_its_points(self):
        with pytest.raises(hybrid.ArgumentError, match="keep_jumps=False needs samples="):
            hybrid.simulate(self.SYSTEM, (0.0, 1.0), (0.0, 1.0), mode="swing", keep_jumps=False)

    def test_the_room_is_a_third_of_the_memory(self, monkeypatch):
        pages = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 3000}
        room = memory.memory_for_records.__wrapped__
        monkeypatch.setattr(memory.os, "sysconf", pages.get, raising=False)
        for limit, found in (("max\n", 4096 * 1000), ("6000000\n", 2e6), ("99999999999999\n", 4096 * 1000)):
            monkeypatch.setattr(memory.Path, "read_text", lambda *given, limit=limit, **named: limit)
            assert room() == found

        def absent(*given, **named):
            raise FileNotFoundError

        monkeypatch.setattr(memory.Path, "read_text", absent)
        assert room() == 4096 * 1000
        monkeypatch.delattr(memory.os, "sysconf")
        assert room() == np.inf
