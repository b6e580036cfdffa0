"""Which function draws a result."""

from types import SimpleNamespace

import pytest

from hybrid import ArgumentError
from hybrid.plot import drawn, plot


def told(name):
    return lambda result, **options: (name, options)


def test_datasets_are_drawn_by_a_variable_that_they_have(monkeypatch):
    """The first that is registered decides; objects that are no datasets draw themselves."""
    # Entries that are taken out and put back would stand in another order for the tests that follow.
    monkeypatch.setattr("hybrid.plot.DATASETS", {"one": told("first"), "two": told("second")})
    own = SimpleNamespace(plot=lambda **options: ("own", options))
    for variables, wanted in (("two", "second"), ("two one", "first")):
        data = SimpleNamespace(data_vars=variables.split(), plot=own.plot)
        assert drawn(data, ax=3) == (wanted, {"ax": 3})
    assert plot(own, x="q") == ("own", {"x": "q"})
    for variables in ([], ["three"]):
        with pytest.raises(ArgumentError, match="result must be"):
            drawn(SimpleNamespace(data_vars=variables, plot=own.plot))


@pytest.mark.parametrize("result", [3, SimpleNamespace(plot="no function"), SimpleNamespace(data_vars=["?"])])
def test_other_objects_have_no_picture(result):
    with pytest.raises(ArgumentError, match="result must be a system, an arc, a section"):
        plot(result)
