"""The status reports the effect of a grazing on tangent vectors."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    StatusCode,
    Taylor,
    Transition,
    Tsit5,
    simulate,
)
from hybrid.kernels.types import codes
from hybrid.simulation import ending
from hybrid.status import Status
from hybrid.system.growth import Unexplored


def parabola(depth):
    """``q = (t - 1)^2 - depth``: a dip of that depth below the guard, with a kick at the guard."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("fall", lambda t, x, p: (x.v, 2.0 + 0 * x.v))],
        transitions=[
            Transition(
                "fall", "fall", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (x.q, x.v + 1.0))
            )
        ],
    )
    return system, (1.0 - depth, -2.0)


@pytest.mark.parametrize("depth", [1e-4, 1e-6])
def test_a_transverse_crossing_is_not_remarked_upon(depth):
    system, x0 = parabola(depth)
    arc = simulate(system, x0, (0.0, 1.5), tangent=True)
    assert arc.jumps[0].kind == "transverse"
    assert arc.status.message == "Reached the end."


def test_a_crossing_within_the_tolerances_is():
    system, x0 = parabola(1e-11)
    arc = simulate(system, x0, (0.0, 1.5), tangent=True)
    assert arc.jumps[0].kind == "grazing"
    assert arc.status.ok
    assert "1 of 1 jumps grazed within the tolerances" in arc.status.message


def test_the_saltation_grows_like_the_inverse_root_of_the_depth():
    depths = 10.0 ** np.arange(-8, -1)
    sizes = []
    for depth in depths:
        system, x0 = parabola(depth)
        sizes.append(np.abs(simulate(system, x0, (0.0, 1.5)).jumps[0].saltation).max())
    assert np.polyfit(np.log(depths), np.log(sizes), 1)[0] == pytest.approx(-0.5, abs=0.02)


def parabola_then_corner(depth):
    """The parabola, and a puck in a corner at ``t = 1.5``: one wall doubles ``v``, the other adds one."""

    def kick(name, guard, reset):
        return Transition("fall", "fall", Guard(guard, -1), Reset(reset), name=name)

    system = HybridSystem(
        state=("q", "v", "x", "y", "a", "b"),
        modes=[Mode("fall", lambda t, x, p: (x.v, 2.0, x.a, x.b, 0.0, 0.0))],
        transitions=[
            kick("floor", lambda t, x, p: x.q, lambda t, x, p: (x.q, x.v + 1, x.x, x.y, x.a, x.b)),
            kick("left", lambda t, x, p: x.x, lambda t, x, p: (x.q, x.v * 2, x.x, x.y, -x.a, x.b)),
            kick("bottom", lambda t, x, p: x.y, lambda t, x, p: (x.q, x.v + 1, x.x, x.y, x.a, -x.b)),
        ],
    )
    return system, (1.0 - depth, -2.0, 1.5, 1.5, -1.0, -1.0)


@pytest.mark.parametrize(("depth", "grazed"), [(1e-4, False), (1e-11, True)])
def test_an_order_that_mattered_outranks_a_grazing_and_counts_it(depth, grazed):
    system, x0 = parabola_then_corner(depth)
    arc = simulate(system, x0, (0.0, 2.0), tangent=True)
    assert [jump.kind for jump in arc.jumps] == ["grazing" if grazed else "transverse", *["transverse"] * 2]
    assert arc.status.code == StatusCode.AMBIGUOUS_ORDER
    assert ("Besides, 1 of 3 jumps grazed within the tolerances." in arc.status.message) == grazed


def ended(recent, jumps):
    """A run that has made so many jumps, of which it remembers the last."""
    return SimpleNamespace(jumps=jumps, run=SimpleNamespace(recent=np.array(recent)))


@pytest.mark.parametrize(
    ("recent", "jumps", "number", "found"),
    [
        ([5, 6, 7, 8], 4, 3, [6, 7, 8]),
        ([5, 6, 7, 8], 6, 3, [8, 5, 6]),
        ([5, 6, 7, 8], 6, 9, [7, 8, 5, 6]),
        ([5, 6, 0, 0], 2, 3, [5, 6]),
        ([5, 6, 7, 8], 4, 0, []),
        ([5, 6, 7, 8], 0, 3, []),
    ],
)
def test_transitions_that_fired_last_are_in_order(recent, jumps, number, found):
    assert ending._recent(ended(recent, jumps), number) == found


@pytest.mark.parametrize(
    ("recent", "jumps", "found"),
    [
        ([1, 1, 1, 1], 4, [1]),
        ([1, 2, 1, 2], 4, [1, 2]),
        ([2, 2, 1, 2], 5, [2, 1, 2, 2]),
        ([1, 2, 3, 1, 2, 3], 6, [1, 2, 3]),
        ([3, 1, 2, 3, 1, 2], 6, [3, 1, 2]),
        ([4, 4, 1, 2], 4, [4, 4, 1, 2]),
        ([7, 0], 1, [7]),
    ],
)
def test_the_round_is_the_shortest_that_repeats(recent, jumps, found):
    assert ending._round(ended(recent, jumps)) == found


