"""A scene is what its address says, and an address is not believed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import models
from hybrid.explorer.scene import BEGIN, JUMPS, first_scene, from_query, section_names, to_query
from hybrid.explorer.subject import subject

FOUNDING = subject(models.vibroimpact(), "", ranges={"omega": (7.3, 8.0)})
BALL = subject(models.bouncing_ball(), "", (1.0, 0.0))
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def test_the_diagram_is_over_the_parameter_of_the_period():
    scene = first_scene(FOUNDING)
    assert (scene.over, scene.low, scene.high) == ("omega", 7.3, 8.0)
    assert (scene.across, scene.up) == ("x1", "v1")


def test_the_first_scene_needs_no_address():
    assert to_query(FOUNDING, first_scene(FOUNDING)) == {}


@given(omega=FINITE, v1=FINITE, window=st.floats(0.1, 1000.0), points=st.integers(1, 100_000))
def test_an_address_leads_back_to_its_scene(omega, v1, window, points):
    first = first_scene(FOUNDING)
    scene = first.with_(
        values={**first.values, "omega": omega},
        x0={**first.x0, "v1": v1},
        window=window,
        points=points,
        part=BEGIN,
        section=JUMPS,
        up="v2",
    )
    found, refused = from_query(FOUNDING, to_query(FOUNDING, scene))
    assert refused == []
    for field in ("values", "x0", "window", "points", "part", "section", "up", "low", "high"):
        assert getattr(found, field) == getattr(scene, field)


def test_another_parameter_of_the_diagram_brings_its_ends():
    """In an address as on the page, unless the ends are told; the order does not matter."""
    low, high = FOUNDING.ranges["P"]
    found, refused = from_query(FOUNDING, {"low": "300.0", "over": "P"})
    assert refused == []
    assert (found.over, found.low, found.high) == ("P", 300.0, high)
    assert to_query(FOUNDING, found) == {"over": "P", "low": "300.0"}
    found, _ = from_query(FOUNDING, {"over": "P"})
    assert (found.low, found.high) == (low, high)
    # The ends of the first parameter are told where they are those of another one.
    odd = found.with_(low=7.3, high=8.0)
    again, _ = from_query(FOUNDING, to_query(FOUNDING, odd))
    assert (again.over, again.low, again.high) == ("P", 7.3, 8.0)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("p.omega", "nan", "Address: p.omega must be a finite number; got 'nan'."),
        ("p.omega", "__import__('os')", "Address: p.omega must be a finite number"),
        ("p.omego", "7.0", "Parameter 'omego' does not exist"),
        ("x.x9", "0.1", "Component 'x9' does not exist"),
        ("mode", "fligth", "Address: mode 'fligth' does not exist"),
        ("points", "-3", "Address: points must be a whole number from 1 to 100000"),
        ("points", "9" * 5000, "Address: points must be a whole number from 1 to 100000"),
        ("window", "1e9", "Address: window must be above 0 and at most 1000"),
        ("section", "x1; y", "Address: section 'x1; y' does not exist"),
        ("unheard", "1", "Address: Part 'unheard' does not exist"),
        ("low", "9.0", "Address: low must be below high; got 9.0 and 8.0."),
    ],
)
def test_what_is_not_understood_is_said_and_left_out(name, text, said):
    found, refused = from_query(FOUNDING, {name: text})
    assert len(refused) == 1
    assert said in refused[0]
    assert to_query(FOUNDING, found) == {}


@given(st.dictionaries(st.text(max_size=8), st.text(max_size=20), max_size=4))
def test_any_address_opens_a_page(query):
    found, _ = from_query(FOUNDING, query)
    assert found.low < found.high
    assert set(found.values) == set(FOUNDING.values)


def test_sections_that_a_system_has():
    assert section_names(BALL) == ("at each jump", "q", "v")
    assert section_names(FOUNDING)[0] == "once per period"
