"""Ctrl-C ends any call soon and keeps the results so far."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import hybrid
import lyapunov
import models
from hybrid import StatusCode
from hybrid.compiler.interrupts import CTRL_C, CtrlC
from hybrid.simulation import interrupt
from lyapunov.two_orbit import INTERVALS_AT_ONCE

RISING = hybrid.Guard(lambda t, x, p: x.v, +1)
ROOT = Path(__file__).parents[3]
PROGRAM = """
import os, signal, sys, threading, time
import hybrid, lyapunov, models
signal.signal(signal.SIGINT, signal.default_int_handler)
system, start = models.impact_oscillator(), (0.0, 0.0)
rising = hybrid.Guard(lambda t, x, p: x.v, +1)
never = hybrid.Guard(lambda t, x, p: x.v - 1e9, +1)
hybrid.poincare_section(system, start, never, points=1, solver=hybrid.Taylor(max_steps=100))
marked = hybrid.poincare_section(system, start, rising, points=1)
slow = hybrid.DOP853(rtol=1e-13, atol=1e-15)

def kept(result, what):
    status = getattr(result, "status", None)
    print(status.code.name if hasattr(status, "code") else "", what, flush=True)

def simulate():
    arc = hybrid.simulate(system, start, (0.0, 1e9), samples=[1.0, 1e9], max_jumps=10**9)
    kept(arc, len(arc.t))

def dense():
    arc = hybrid.simulate(system, start, (0.0, 1e9), max_jumps=10**9)
    kept(arc, arc.t[-1] > 100.0)

def spectrum():
    found = lyapunov.lyapunov_spectrum(system, start, interval=1e8, transient=0)
    kept(found, found.intervals)

def long_spectrum():
    found = lyapunov.lyapunov_spectrum(system, start, intervals=10**9, transient=0, history=False)
    kept(found, found.intervals > 100 and abs(found.sum_defect) < 1e-6)

def two_orbits():
    found = lyapunov.two_orbit_exponents(system, start, interval=1e8)
    kept(found, found.intervals)

def strobe():
    found = hybrid.stroboscopic_section(system, start, periods=10**9, solver=slow)
    kept(found, len(found) > 100)

def poincare():
    found = hybrid.poincare_section(system, start, rising, points=10**9)
    kept(found, len(found) > 100)

def missed():
    found = hybrid.poincare_section(system, start, never, points=2)
    kept(found, len(found))

def orbit():
    found = hybrid.periodic_orbit(system, start, periods=10**8, solver=slow)
    kept(found, found.x0.shape)

def error():
    found = hybrid.global_error(system, start, (0.0, 1e8), solver=slow, max_jumps=10**9)
    kept(found, found.arc.status.code.name)

def work():
    found = hybrid.work_precision(
        system, start, (0.0, 1e9), reference=start, methods={"slow": slow}, tolerances=[1e-3], repeats=1
    )
    kept(found, found.status.tolist())

def compared():
    found = lyapunov.compare_models({"a": system, "b": system}, start, reference="a", interval=1e8)
    kept(found, found.status.code.name)

def chart():
    found = lyapunov.chart(system, {"c": [0.1, 0.2, 0.3]}, start, interval=1e8, transient=0, executor=2)
    kept(None, {hybrid.StatusCode(int(code)).name for code in found.status})

hybrid.global_error(system, start, (0.0, 1.0), solver=slow)
lyapunov.chart(system, {"c": [0.1]}, start, intervals=2, transient=0, section=1, executor=1)
lyapunov.lyapunov_spectrum(system, start, intervals=1)
lyapunov.two_orbit_exponents(system, start, intervals=1)
hybrid.simulate(system, start, (0.0, 1.0), samples=[0.5, 1.0])
hybrid.stroboscopic_section(system, start, periods=1, solver=slow)
hybrid.periodic_orbit(system, (0.9, 1.0), max_iterations=1)

def press():
    global sent
    sent = time.process_time()
    os.kill(os.getpid(), signal.SIGINT)

for name in sys.argv[1:]:
    threading.Timer(0.3, press).start()
    globals()[name]()
    print(time.process_time() - sent, flush=True)