RESET = Reset(lambda t, x, p: x)


@pytest.mark.parametrize(
    ("directions", "orientation", "surface", "resets", "faces"),
    [
        ((1, -1), (1, 1), (0, 0), (None, None), True),
        ((1, 1), (1, -1), (0, 0), (None, None), True),
        ((1, 1), (1, 1), (0, 0), (None, None), False),
        ((1, -1), (1, -1), (0, 0), (None, None), False),
        ((1, -1), (1, 1), (0, 1), (None, None), False),
        ((1, -1), (1, 1), (0, 0), (RESET, None), False),
        ((1, -1), (1, 1), (0, 0), (None, RESET), False),
        ((1, -1, 1), (1, 1, 1), (0, 0, 0), (None, None, None), False),
        ((1,), (1,), (0,), (None,), False),
    ],
)
def test_two_modes_send_the_state_back_across_one_guard(directions, orientation, surface, resets, faces):
    transitions = [
        SimpleNamespace(guard=SimpleNamespace(direction=direction), reset=reset)
        for direction, reset in zip(directions, resets, strict=True)
    ]
    emitted = SimpleNamespace(orientation=orientation, surface=surface)
    run = SimpleNamespace(
        system=SimpleNamespace(transitions=transitions), compiled=SimpleNamespace(emitted=emitted)
    )
    assert ending._faces(run, list(range(len(transitions)))) == faces


def finished(tangents=2, period=0.0, **changes):
    """A run that has reached its end, with something to tell."""
    counted = dict.fromkeys(
        (
            "singular_jumps",
            "order_mattered",
            "ill_conditioned",
            "indistinct",
            "steep_jumps",
            "field_jumps",
        ),
        0,
    )
    emitted = SimpleNamespace(
        discontinuities=changes.pop("discontinuities", ((), ())),
        steep=changes.pop("steep", ("", "")),
        steep_inside=changes.pop("steep_inside", ("", "")),
    )
    return SimpleNamespace(
        tangents=tangents,
        jumps=9,
        run=SimpleNamespace(**(counted | {"lateness": 0.0, "unknown_time": 0.0} | changes)),
        model=SimpleNamespace(period=period),
        compiled=SimpleNamespace(emitted=emitted),
        system=SimpleNamespace(mode_names=("a", "b")),
    )


@pytest.mark.parametrize(
    ("changes", "code", "told"),
    [
        ({"singular_jumps": 2}, StatusCode.SINGULAR_SALTATION, "2 of 9 jumps had no saltation matrix"),
        ({"discontinuities": ((), ("x.q = 0",))}, StatusCode.DISCONTINUOUS_FIELD, "x.q = 0"),
        ({"field_jumps": 4, "jumped_in": 1}, StatusCode.DISCONTINUOUS_FIELD, "mode 'b' jumps within 4 steps"),
        ({"steep_jumps": 1, "steep": ("", "x.q**0.7")}, StatusCode.INFINITE_SLOPE, "x.q**0.7"),
        ({"steep_inside": ("cbrt(x.v)", "")}, StatusCode.INFINITE_SLOPE, "cbrt(x.v)"),
        ({"indistinct": 3}, StatusCode.INDISTINCT_TANGENTS, "3 times the tangent vectors became parallel"),
    ],
)
def test_what_matters_to_tangent_vectors_alone(changes, code, told):
    found = ending._status(finished(**changes), codes.DONE)
    assert found.code == code
    assert told in found.message
    assert ending._status(finished(0, **changes), codes.DONE).code == StatusCode.SUCCESS


def test_a_time_whose_rounding_is_worth_many_tolerances_is_said():
    found = ending._status(finished(0, lateness=31.0), codes.DONE)
    assert found.code == StatusCode.ROUNDED_TIME
    assert "up to 31 times the tolerance" in found.message
    assert "declare the period" in found.remedy
    assert "declare" not in ending._status(finished(0, 2.0, lateness=31.0), codes.DONE).remedy
    assert ending._status(finished(0, lateness=10.0), codes.DONE).code == StatusCode.SUCCESS


def test_an_order_that_mattered_is_said_with_what_grazed():
    text = "4 times two guards were reached together"
    for tangents in (0, 2):
        found = ending._status(finished(tangents, order_mattered=4, ill_conditioned=5), codes.DONE)
        assert found.code == StatusCode.AMBIGUOUS_ORDER
        assert text in found.message
        assert ("5 of 9 jumps grazed" in found.message) == (tangents > 0)
    alone = ending._status(finished(order_mattered=4), codes.DONE)
    assert "grazed" not in alone.message


