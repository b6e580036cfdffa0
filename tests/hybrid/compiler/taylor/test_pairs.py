"""The factors of many convolutions side by side: none gets lost."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybrid.compiler.taylor import pairs
from hybrid.compiler.taylor.pairs import columns_of, layers

lists = st.lists(st.tuples(st.integers(0, 40), st.integers(0, 5)), min_size=1, max_size=200, unique=True)


@given(lists)
def test_each_convolution_has_one_place_and_its_own_factors(numbers):
    """The second number is that of the other factor, 0 for the first factor itself."""
    lefts = [str(left) for left, _ in numbers]
    found = layers(lefts, [other == 0 for _, other in numbers], "s")
    assert sorted(place for layer in found for place in layer.places) == list(range(len(numbers)))
    sizes, blocks = columns_of(found), {layer.left: layer.lefts for layer in found if layer.lefts}
    for layer in found:
        assert list(blocks[layer.left][: len(layer.places)]) == [lefts[place] for place in layer.places]
        assert len(layer.places) <= min(sizes[layer.left], sizes[layer.right])
        if layer.left == layer.right:
            assert all(numbers[place][1] == 0 for place in layer.places)
    rights = [layer.right for layer in found]
    assert len(rights) == len(set(rights))
    assert len(found) == 1 or len(found) * pairs.LEAST <= len(numbers)


def test_few_are_one_layer():
    assert layers([], [], "s") == []
    assert layers(["0", "0", "1"], [True, False, False], "s") == [
        pairs.Layer("sa0", "sb0", ("0", "0", "1"), (0, 1, 2))
    ]


@pytest.mark.parametrize("squared", [1, 2, 20])
def test_squares_are_the_first_of_many_and_the_most_used_come_first(squared):
    """Of forty first factors some are squared, all have one other factor, and the last has three more."""
    names = [str(i) for i in range(40)]
    lefts = [*names, *names[:squared], "39", "39", "39", *names[:39], *names[:39]]
    squares = [40 <= place < 40 + squared for place in range(len(lefts))]
    found = layers(lefts, squares, "s")
    assert len(found) > 1
    first = found[0]
    assert first == pairs.Layer("sa0", "sa0", tuple(names[:squared]), tuple(range(40, 40 + squared)))
    assert [squares[place] for layer in found for place in layer.places].count(True) == squared
    assert all(layer.left != layer.right for layer in found[1:])
    # The first factors of the third and fourth layer are those of the second one.
    assert [layer.left for layer in found[1:4]] == ["sa1"] * 3
    assert [bool(layer.lefts) for layer in found[:4]] == [True, True, False, False]
    blocks = {layer.left: layer.lefts for layer in found if layer.lefts}
    for layer in found:
        assert tuple(lefts[place] for place in layer.places) == blocks[layer.left][: len(layer.places)]
    sizes = [len(layer.places) for layer in found[1:]]
    assert sizes == sorted(sizes, reverse=True)