"""
CALLS = {
    "simulate": "INTERRUPTED 1",
    "dense": "INTERRUPTED True",
    "spectrum": "INTERRUPTED 0",
    "long_spectrum": "INTERRUPTED True",
    "two_orbits": "INTERRUPTED 0",
    "strobe": "INTERRUPTED True",
    "poincare": "INTERRUPTED True",
    "missed": "INTERRUPTED 0",
    "orbit": "INTERRUPTED (2,)",
    "error": "INTERRUPTED INTERRUPTED",
    "work": " ['INTERRUPTED']",
    "compared": "INTERRUPTED INTERRUPTED",
    "chart": " {'NOT_RUN'}",
}


@pytest.fixture(autouse=True)
def python_hears_interrupts():
    """Background processes of a shell ignore interrupts, so enable them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_real_interrupts():
    """Processor time is measured, so that other programs on the machine have no effect."""
    child = subprocess.run(
        [sys.executable, "-c", PROGRAM, *CALLS],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert child.returncode == 0, child.stderr
    lines = child.stdout.splitlines()
    found = dict(zip(CALLS, lines[::2], strict=True))
    late = dict(zip(CALLS, map(float, lines[1::2]), strict=True))
    assert found == CALLS, late
    assert max(late.values()) < 0.5, late


@pytest.fixture
def pressed(monkeypatch):
    """Press Ctrl-C at the n-th check for an interrupt."""

    def at(question):
        asked = iter(range(1, 10**9))
        answer = CtrlC.is_set

        def is_set(self):
            if next(asked) == question:
                os.kill(os.getpid(), signal.SIGINT)
            return answer(self)

        monkeypatch.setattr(CtrlC, "is_set", is_set)

    yield at
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert (CTRL_C.depth, CTRL_C.heard, CTRL_C.noticed) == (0, False, False)


def test_the_arc_so_far_goes_on_where_it_was_interrupted(pressed, monkeypatch):
    system = models.impact_oscillator()
    whole = hybrid.simulate(system, (0.0, 0.0), (0.0, 20_000.0))
    pressed(2)
    part = hybrid.simulate(system, (0.0, 0.0), (0.0, 20_000.0))
    assert part.status.code == StatusCode.INTERRUPTED
    assert f"Interrupted at t = {part.t[-1]:.12g} in mode" in str(part.status)
    assert 0.0 < part.t[-1] < 20_000.0
    np.testing.assert_array_equal(part.jumps.t, whole.jumps.t[: len(part.jumps)])
    monkeypatch.undo()
    rest = hybrid.simulate(system, part.x[-1], (part.t[-1], 20_000.0), mode=part.mode[-1])
    np.testing.assert_allclose(rest.x[-1], whole.x[-1], atol=1e-7)


def test_where_bursts_end_has_no_influence(monkeypatch):
    """The result is the same to the last bit in bursts of three steps."""
    system, start = models.impact_oscillator(), (0.0, 0.0)

    def compute():
        found = lyapunov.lyapunov_spectrum(system, start, intervals=20, interval=5.0, transient=3)
        orbits = lyapunov.two_orbit_exponents(system, start, intervals=20, interval=5.0, transient=3)
        section = hybrid.stroboscopic_section(system, start, periods=30, transient=5, t0=1.0)
        crossings = hybrid.poincare_section(system, start, RISING, points=10, transient=2)
        arc = hybrid.simulate(system, start, (0.0, 100.0), tangent=True)
        return (
            *(found.growths, found.x, found.sum_rule, orbits.distances, orbits.renormalised_growths),
            *(section.t, section.x, section.jumps, crossings.t, crossings.x, arc.t, arc.x, arc.fundamental),
        )

    whole = compute()
    monkeypatch.setattr(interrupt, "FIRST_BURST", 3)
    monkeypatch.setattr("hybrid.simulation.trajectory.FIRST_BURST", 3)
    monkeypatch.setattr(interrupt, "SECONDS", 0.0)
    for one, other in zip(whole, compute(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_second_interrupt_is_raised():
    def press_twice():
        with CTRL_C:
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        press_twice()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_one_that_nobody_asked_for_is_raised_at_the_end():
    done = []

    def press_once():
        with CTRL_C:
            with CTRL_C:
                os.kill(os.getpid(), signal.SIGINT)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        press_once()
    assert done


def test_a_handler_of_the_program_is_left_alone():
    heard = []
    before = signal.signal(signal.SIGINT, lambda *_: heard.append(True))
    try:
        with CTRL_C:
            os.kill(os.getpid(), signal.SIGINT)
            assert not CTRL_C.is_set()
        assert heard
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_are_not_asked():
    found = []

    def work():
        with CTRL_C:
            found.append(CTRL_C.is_set())

    with CTRL_C:
        os.kill(os.getpid(), signal.SIGINT)
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        assert CTRL_C.is_set()
    assert found == [False]


def test_the_limit_of_steps_holds_across_bursts():
    solver = hybrid.DOP853(max_steps=1000)
    arc = hybrid.simulate(models.impact_oscillator(), (0.0, 0.0), (0.0, 1e6), samples=[1e6], solver=solver)
    assert (arc.status.code, arc.steps) == (StatusCode.MAX_STEPS, 1000)
    found = lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), interval=1e5, solver=solver)
    assert found.status.code == StatusCode.MAX_STEPS


def test_many_short_calls_of_a_kernel():
    """Two orbits of so many intervals are followed in more calls than an integer has digits."""
    found = lyapunov.two_orbit_exponents(
        models.bouncing_ball(), (1.0, 0.0), intervals=70 * INTERVALS_AT_ONCE, interval=1e-7
    )
    assert found.intervals == 70 * INTERVALS_AT_ONCE
