"""Ctrl-C while code is compiled is raised once, at a place where it does no harm."""

import os
import signal
import threading

import numpy as np
import pytest
from numba import njit
from numba.core import event

from hybrid import HybridSystem, Mode, compile_system
from hybrid.compiler.interrupts import between_passes
from hybrid.kernels.types.numba_door.session import PASS


@pytest.fixture(autouse=True)
def _handler():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Press(event.Listener):
    """Presses Ctrl-C at the start of one pass of the compiler."""

    def __init__(self, place):
        self.place, self.passes = place, 0

    def on_start(self, event):
        self.passes += 1
        if self.passes == self.place:
            os.kill(os.getpid(), signal.SIGINT)

    def on_end(self, event):
        pass


@pytest.mark.parametrize("place", [1, 60])
def test_a_model_is_compiled_after_an_interrupt(place):
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("a", lambda t, x, p: (x.v, -x.q if x[0] in (float(place), 2.0) else x.q))],
    )
    listener = Press(place)
    with event.install_listener(PASS, listener), pytest.raises(KeyboardInterrupt):
        compile_system(system)
    assert place <= listener.passes <= place + 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    compiled = compile_system(system)
    assert compiled.emitted.opaque


@between_passes()
def pressed(reached):
    os.kill(os.getpid(), signal.SIGINT)
    reached.append(True)


def test_it_is_raised_at_the_end_of_the_block():
    reached = []
    with pytest.raises(KeyboardInterrupt):
        pressed(reached)
    assert reached


def test_a_handler_of_the_program_is_left_alone():
    heard = []
    signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    with between_passes():
        os.kill(os.getpid(), signal.SIGINT)
    assert heard


def test_other_threads_compile_on():
    """Ctrl-C belongs to the main thread."""
    found = []

    def compile_something():
        found.append(njit(lambda x: np.sin(x) + 1.0)(0.0))

    @between_passes()
    def wait():
        os.kill(os.getpid(), signal.SIGINT)
        thread = threading.Thread(target=compile_something)
        thread.start()
        thread.join()

    with pytest.raises(KeyboardInterrupt):
        wait()
    assert found == [1.0]
