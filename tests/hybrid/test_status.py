"""What a status says, in words."""

import pytest

from hybrid.status import Status, StatusCode, beyond_status, chatter_status, told


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["hit"], "Jumps of transition 'hit' accumulate"),
        (["a", "b"], "Jumps of transitions 'a', 'b' in turn accumulate"),
    ],
)
def test_one_transition_or_several_in_turn(names, told):
    status = chatter_status("at t = 1", names, derived=False)
    assert status.code == StatusCode.ACCUMULATION
    assert not status.ok
    assert status.message.startswith(f"{told} at t = 1")


@pytest.mark.parametrize("code", StatusCode, ids=lambda code: code.name)
def test_a_code_is_one_row(code):
    """Its number is its value, and a row that says something says it with the facts of a run alone."""
    assert StatusCode(int(code)) is code
    assert Status(code, "").ok is code.complete
    if code.message:
        facts = dict.fromkeys(("where", "last", "names", "count", "jumps", "places", "powers", "name"), "X")
        facts |= {"guards": "X", "fires": "X", "told": "X", "tolerances": 12.0}
        assert "{" not in told(code, **facts).message
        assert told(code, "Do that.", **facts).remedy == "Do that."


def test_a_start_beyond_one_guard_or_several():
    one, two = beyond_status(["a"]).message, beyond_status(["a", "b"]).message
    assert "beyond the guard of 'a', which counts as crossed there and never fires in" in one
    assert "beyond the guards of 'a', 'b', which count as crossed there and never fire in" in two
