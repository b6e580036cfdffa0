"""Arguments that several calls share: their defaults, their place in signatures and docstrings."""

import inspect
from typing import Annotated, TypedDict, Unpack

import pytest

import hybrid
import lyapunov
from hybrid.shared import Shared, shares


class Bounds(TypedDict, total=False):
    low: Annotated[float, Shared(0.0, "Where it begins. " + "It is a long story. " * 8)]
    high: Annotated[float | None, Shared(None, "Where it ends.")]
    last: Annotated[float | None, Shared(None, "Where it ends.")]


@shares(Bounds, low=1.0)
def span(x, *, scale=2.0, **asked: Unpack[Bounds]):
    """Give what is asked.

    Parameters
    ----------
    x, scale
        Its own.

    Returns
    -------
    dict
    """
    return {"x": x, "scale": scale, **asked}


def test_a_call_receives_all_shared_arguments():
    assert span(3.0, high=5.0) == {"x": 3.0, "scale": 2.0, "low": 1.0, "high": 5.0, "last": None}


def test_the_signature_lists_them_with_their_defaults():
    listed = inspect.signature(span).parameters
    assert list(listed) == ["x", "scale", "low", "high", "last"]
    assert listed["low"].default == 1.0
    assert listed["high"].annotation == "float | None"


def test_the_docstring_describes_them_once():
    text = inspect.getdoc(span)
    assert "high, last\n    Where it ends.\n\nReturns" in text
    assert text.index("x, scale") < text.index("low\n    Where it begins.")
    assert max(map(len, text.splitlines())) <= 106


def test_an_argument_that_nobody_knows_is_refused():
    with pytest.raises(TypeError, match=r"^span\(\) got an unexpected keyword argument 'lo'$"):
        span(1.0, lo=2.0)


def test_a_description_of_its_own_comes_first():
    @shares(Bounds)
    def part(**asked: Unpack[Bounds]):
        """Give a part.

        Parameters
        ----------
        high : float, optional
            Where this one ends.
        """
        return asked

    assert part.__doc__.index("high : float, optional\n    Where this") < part.__doc__.index("last\n")
    assert part.__doc__.count("Where it ends.") == 1


@pytest.mark.parametrize("call", [hybrid.basins, hybrid.edge_state, lyapunov.covariant_vectors])
def test_calls_of_the_library_describe_every_parameter(call):
    section = inspect.getdoc(call).partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    heads = [line.partition(" : ")[0] for line in section.splitlines() if line[:1] != " "]
    assert [name for head in heads for name in head.split(", ")] == [*inspect.signature(call).parameters]
