"""What a status says, in words."""

import pytest

from hybrid.status import StatusCode, chatter_status


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
