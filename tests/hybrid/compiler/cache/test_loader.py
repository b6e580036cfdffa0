"""What is seen while kernels are compiled, and which are compiled at the same time."""

import time
from contextlib import contextmanager

import pytest

from hybrid.compiler.cache import loader


class Bars:
    """Stands for progress bars: what they were made with, and how far they came."""

    def __init__(self):
        self.made, self.n = [], 0

    @contextmanager
    def make(self, total, title, shown, unit, done):
        self.made.append((total, done))
        self.n = done
        yield self

    def update(self, n):
        self.n += n


@pytest.fixture
def on_disk(monkeypatch):
    """The modules of kernels that are taken to be on disk."""
    found = {loader.IN_SECOND[0], loader.IN_SECOND[3]}
    monkeypatch.setattr(loader, "is_kept", found.__contains__)
    monkeypatch.setattr(loader, "LOOK", 0.01)
    return found


@pytest.fixture
def bars(monkeypatch):
    found = Bars()
    monkeypatch.setattr(loader, "progress_bar", found.make)
    monkeypatch.setattr(loader, "is_watched", lambda: True)
    return found


def wait_until(is_true):
    end = time.monotonic() + 20.0
    while not is_true():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_bar_counts_the_kernels_that_are_left_of_the_first_run(bars, on_disk):
    with loader._shown(loader.DRIVER):
        assert bars.made == [(1 + len(loader.IN_SECOND), 2)]
        on_disk.update(loader.IN_SECOND[:3])
        wait_until(lambda: bars.n == 4)
        on_disk.update(loader.ALL_KERNELS)
        wait_until(lambda: bars.n == 1 + len(loader.IN_SECOND))


def test_what_the_first_run_does_not_need_has_a_bar_of_its_own(bars, on_disk):
    with loader._shown("hybrid.kernels.steps.radau"):
        assert bars.made == [(1, 0)]


def test_where_nobody_watches_a_line_is_said(bars, monkeypatch):
    said = []
    monkeypatch.setattr(loader, "is_watched", lambda: False)
    monkeypatch.setattr(loader, "announced", lambda text: contextmanager(lambda: (yield said.append(text)))())
    with loader._shown(loader.DRIVER):
        pass
    assert said == ["hybrid: compiling the kernels, once for all models ..."]
    assert bars.made == []


def test_a_second_process_compiles_what_this_one_waits_for_and_then_all_others(on_disk, monkeypatch):
    started = []
    monkeypatch.setattr(loader, "_on_disk", lambda module: None)
    monkeypatch.setattr(loader, "compiled", lambda module: b"code")
    monkeypatch.setattr(loader, "keep", lambda path, content: None)
    monkeypatch.setattr(loader, "kernels_in", lambda content: {"code": content})
    monkeypatch.setattr(loader.second_process, "start", lambda program, modules: started.extend(modules))
    assert loader.loaded(loader.DRIVER).code == b"code"
    waited = [module for module in loader.IN_SECOND if module not in on_disk]
    assert started[: len(waited)] == waited
    assert set(started) == {*loader.ALL_KERNELS} - {loader.DRIVER} - on_disk
