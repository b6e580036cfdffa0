"""Each sentence stands once: in the place of what it is about, or on top if that is in several places."""

from hypothesis import given
from hypothesis import strategies as st

from hybrid.explorer.messages import ABOUT, PLACES, placed

TEXTS = st.sampled_from(["", "it ended.", "nothing was found.", "too large."])


def test_a_sentence_stands_at_what_it_is_about():
    found = placed({"orbit": "none was found.", "branch": "it ended."})
    assert found["multipliers"] == ["Orbit: none was found."]
    assert found["diagram"] == ["Branch: it ended."]
    assert found["top"] == []


def test_a_sentence_about_several_things_stands_on_top():
    found = placed(dict.fromkeys(("section", "portrait", "exponents"), "it ended."))
    assert found["top"] == ["Portrait, section and exponents: it ended."]
    assert not any(found[place] for place in PLACES if place != "top")


def test_what_is_in_one_place_stays_there():
    assert placed({"branch": "it ended.", "diagram": "it ended."})["diagram"] == [
        "Branch and diagram: it ended."
    ]


@given(st.dictionaries(st.sampled_from(list(ABOUT)), TEXTS))
def test_every_sentence_is_said_once(words):
    said = [text for texts in placed(words).values() for text in texts]
    wanted = {text for text in words.values() if text}
    assert len(said) == len(wanted)
    assert all(sum(each.endswith(text) for each in said) == 1 for text in wanted)