@pytest.mark.parametrize(
    ("code", "last", "onward", "extended"),
    [
        (StatusCode.TERMINAL, 0, {"first"}, ["first"]),
        (StatusCode.TERMINAL, 1, {"second"}, ["second"]),
        (StatusCode.TERMINAL, 1, {"first"}, []),
        (StatusCode.TERMINAL, -1, {"first", "second"}, []),
        (StatusCode.MAX_STEPS, 0, {"first", "second"}, []),
    ],
)
def test_a_run_that_ends_at_a_mode_not_made_yet_has_it_made(code, last, onward, extended):
    made = []
    growth = SimpleNamespace(leads_on=onward.__contains__, extend=made.append)
    system = SimpleNamespace(growth=growth, transition_names=("first", "second"))
    found = SimpleNamespace(system=system, run=SimpleNamespace(last_fired=last))
    if extended:
        with pytest.raises(Unexplored, match=extended[0]):
            ending._grow(found, code)
    else:
        ending._grow(found, code)
    assert made == extended


@pytest.mark.parametrize("code", [StatusCode.SUCCESS, StatusCode.DISCONTINUOUS_FIELD])
def test_kinks_are_not_told_beside_jumps(code, monkeypatch):
    monkeypatch.setattr(ending, "_notes", lambda *given: [])
    monkeypatch.setattr(ending, "_kinks", lambda trajectory: ["Kinks."])
    monkeypatch.setattr(ending, "_status", lambda trajectory, code: Status(code, "Done.", ""))
    found = ending.status_of(
        SimpleNamespace(system=SimpleNamespace(growth=None), run=SimpleNamespace(last_fired=-1), tangents=2),
        code,
    )
    assert found.message == ("Done. Kinks." if code == StatusCode.SUCCESS else "Done.")


@pytest.mark.parametrize("code", [codes.DONE, codes.MAX_STEPS])
@pytest.mark.parametrize("tangents", [0, 2])
@pytest.mark.parametrize("is_plain", [False, True])
def test_notes_are_looked_for_unless_the_run_is_plain(is_plain, tangents, code, monkeypatch):
    """Runs with tangent vectors, and runs that end early, have more to tell than is asked for."""
    asked = []
    monkeypatch.setattr(ending, "is_plain", lambda *given: asked.append(given) or is_plain)
    monkeypatch.setattr(ending, "_notes", lambda trajectory, code: ["A note."])
    monkeypatch.setattr(ending, "_kinks", lambda trajectory: [])
    monkeypatch.setattr(ending, "_status", lambda trajectory, code: Status(StatusCode.FAILED, "Done."))
    trajectory = SimpleNamespace(
        system=SimpleNamespace(growth=None),
        run=SimpleNamespace(last_fired=-1),
        model="model",
        beyond=("a", "b"),
        tangents=tangents,
    )
    found = ending.status_of(trajectory, code)
    quick = code == codes.DONE and not tangents
    assert asked == ([("model", trajectory.run, 2)] if quick else [])
    assert found.message == ("Reached the end." if quick and is_plain else "Done. A note.")


@pytest.mark.parametrize(
    ("flags", "told"), [((0, 0, 0), None), ((1, 0, 0), "'a'."), ((0, 1, 1), "'b', 'c'.")]
)
def test_components_without_a_limit_are_named(flags, told):
    """The last number of a row of the trail belongs to no component."""
    trail = np.zeros((codes.HELD + 1, 4))
    trail[codes.HELD] = [*flags, 1.0]
    found = SimpleNamespace(
        run=SimpleNamespace(trail=trail), system=SimpleNamespace(state_names=("a", "b", "c"))
    )
    notes = [*ending._held(found)]
    assert len(notes) == (told is not None)
    assert told is None or f"jumps of a chatter changes {told} Such" in notes[0]


@pytest.mark.parametrize("code", [codes.STEP_TOO_SMALL, codes.MAX_STEPS])
@pytest.mark.parametrize(("period", "timed", "bare"), [(0.0, 1, True), (0.0, 0, False), (2.0, 1, False)])
@pytest.mark.parametrize("last", [-1, 0])
def test_bare_time_may_have_lost_its_digits(last, period, timed, bare, code, monkeypatch):
    """A mode that depends on time, in a system without a period, is advised to declare one."""
    asked = []
    monkeypatch.setattr(ending, "_place", lambda trajectory: "at the place")
    monkeypatch.setattr(ending, "_failed", lambda trajectory, code: None)
    monkeypatch.setattr(ending, "run_status", lambda *given, **options: asked.append((given, options)))
    trajectory = SimpleNamespace(
        run=SimpleNamespace(
            singular_jumps=0, order_mattered=0, ill_conditioned=0, mode=1, last_fired=last, at_rest=0
        ),
        tangents=0,
        system=SimpleNamespace(transition_names=("first",)),
        model=SimpleNamespace(period=period, timed=np.array([1 - timed, timed])),
    )
    ending._status(trajectory, code)
    assert asked == [((code, "at the place", "first" if last == 0 else None), {"bare_time": bare})]


