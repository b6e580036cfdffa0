"""The memory of a run is as large as its description says: kernels write to it unchecked."""

import numpy as np
import pytest

import hybrid
from hybrid.simulation import memory


class TestRecordsThatFillTheMemory:
    """An oscillator of frequency one, with a marker of each upward passage through zero."""

    SYSTEM = hybrid.HybridSystem(
        state=("q", "v"),
        modes=[hybrid.Mode("swing", lambda t, x, p: (x.v, -x.q))],
        transitions=[hybrid.Transition("swing", "swing", hybrid.Guard(lambda t, x, p: x.q, +1))],
    )

    @pytest.fixture
    def small(self, monkeypatch):
        monkeypatch.setattr("hybrid.simulation.recorder.memory_for_records", lambda: 1e6)

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
