"""What there is to tell of a run that has reached its end, one note at a time."""

from types import SimpleNamespace

import pytest

from hybrid.kernels.events import many
from hybrid.kernels.types import notes
from hybrid.kernels.types.codes import HELD
from tests.hybrid.kernels.types.ends import COUNTED, end


def is_plain(beyond=0, **changes):
    model, run = end()
    return bool(notes.is_plain(model, SimpleNamespace(**run | changes), beyond))


def test_nothing():
    """The rounding of the time may be worth ten tolerances."""
    assert is_plain()


@pytest.mark.parametrize("name", COUNTED)
def test_what_is_counted(name):
    assert not is_plain(**{name: 1})


def test_errors_in_time():
    assert not is_plain(lateness=10.1)
    assert not is_plain(unknown_time=1e-9)


def test_a_level_that_steps_in_time_may_lead_to_zero():
    assert not is_plain(mode=0)
    # This steep mode has a series.
    assert is_plain(mode=2)
    assert is_plain(mode=3)


@pytest.mark.parametrize("component", [0, 1])
def test_components_without_a_limit(component):
    model, run = end()
    run["trail"][HELD, component] = 1.0
    assert not notes.is_plain(model, SimpleNamespace(**run), 0)


@pytest.mark.parametrize("beyond", [1, 2])
def test_guards_that_the_start_lies_beyond(beyond):
    assert not is_plain(beyond)


def test_runs_from_many_starts_ask_the_same_function():
    assert many.is_plain.py_func is notes.is_plain
