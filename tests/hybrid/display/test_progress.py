"""When a progress bar is shown, and what it counts."""

import sys

import pytest

from hybrid.display.progress import PATIENCE, progress_bar, silent


class Bar:
    """Stands for tqdm's bar."""

    made: tuple = ()

    def __init__(self, **options):
        self.options, self.n = options, options["initial"]
        Bar.made += (self,)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    def update(self, n=1):
        self.n += n


@pytest.fixture(autouse=True)
def _bars(monkeypatch):
    monkeypatch.setattr("tqdm.auto.tqdm", Bar)
    monkeypatch.setattr(Bar, "made", ())


def shown(value, monkeypatch, *, terminal, **options):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    with progress_bar(10, "Title", value, **options) as bar:
        bar.update()
        bar.update(3)
    return Bar.made


@pytest.mark.parametrize("terminal", [True, False])
def test_a_bar_that_is_asked_for_appears_at_once(monkeypatch, terminal):
    [bar] = shown(True, monkeypatch, terminal=terminal, unit="point", done=2)
    assert bar.n == 6
    expected = {"total": 10, "initial": 2, "desc": "Title", "unit": "point", "leave": False, "delay": 0.0}
    assert bar.options == expected


@pytest.mark.parametrize("terminal", [True, False])
def test_a_bar_that_is_refused_does_not_appear(monkeypatch, terminal):
    assert shown(False, monkeypatch, terminal=terminal) == ()


def test_in_a_terminal_a_bar_appears_after_two_seconds(monkeypatch):
    assert shown(None, monkeypatch, terminal=False) == ()
    [bar] = shown(None, monkeypatch, terminal=True)
    assert PATIENCE == 2.0
    assert bar.options["delay"] == 2.0
    assert bar.options["unit"] == "interval"
    assert bar.options["initial"] == 0


def test_in_a_notebook_too(monkeypatch):
    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    assert len(shown(None, monkeypatch, terminal=False)) == 1


def test_without_standard_error_nothing_is_shown(monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    with progress_bar(1, "Title", None) as bar:
        bar.update()
    assert Bar.made == ()


def test_a_silent_receiver_counts_nothing():
    assert silent().update(3) is None