LAWS = {
    "number": lambda t, x, p: (-(x.h**0.9),),
    "parameter": lambda t, x, p: (-(x.h**p.a),),
    "both sides": lambda t, x, p: (-np.sign(x.h) * np.abs(x.h) ** 0.9,),
}
SOLVERS = [Taylor(), DOP853(), Tsit5(), RadauIIA()]


def tank(law, after=None):
    """A tank that runs dry; then the run ends, or goes on in the mode ``after``."""
    return HybridSystem(
        state=("h",),
        parameters={"a": 0.9},
        modes=[Mode("drain", law), *([Mode(after, lambda t, x, p: (0.0,))] if after else [])],
        transitions=[Transition("drain", after, Guard(lambda t, x, p: x.h, -1), name="dry")],
    )


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("law", LAWS)
def test_a_time_at_which_a_level_runs_dry_is_said_to_be_uncertain(law, solver):
    """The level ``(1 - t / 10)**10`` is below ``atol = 1e-12`` for the last 10 * 10**-1.2 = 0.63."""
    ended = simulate(tank(LAWS[law]), (1.0,), (0.0, 20.0), solver=solver, mode="drain")
    assert ended.status.code == StatusCode.TERMINAL
    assert ended.t[-1] == pytest.approx(10.0, abs=0.2)
    assert "The time of transition 'dry' may be off by 0.6" in ended.status.message
    went_on = simulate(tank(LAWS[law], "empty"), (1.0,), (0.0, 20.0), solver=solver, mode="drain")
    assert went_on.status.code == StatusCode.INFINITE_SLOPE
    assert "may be off by 0.6" in went_on.status.message
    early = simulate(tank(LAWS[law]), (1.0,), (0.0, 9.0), solver=solver, mode="drain")
    assert early.status.message == "Reached the end."
    assert early.x[-1, 0] == pytest.approx(1e-10, rel=0.1)


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("power", [0.25, 1 / 3, 0.45, 0.5, 0.6, 0.7, 0.8])
def test_no_level_runs_dry_at_another_time_with_success(power, solver):
    """The level is empty at ``1 / (1 - power)``; two units later it is filled and runs dry once more."""
    system = HybridSystem(
        state=("h", "since"),
        parameters={"a": power},
        modes=[
            Mode("drain", lambda t, x, p: (-(x.h**p.a), 0.0)),
            Mode("empty", lambda t, x, p: (0.0, 1.0)),
        ],
        transitions=[
            Transition("drain", "empty", Guard(lambda t, x, p: x.h, -1), Reset(lambda t, x, p: (0.0, 0.0))),
            Transition(
                "empty", "drain", Guard(lambda t, x, p: x.since - 2.0, +1), Reset(lambda t, x, p: (1.0, 0.0))
            ),
        ],
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 20.0), solver=solver, mode="drain")
    needed = 1.0 / (1.0 - power)
    true = np.cumsum([needed, 2.0] * 8)[: len(arc.jumps)]
    error = np.max(np.abs(arc.jumps.t - true))
    assert len(arc.jumps) >= 5
    if arc.status.ok:
        assert error < 1e-7
    else:
        assert arc.status.code == StatusCode.INFINITE_SLOPE
        said = float(re.search(r"may be off by (\S+):", arc.status.message)[1])
        assert error < 10.0 * said


def test_a_level_that_never_runs_dry_in_the_run_is_said_to_be_below_the_tolerance():
    arc = simulate(tank(LAWS["parameter"]), (1.0,), (0.0, 40.0), parameters={"a": 0.95}, mode="drain")
    assert arc.status.ok
    assert len(arc.jumps) == 0
    assert "The guard of 'dry' is below atol where the slope of h**a is infinite" in arc.status.message


def test_a_contact_that_is_left_with_a_speed_has_a_certain_time():
    """The damping has an infinite slope at the surface, which the mass crosses with a speed."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("contact", lambda t, x, p: (x.v, -x.q - 0.1 * np.abs(x.q) ** 0.43 * x.v))],
        transitions=[Transition("contact", None, Guard(lambda t, x, p: x.q, +1))],
    )
    arc = simulate(system, (-1.0, 0.0), (0.0, 20.0), solver=DOP853(), mode="contact")
    assert arc.status.code == StatusCode.TERMINAL
    assert "not known" not in arc.status.message
