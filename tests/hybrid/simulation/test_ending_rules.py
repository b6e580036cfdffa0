"""The notes of a status rule by rule: when each is told, and of what."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.types import codes
from hybrid.simulation import ending
from hybrid.status import StatusCode


def names_of(*names):
    return SimpleNamespace(
        transition_names=names, mode_names=("a", "b"), mode_index=lambda name: "ab".index(name)
    )


def test_guards_that_the_start_lies_beyond_are_named():
    assert [*ending._start_beyond(SimpleNamespace(beyond=()))] == []
    [text] = ending._start_beyond(SimpleNamespace(beyond=("hit", "slide")))
    assert text.startswith("The start lies beyond the guard of 'hit', 'slide'.")


@pytest.mark.parametrize(
    ("steps", "sampled", "told"),
    [
        (0, {0, 2}, None),
        (3, {0, 2}, "The crossings of 'one', 'three' are not proved: the guard could not be traced"),
        (3, {1}, "The crossings of 'two' are not proved"),
    ],
)
def test_crossings_that_are_not_proved(steps, sampled, told):
    """Guards that cannot be traced are named; other guards were too close to zero."""
    run = SimpleNamespace(
        run=SimpleNamespace(unproved=steps),
        system=names_of("one", "two", "three"),
        compiled=SimpleNamespace(emitted=SimpleNamespace(is_sampled=sampled.__contains__)),
    )
    notes = [*ending._unproved(run)]
    assert len(notes) == (told is not None)
    assert told is None or notes[0].startswith(told)


@pytest.mark.parametrize(("unresolved", "coarse", "steps"), [(0, 0, 0), (2, 0, 2), (0, 3, 3), (2, 3, 5)])
def test_steps_on_which_a_forcing_is_not_resolved(unresolved, coarse, steps):
    notes = [*ending._unresolved(SimpleNamespace(run=SimpleNamespace(unresolved=unresolved, coarse=coarse)))]
    assert len(notes) == (steps > 0)
    assert not notes or notes[0].startswith(f"On {steps} steps the forcing is not resolved")


@pytest.mark.parametrize("tangents", [0, 2])
def test_kinks_matter_to_tangent_vectors(tangents):
    system = SimpleNamespace(switching={"a": ["abs(q)", "sign(v)"], "b": ["abs(v)"]})
    notes = [*ending._kinks(SimpleNamespace(tangents=tangents, system=system))]
    assert [note.split(":")[0] for note in notes] == (
        ["The field of mode 'a' has kinks (abs(q), sign(v))", "The field of mode 'b' has kinks (abs(v))"]
        if tangents
        else []
    )


def tank(*, value=0.0, on_guard=(0, 0, 0), unknown=0.0, kinds=(codes.RUNGE_KUTTA, codes.EXACT), **changes):
    """A level in mode ``a``, steep at its guards ``dry`` and ``low``; the guard ``full`` leaves ``b``."""
    transitions = [
        SimpleNamespace(name=name, source=source, guard=name)
        for name, source in (("full", "b"), ("dry", "a"), ("low", "a"))
    ]

    def values(guard, index, phase, x, parameters):
        assert (phase, x, parameters) == (0.5, "x", "parameters")
        assert guard == transitions[index]
        return [value]

    run = {"unknown_time": unknown, "ran_dry": 1, "mode": 0, "on_guard": np.array(on_guard), "phase": 0.5}
    names = names_of("full", "dry", "low")
    return SimpleNamespace(
        run=SimpleNamespace(**run | changes),
        method=SimpleNamespace(atol=1e-6),
        mode="ab"[changes.get("mode", 0)],
        x="x",
        system=SimpleNamespace(transitions=transitions, mode_index=names.mode_index),
        model=SimpleNamespace(parameters="parameters", propagator=np.array(kinds)),
        compiled=SimpleNamespace(value=values, emitted=SimpleNamespace(steep=("h**a", ""))),
    )


def run_dry(code=codes.DONE, **changes):
    return [*ending._run_dry(tank(**changes), code)]


@pytest.fixture(autouse=True)
def _guards_as_they_are(monkeypatch):
    monkeypatch.setattr(ending, "guard_function", lambda transition: transition)


@pytest.mark.parametrize("value", [1e-6, -1e-6, 0.0])
def test_levels_below_the_tolerance_are_named(value):
    """Of all guards of the mode in which the run ends."""
    notes = run_dry(value=value)
    assert [note.split(":")[0] for note in notes] == [
        f"The guard of '{name}' is below atol where the slope of h**a is infinite" for name in ("dry", "low")
    ]


@pytest.mark.parametrize(
    "changes",
    [
        {"value": 1.1e-6},
        {"value": -1.1e-6},
        {"on_guard": (0, 1, 2)},
        {"kinds": (codes.TAYLOR, codes.RUNGE_KUTTA)},
        {"mode": 1},
    ],
)
def test_levels_that_are_known(changes):
    """Above the tolerance, on a guard after its crossing, in a mode with a series or without such a slope."""
    assert run_dry(**changes) == []


def test_a_time_that_is_not_known_is_told_beside_another_end():
    """A complete run has it in its status."""
    assert run_dry(codes.DONE, unknown=0.0625, value=1.0) == []
    [note] = run_dry(codes.TERMINAL, unknown=0.0625, value=1.0)
    assert note.startswith("The time of transition 'dry' may be off by 0.06: ")
    assert "the slope of h**a is infinite" in note
    assert run_dry(codes.TERMINAL, unknown=0.0, value=1.0) == []


def steep(code, *, tangents=1, jumps=0, mode="a", steep=("", ""), inside=("", "")):
    run = SimpleNamespace(
        tangents=tangents,
        mode=mode,
        t=2.5,
        run=SimpleNamespace(steep_jumps=jumps),
        system=SimpleNamespace(mode_names=("a", "b")),
        compiled=SimpleNamespace(emitted=SimpleNamespace(steep=steep, steep_inside=inside)),
    )
    return ending._steep(run, code)


FAILED = (codes.NON_FINITE, codes.STEP_TOO_SMALL)


@pytest.mark.parametrize("code", [codes.DONE, codes.TERMINAL, *FAILED])
@pytest.mark.parametrize("jumps", [0, 2])
@pytest.mark.parametrize("mode", ["a", "b"])
def test_an_infinite_slope_at_a_guard_that_tangent_vectors_met(mode, jumps, code):
    """At a jump, or where the run failed in a mode that has one."""
    powers = {"steep": ("q**0.7", "")}
    assert steep(code, tangents=0, jumps=jumps, mode=mode, **powers) is None
    found = steep(code, jumps=jumps, mode=mode, **powers)
    if not jumps and (code not in FAILED or mode == "b"):
        assert found is None
        return
    assert found.code == StatusCode.INFINITE_SLOPE
    stopped = f"The run stopped at t = 2.5 in mode '{mode}'."
    assert found.message.startswith(stopped if code in FAILED else "Reached the end.")
    assert "The slope of q**0.7 in mode 'a' is infinite" in found.message
    assert "of one guard" in found.remedy


@pytest.mark.parametrize("code", [codes.DONE, codes.TERMINAL, *FAILED])
@pytest.mark.parametrize("mode", ["a", "b"])
def test_an_infinite_slope_inside_of_a_mode(mode, code):
    """Of a complete run in any mode; of one that failed in the mode where it stopped."""
    found = steep(code, mode=mode, inside=("", "cbrt(v)"))
    if code == codes.TERMINAL or (code in FAILED and mode == "a"):
        assert found is None
        return
    assert "The slope of cbrt(v) in mode 'b' is infinite" in found.message
    assert "hybrid.split(system)" in found.remedy
    assert steep(code, mode=mode) is None
