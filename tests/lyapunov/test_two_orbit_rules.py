"""The two-orbit method rule by rule: how runs are followed, placed and judged."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.status import SUCCESS, StatusCode
from lyapunov import two_orbit


class Followed:
    """Three runs whose distances after interval ``i`` are ``i`` and ``-i``, followed by a kernel in Python.

    Each call of the kernel makes as many intervals as ``made`` says next, or all; after its last entry the
    code is ``last``.
    """

    def __init__(self, monkeypatch, *, made=(), last=codes.DONE, most=250):
        self.made, self.last, self.calls, self.done, self.told = [*made], last, [], 0, []
        self.runs = [self.run(place) for place in range(3)]
        monkeypatch.setattr(two_orbit, "INTERVALS_AT_ONCE", most)
        monkeypatch.setattr(two_orbit, "load_kernels", self.kernels)
        monkeypatch.setattr(two_orbit, "Bursts", lambda runs: self)
        monkeypatch.setattr(two_orbit, "end_at", lambda run: self.end)
        monkeypatch.setattr(two_orbit, "status_of", lambda run, code: (run, code))
        self.end = SimpleNamespace(cycle=7, phase=0.25, done=99, counters="counters", numbers="numbers")
        self.steps = 11

    def run(self, place):
        def called(more, *memory):
            words = [part for run in self.runs for part in (run.run, run.work)]
            assert memory == ("counters", "numbers", *words)
            return more("parts")

        return SimpleNamespace(
            run=SimpleNamespace(cycle=7, phase=0.25),
            work=f"work of {place}",
            plan=SimpleNamespace(called=called),
            max_steps=1000,
            no_record=lambda: "record",
            task=lambda record: f"task of {place} with {record}",
        )

    def kernels(self, module=None):
        return SimpleNamespace(distances=self.distances) if module else SimpleNamespace(advance="advance")

    def most(self):
        self.steps = 22

    def judged(self, code):
        # A burst that used up its steps is no end.
        return codes.GO_ON if code == codes.MAX_STEPS else code

    def distances(self, advance, parts, one, two, three, end, *numbers):
        interval, separation, most, burst, resumed, out = numbers
        assert (advance, parts) == ("advance", "parts")
        assert [one, two, three] == [f"task of {place} with record" for place in range(3)]
        assert (end, end.done, interval, separation, most, burst) == (self.end, 0, 0.5, 1e-3, 1000, 22)
        self.calls.append((len(out), resumed))
        assert len(self.calls) < 20
        count = self.made.pop(0) if self.made else len(out)
        for i in range(count):
            self.done += 1
            out[i] = self.done, -self.done
        end.done = count
        return codes.MAX_STEPS if count < len(out) and self.made else self.last

    def follow(self, intervals):
        bar = SimpleNamespace(update=self.told.append)
        distances, status = two_orbit._follow(self.runs[0], self.runs[1:], 1e-3, 0.5, intervals, bar)
        assert distances.tolist() == [[i, -i] for i in range(1, self.done + 1)]
        return status


@pytest.mark.parametrize(
    ("intervals", "calls"),
    [(1, [(1, False)]), (4, [(4, False)]), (5, [(4, False), (1, False)]), (8, [(4, False), (4, False)])],
)
def test_orbits_are_followed_so_many_intervals_at_once(intervals, calls, monkeypatch):
    followed = Followed(monkeypatch, most=4)
    assert followed.follow(intervals) == (followed.runs[0], codes.DONE)
    assert followed.calls == calls
    assert (followed.done, followed.told) == (intervals, [each for each, _ in calls])


def test_a_burst_that_ends_within_an_interval_is_resumed(monkeypatch):
    followed = Followed(monkeypatch, made=(1, 0, 2, 1), most=3)
    assert followed.follow(4) == (followed.runs[0], codes.DONE)
    assert followed.calls == [(3, False), (3, True), (3, True), (1, True)]
    assert followed.told == [1, 0, 2, 1]


@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_status_is_that_of_the_run_that_did_not_arrive(place, monkeypatch):
    followed = Followed(monkeypatch, made=(2,), last=codes.NON_FINITE)
    followed.runs[place].run.phase = 0.125
    assert followed.follow(5) == (followed.runs[place], codes.NON_FINITE)
    assert (followed.done, len(followed.calls)) == (2, 1)


def judged(renormalised, free=(1.0, 1.0, 1.0), separation=1e-4, size=1.0):
    return two_orbit._judged(SUCCESS, np.array(free), np.array(renormalised), separation, size)


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_distances_within_4096_roundings_of_the_state_are_lost(size):
    limit = 4096 * 2.0**-52 * size
    assert judged([1.01 * limit, 1e-4, 1e-4], size=size) is SUCCESS
    status = judged([limit, 0.5 * limit, 1e-4], size=size)
    assert status.code == StatusCode.INDISTINCT_TANGENTS
    assert "On 2 of 3 intervals the renormalised companion came within rounding" in status.message
    assert judged([2e-290, 1e-4, 1e-4], size=0.0) is SUCCESS
    assert "On 1 of 3" in judged([1e-290, 1e-4, 1e-4], size=0.0).message


def test_distances_as_large_as_those_of_any_two_orbits_are_no_growth():
    """Three hundredths of the largest distance of the free companion, if it has grown by a hundred."""
    assert judged([0.06, 0.06, 0.05], free=(1.0, 2.0, 1.5)) is SUCCESS
    status = judged([0.0601, 0.07, 0.05], free=(1.0, 2.0, 1.5))
    assert status.code == StatusCode.INDISTINCT_TANGENTS
    assert "On 2 of 3 intervals the renormalised companion came as far" in status.message
    assert judged([0.099, 0.1, 0.05], free=(1.0, 2.0, 1.5), separation=1e-3) is SUCCESS
    assert "On 1 of 3" in judged([0.101, 0.1, 0.05], free=(1.0, 2.0, 1.5), separation=1e-3).message


def test_logarithms_of_quotients():
    found = two_orbit._log_ratio(np.array([np.e, 0.0, 1e-300, 2.0]), np.array([1.0, 1.0, 1e300, 0.0]))
    assert found == pytest.approx([1.0, -np.inf, -600 * np.log(10.0), -np.inf])
    assert two_orbit._log_ratio(np.array([np.e**2, 0.0]), 1.0) == pytest.approx([2.0, -np.inf])


def test_directions():
    system = SimpleNamespace(dimension=2)
    assert two_orbit._unit_vector(None, system) == pytest.approx([0.5**0.5] * 2)
    for scale in (1e-320, 1.0, 1e300):
        assert two_orbit._unit_vector((-3 * scale, 4 * scale), system) == pytest.approx([-0.6, 0.8], rel=1e-3)
    for wrong in ((), (1.0,), (0.0, 0.0), (1.0, np.inf), (np.nan, 1.0), ((1.0, 0.0),)):
        with pytest.raises(ArgumentError, match=r"direction must be a finite vector of shape \(2,\)"):
            two_orbit._unit_vector(wrong, system)


def test_the_clock_must_reach_the_end_of_all_intervals(monkeypatch):
    """The message counts those of the transient too."""
    late = SimpleNamespace(model=SimpleNamespace(period=0.0), t=2.0**52)
    monkeypatch.setattr(two_orbit, "start", lambda *given, **options: late)
    monkeypatch.setattr(two_orbit, "as_system", lambda name, system: system)
    system = SimpleNamespace(growth=None, dimension=1)
    with pytest.raises(ArgumentError, match="and 7 intervals"):
        two_orbit.two_orbit_exponents(system, (0.0,), interval=1.0, intervals=5, transient=2)


@pytest.mark.parametrize(
    ("period", "interval", "wanted"),
    [(2.0, 2.0, ("to", 8, 0.5)), (2.0, 1.0, ("until", 13.5)), (0.0, 1.0, ("until", 13.5))],
)
def test_intervals_that_are_forcing_periods_are_counted(period, interval, wanted):
    """The other intervals go to a time, which is rounded."""
    run = SimpleNamespace(
        t=10.5,
        model=SimpleNamespace(period=period),
        run=SimpleNamespace(cycle=5, phase=0.5),
        no_record=lambda: "record",
        advance_to=lambda cycle, phase, record: ("to", cycle, phase),
        advance=lambda t, record: ("until", t),
    )
    assert two_orbit._skip(run, 3, interval) == wanted
