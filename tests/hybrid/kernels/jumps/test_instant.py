"""Transitions at one instant: random systems against a slow reference, invariances, and each rule."""

from functools import cache

import attrs
import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, StatusCode, Taylor, Transition, simulate
from tests.hybrid.slow_instant import Reference, Stuck

END = 5.1
NAMES = ("x", "y", "a", "b", "c", "d")
# Source, target, guard (component, parameter of its place), direction, and whether it has a condition.
STRUCTURES = {
    "loops": (
        ("A", "A", (0, "g0"), +1, True),
        ("A", "A", (1, "g1"), +1, False),
        ("A", "A", (0, "g2"), -1, False),
        ("A", "A", (1, "g3"), 0, False),
    ),
    "toggle": (
        ("A", "B", (0, "g0"), +1, True),
        ("B", "A", (0, "g0"), +1, False),
        ("A", "A", (1, "g1"), +1, False),
        ("B", "B", (1, "g1"), +1, True),
    ),
    "across": (
        ("A", "B", (0, "g0"), +1, False),
        ("B", "A", (0, "g0"), -1, False),
        ("A", "A", (1, "g1"), 0, False),
        ("B", "A", (1, "g2"), -1, True),
    ),
    "both sides": (
        ("A", "B", (0, "g0"), +1, False),
        ("B", "A", (1, "g1"), +1, False),
        ("B", "B", (1, "g1"), -1, True),
        ("A", "A", (1, "g1"), +1, False),
    ),
    "ends": (
        ("A", "A", (0, "g0"), +1, False),
        ("A", "B", (1, "g1"), +1, True),
        ("B", "B", (0, "g0"), +1, False),
        ("B", None, (1, "g3"), -1, True),
    ),
}


def shift(i, x, value):
    """The reset of transition ``i``: moves or sets both components, and increments a counter."""
    x = list(x)
    x[0] = value(f"k{i}") * x[0] + value(f"r{i}")
    x[1] = value(f"k{i}") * x[1] + value(f"s{i}")
    x[2 + i] = x[2 + i] + 1
    return x


@cache
def system(name, order=(0, 1, 2, 3)):
    structure = STRUCTURES[name]
    parameters = {f"{letter}{i}": 0.0 for letter in "grskw" for i in range(4)}
    parameters |= {f"{letter}{mode}": 1.0 for letter in "uv" for mode in "AB"}

    def field(mode):
        return lambda t, x, p: (getattr(p, f"u{mode}"), getattr(p, f"v{mode}"), 0.0, 0.0, 0.0, 0.0)

    def transition(i):
        source, target, (component, place), direction, conditional = structure[i]

        def when(t, x, p):
            return x[component - 1] <= getattr(p, f"w{i}")

        return Transition(
            source,
            target,
            Guard(
                lambda t, x, p: x[component] - getattr(p, place),
                direction,
                when=when if conditional else None,
            ),
            Reset(lambda t, x, p: shift(i, x, lambda name: getattr(p, name))) if target else None,
            name=str(i),
        )

    modes = sorted({end for each in structure for end in each[:2] if end})
    return HybridSystem(
        state=NAMES,
        parameters=parameters,
        modes=[Mode(mode, field(mode)) for mode in modes],
        transitions=[transition(i) for i in order],
    )


def drawn(rng):
    """Small integers, so that guards are often reached together and resets land on them."""
    values = {f"g{i}": int(rng.integers(-2, 3)) for i in range(4)}
    for i in range(4):
        values[f"r{i}"], values[f"s{i}"] = (int(v) for v in rng.integers(-2, 3, 2))
        values[f"k{i}"] = int(rng.integers(0, 2))
        # Thresholds between integers, so that rounding decides no condition.
        values[f"w{i}"] = rng.integers(-2, 3) + 0.3
    for mode in "AB":
        values[f"u{mode}"], values[f"v{mode}"] = (int(v) for v in rng.choice([-1, 1, 2], 2))
    start = (*(int(v) for v in rng.integers(-2, 3, 2)), 0, 0, 0, 0)
    return values, start


def reference(name, values, start):
    transitions = [
        (
            source,
            target,
            (component, values[place], place),
            direction,
            lambda x, i=i, target=target: shift(i, x, values.__getitem__) if target else x,
            (lambda x, i=i, c=component: x[c - 1] <= values[f"w{i}"]) if conditional else lambda x: True,
        )
        for i, (source, target, (component, place), direction, conditional) in enumerate(STRUCTURES[name])
    ]
    velocities = {mode: (values[f"u{mode}"], values[f"v{mode}"]) for mode in "AB"}
    return Reference(velocities, transitions, start, "A", END)


@pytest.mark.parametrize("name", STRUCTURES)
def test_random_systems_beside_a_slow_reference(name):
    rng = np.random.default_rng(20)
    stuck, together = 0, 0
    for trial in range(400):
        values, start = drawn(rng)
        arc = simulate(
            system(name),
            start,
            (0.0, END),
            mode="A",
            parameters=values,
            solver=(Taylor(), DOP853())[trial % 2],
        )
        told = (trial, values, start, arc.status)
        try:
            expected = reference(name, values, start)
        except Stuck:
            stuck += 1
            assert arc.status.code == StatusCode.STUCK, told
            continue
        fired = [(jump.t, int(jump.transition)) for jump in arc.jumps]
        assert [i for _, i in fired] == [i for _, i in expected.fired], told
        np.testing.assert_allclose([t for t, _ in fired], [float(t) for t, _ in expected.fired], atol=1e-12)
        np.testing.assert_allclose(arc.x[-1], [float(v) for v in expected.x], atol=1e-12)
        together += len({t for t, _ in fired}) < len(fired)
        if expected.mode is None:
            assert arc.status.code == StatusCode.TERMINAL
        else:
            assert arc.status.code in (StatusCode.SUCCESS, StatusCode.AMBIGUOUS_ORDER), told
            assert arc.mode[-1] == expected.mode
    # Check that many of the drawn transitions fire together.
    assert together + stuck > 25


@pytest.mark.parametrize("name", STRUCTURES)
def test_splitting_a_run_between_events_changes_nothing(name):
    """Runs with refused crossings and with guards that the state has passed are included."""
    rng = np.random.default_rng(21)
    for _ in range(40):
        values, start = drawn(rng)
        whole = simulate(system(name), start, (0.0, END), mode="A", parameters=values)
        if whole.status.code not in (StatusCode.SUCCESS, StatusCode.AMBIGUOUS_ORDER):
            continue
        middle = 0.3 + rng.integers(0, 5)
        if np.any(np.abs(whole.jumps.t - middle) < 1e-6):
            continue
        first = simulate(system(name), start, (0.0, middle), mode="A", parameters=values)
        second = simulate(
            system(name), first.x[-1], (middle, END), mode=str(first.mode[-1]), parameters=values
        )
        fired = [jump.transition for arc in (first, second) for jump in arc.jumps]
        assert fired == [jump.transition for jump in whole.jumps], (values, start)
        np.testing.assert_allclose(second.x[-1], whole.x[-1], atol=1e-12)


def clock(*transitions, modes=("run",), state=("y", "n", "m"), **options):
    """``y' = 1`` in every mode; all other components are constant."""
    rest = (0.0,) * (len(state) - 1)
    return HybridSystem(
        state=state,
        modes=[Mode(name, lambda t, x, p: (1.0, *rest)) for name in modes],
        transitions=transitions,
        **options,
    )


def up(source, target, guard, reset, name, direction=+1, when=None):
    return Transition(source, target, Guard(guard, direction, when=when), Reset(reset), name=name)


def fired(arc):
    return [jump.transition for jump in arc.jumps]


class TestSeveral:
    @pytest.mark.parametrize("guard", [lambda t, x, p: t - 24, lambda t, x, p: x.y - 24])
    def test_one_guard_of_two_transitions_fires_both_once(self, guard):
        system = clock(
            up("run", "run", guard, lambda t, x, p: (x.y, x.n + 1, x.m), "first"),
            up("run", "run", guard, lambda t, x, p: (x.y, x.n, x.m + 1), "second"),
        )
        arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 30.0), mode="run", tangent=True)
        assert arc.status.ok
        assert fired(arc) == ["first", "second"]
        np.testing.assert_allclose(arc.x[-1], [30.0, 1.0, 1.0])
        np.testing.assert_allclose(arc.fundamental, np.eye(3), atol=1e-14)

    def test_a_transition_does_not_fire_again_for_the_reset_of_another(self):
        system = HybridSystem(
            state=("y", "z", "n"),
            modes=[Mode("run", lambda t, x, p: (1.0, 0.0, 0.0))],
            transitions=[
                up("run", "run", lambda t, x, p: x.y - 1, lambda t, x, p: (x.y, x.z + 2, x.n + 1), "A"),
                up("run", "run", lambda t, x, p: x.z - 2, lambda t, x, p: (x.y, -5.0, x.n), "B"),
            ],
        )
        arc = simulate(system, (0.0, 1.0, 0.0), (0.0, 3.0), mode="run")
        assert fired(arc) == ["A", "B"]
        np.testing.assert_allclose(arc.x[-1], [3.0, -5.0, 1.0])

    @pytest.mark.parametrize("target", ["run", "other"])
    def test_a_landing_beyond_two_guards_fires_both(self, target):
        modes = ("run", "other")
        lower = [
            up(
                mode,
                mode,
                lambda t, x, p: x.q - 0.5,
                lambda t, x, p: (x.y, 0.0, x.r, x.n + 1, x.m),
                f"q {mode}",
            )
            for mode in modes
        ] + [
            up(
                mode,
                mode,
                lambda t, x, p: x.r - 0.5,
                lambda t, x, p: (x.y, x.q, 0.0, x.n, x.m + 1),
                f"r {mode}",
            )
            for mode in modes
        ]
        system = clock(
            up("run", target, lambda t, x, p: x.y - 1, lambda t, x, p: (-9.0, 1.0, 1.0, x.n, x.m), "raise"),
            *lower,
            up("other", "run", lambda t, x, p: x.y - 50, lambda t, x, p: x, "back"),
            modes=modes,
            state=("y", "q", "r", "n", "m"),
        )
        arc = simulate(system, (0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 2.0), mode="run", tangent=True)
        assert arc.status.ok
        assert fired(arc) == ["raise", f"q {target}", f"r {target}"]
        np.testing.assert_allclose(arc.x[-1], [-8.0, 0.0, 0.0, 1.0, 1.0])
        # y = -9 + (t - t*), with t* = 1 - y0.
        expected = np.diag([0.0, 0, 0, 1, 1])
        expected[0, 0] = 1.0
        np.testing.assert_allclose(arc.fundamental, expected, atol=1e-13)

    @pytest.mark.parametrize("when", ["before", "after"])
    def test_a_condition_that_a_reset_of_the_instant_makes_true(self, when):
        """A condition that becomes true after the instant has no effect."""
        opens = 1.0 if when == "before" else 2.0
        system = clock(
            up(
                "run",
                "run",
                lambda t, x, p: x.y - 1,
                lambda t, x, p: (x.y, x.n + 1, x.m),
                "asked",
                when=lambda t, x, p: x.m > 0.5,
            ),
            up("run", "run", lambda t, x, p: x.y - opens, lambda t, x, p: (x.y, x.n, 1.0), "opens"),
        )
        arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 4.0), mode="run")
        assert fired(arc) == (["opens", "asked"] if when == "before" else ["opens"])

    def test_a_refused_guard_stays_behind_in_the_next_mode_too(self):
        system = clock(
            up("a", "b", lambda t, x, p: x.y - 2, lambda t, x, p: (x.y, x.n, 1.0), "opens"),
            *(
                up(
                    mode,
                    mode,
                    lambda t, x, p: x.y - 1,
                    lambda t, x, p: (x.y, x.n + 1, x.m),
                    f"asked {mode}",
                    when=lambda t, x, p: x.m > 0.5,
                )
                for mode in "ab"
            ),
            modes=("a", "b"),
        )
        arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 4.0), mode="a")
        assert fired(arc) == ["opens"]

    @pytest.mark.parametrize("target", ["a", "b"])
    def test_a_timer_that_is_reset_to_zero(self, target):
        """``t - d`` reaches zero by the reset from its positive side, and grows again."""
        system = HybridSystem(
            state=("y", "d", "n"),
            modes=[Mode(name, lambda t, x, p: (1.0, 0.0, 0.0)) for name in "ab"],
            transitions=[
                up("a", target, lambda t, x, p: x.y - 2, lambda t, x, p: (x.y, t, x.n), "set"),
                *(
                    up(m, m, lambda t, x, p: t - x.d, lambda t, x, p: (x.y, x.d, x.n + 1), f"timer {m}")
                    for m in "ab"
                ),
                up("b", "a", lambda t, x, p: x.y - 50, lambda t, x, p: x, "back"),
            ],
        )
        arc = simulate(system, (0.0, 1.0, 0.0), (0.0, 4.0), mode="a")
        assert fired(arc) == ["timer a", "set", f"timer {target}"]
        assert arc.x[-1, 2] == 2.0

    def test_two_modes_toggle_once_on_one_rising_crossing(self):
        for other in (1.0, -3.7):
            system = HybridSystem(
                state=("q", "v"),
                modes=[Mode(m, lambda t, x, p: (x.v, -x.q)) for m in "ab"],
                transitions=[
                    Transition("a", "b", Guard(lambda t, x, p: x.q - 0.5, +1)),
                    Transition(
                        "b", "a", Guard(lambda t, x, p, c=other: c * (x.q - 0.5), int(np.sign(other)))
                    ),
                ],
            )
            arc = simulate(system, (1.5, 0.0), (0.0, 20.0), mode="a", tangent=True)
            rising = 2 * np.pi * np.arange(1, 4) - np.arccos(0.5 / 1.5)
            assert arc.status.ok
            np.testing.assert_allclose(arc.jumps.t, rising, atol=1e-9)
            assert [jump.target for jump in arc.jumps] == ["b", "a", "b"]
            turn = np.array([[np.cos(20), np.sin(20)], [-np.sin(20), np.cos(20)]])
            np.testing.assert_allclose(arc.fundamental, turn, atol=1e-8)

    def test_each_reset_leads_beyond_the_next_guard(self):
        """Jumps 0 to 39 fire one after another at one instant, more than a small limit would allow."""
        system = clock(
            *(
                up(
                    "a",
                    "a",
                    lambda t, x, p, i=i: x.y - (1 + i),
                    lambda t, x, p: (x.y + 1.01, x.n + 1, x.m),
                    str(i),
                )
                for i in range(40)
            ),
            modes=("a",),
        )
        arc = simulate(system, (0.5, 0.0, 0.0), (0.0, 1.25))
        assert fired(arc) == [str(i) for i in range(40)]
        np.testing.assert_allclose(arc.jumps.t, 0.5, rtol=0, atol=1e-15)
        np.testing.assert_allclose(arc.x[-1], (42.15, 40.0, 0.0), rtol=1e-13)


class TestStart:
    @pytest.mark.parametrize("target", ["a", "b", None])
    def test_beyond_a_guard_nothing_fires_and_the_status_says_so(self, target):
        reset = None if target is None else Reset(lambda t, x, p: (x.y, x.n + 1, x.m))
        system = clock(
            Transition("a", target, Guard(lambda t, x, p: x.y - 1, +1), reset, name="one"),
            up("a", "a", lambda t, x, p: x.y - 4, lambda t, x, p: (0.0, x.n, x.m), "back"),
            up("b", "a", lambda t, x, p: x.y - 50, lambda t, x, p: x, "never"),
            up("a", "b", lambda t, x, p: x.y - 50, lambda t, x, p: x, "nor"),
            modes=("a", "b"),
        )
        arc = simulate(system, (2.0, 0.0, 0.0), (0.0, 4.0), mode="a")
        assert fired(arc) == ["back", "one"]
        assert arc.jumps.t.tolist() == pytest.approx([2.0, 3.0])
        assert "beyond the guard of 'one'. This guard counts as crossed" in arc.status.message
        on_it = simulate(system, (1.0, 0.0, 0.0), (0.0, 0.5), mode="a")
        assert fired(on_it) == ["one"]
        assert "beyond" not in on_it.status.message

    def test_a_mode_that_lives_on_both_sides(self):
        system = clock(
            up("m", "u", lambda t, x, p: x.y - 1, lambda t, x, p: x, "up"),
            up("m", "d", lambda t, x, p: 2 - 2 * x.y, lambda t, x, p: x, "down"),
            up("u", "m", lambda t, x, p: x.y - 50, lambda t, x, p: x, "from u"),
            up("d", "m", lambda t, x, p: x.y + 5, lambda t, x, p: (x.y - 20, x.n, x.m), "from d"),
            modes=("m", "u", "d"),
        )
        arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 2.0), mode="m")
        assert [(jump.transition, jump.t) for jump in arc.jumps] == [("up", 1.0)]
        assert "beyond" not in arc.status.message
        # The mode is entered below the surface, from a mode without this guard.
        arc = simulate(system, (-6.0, 0.0, 0.0), (0.0, 10.0), mode="d")
        assert fired(arc) == ["from d"]


class TestStuck:
    def test_the_message_names_the_round_in_order(self):
        def goes(source, target, name):
            return up(source, target, lambda t, x, p: x.n - 1, lambda t, x, p: (x.y, x.n, x.m), name)

        system = clock(
            up("a", "b", lambda t, x, p: x.y - 1, lambda t, x, p: (x.y, 2.0, x.m), "in"),
            up("b", "c", lambda t, x, p: x.n - 1, lambda t, x, p: (x.y, 2.0, 2.0), "one"),
            up("c", "d", lambda t, x, p: x.m - 1, lambda t, x, p: (x.y, 2.0, 2.0), "two"),
            up("d", "b", lambda t, x, p: x.y - 0.5, lambda t, x, p: (x.y, 2.0, 2.0), "three"),
            modes="abcd",
        )
        arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 2.0), mode="a")
        assert arc.status.code == StatusCode.STUCK
        rounds = ("'one', 'two', 'three'", "'two', 'three', 'one'", "'three', 'one', 'two'")
        assert any(each + ", then the first again" in arc.status.message for each in rounds)
        assert "fields" not in str(arc.status)
        assert "Change the resets" in arc.status.remedy


class TestTangents:
    def test_a_jump_locked_to_a_grazing_one_is_one(self):
        """A locked jump inherits the grazing flag of the jump that triggered it."""
        system = HybridSystem(
            state=("q", "v", "z"),
            modes=[Mode("fall", lambda t, x, p: (x.v, 2.0 + 0 * x.v, 0.0))],
            transitions=[
                up("fall", "fall", lambda t, x, p: x.q, lambda t, x, p: (x.q, -x.v, x.z + 2), "graze", -1),
                up("fall", "fall", lambda t, x, p: x.z - 1, lambda t, x, p: (x.q, x.v, x.z - 2), "locked"),
            ],
        )
        depth = 1e-13
        arc = simulate(system, (1.0 - depth, -2.0, 0.0), (0.0, 1.5), mode="fall", tangent=True)
        assert fired(arc) == ["graze", "locked"]
        assert [jump.kind for jump in arc.jumps] == ["grazing", "grazing"]
        arc = simulate(system, (0.5, -2.0, 0.0), (0.0, 0.9), mode="fall", tangent=True)
        assert [jump.kind for jump in arc.jumps] == ["transverse", "transverse"]

    @pytest.mark.parametrize("solver", [Taylor(), DOP853(rtol=1e-12, atol=1e-14)])
    def test_a_jump_where_a_refused_guard_lies_behind(self, solver):
        """``q = sin t``: refused at 0.5 on the way up, hit at 0.8, back through 0.5 and hit again."""
        system = HybridSystem(
            state=("q", "v", "n"),
            modes=[Mode("swing", lambda t, x, p: (x.v, -x.q, 0.0))],
            transitions=[
                up(
                    "swing",
                    "swing",
                    lambda t, x, p: x.q - 0.5,
                    lambda t, x, p: (x.q, x.v, x.n + 1),
                    "refused",
                    when=lambda t, x, p: x.n > 0.5,
                ),
                up("swing", "swing", lambda t, x, p: x.q - 0.8, lambda t, x, p: (x.q, -x.v, x.n + 1), "wall"),
            ],
        )
        arc = simulate(system, (0.0, 1.0, 0.0), (0.0, 9.0), mode="swing", solver=solver, tangent=True)
        wall = np.arcsin(0.8)
        # Back at 0 with speed -1 after 2 wall, and up again half a turn later.
        rise = 2 * wall + np.pi
        assert fired(arc) == ["wall", "refused", "wall"]
        np.testing.assert_allclose(arc.jumps.t, [wall, rise + np.arcsin(0.5), rise + wall], atol=1e-9)


def test_a_flow_cut_by_identities_changes_nothing():
    """Passed, refused and pending guards, in copies of one mode joined by identity transitions."""

    def counting(mode):
        return [
            up(
                mode,
                mode,
                lambda t, x, p: x.q - 0.3,
                lambda t, x, p: (x.q, x.v, x.n + 1),
                f"n {mode}",
                when=lambda t, x, p: x.v < 0.8,
            ),
            up(
                mode,
                mode,
                lambda t, x, p: x.q + 0.2,
                lambda t, x, p: (x.q, 0.97 * x.v, x.n),
                f"kick {mode}",
                -1,
            ),
        ]

    field = Mode("a", lambda t, x, p: (x.v, -x.q, 0.0))
    whole = HybridSystem(state=("q", "v", "n"), modes=[field], transitions=counting("a"))
    cut = HybridSystem(
        state=("q", "v", "n"),
        modes=[field, attrs.evolve(field, name="b")],
        transitions=[
            *counting("a"),
            *counting("b"),
            Transition("a", "b", Guard(lambda t, x, p: x.v + 0.1 * x.q, -1), name="cut"),
            Transition("b", "a", Guard(lambda t, x, p: x.v + 0.1 * x.q, -1), name="back"),
        ],
    )
    for v0 in (0.9, 1.3, 1.7):
        arcs = [simulate(each, (0.0, v0, 0.0), (0.0, 40.0), mode="a") for each in (whole, cut)]
        smooth = [[jump.t for jump in arc.jumps if jump.transition not in ("cut", "back")] for arc in arcs]
        assert len(arcs[1].jumps) > len(arcs[0].jumps) > 5
        np.testing.assert_allclose(smooth[0], smooth[1], atol=1e-8)
        np.testing.assert_allclose(arcs[0].x[-1], arcs[1].x[-1], atol=1e-8)


def test_the_order_of_transitions_that_do_not_meet_does_not_matter():
    rng = np.random.default_rng(5)
    for _ in range(20):
        values, start = drawn(rng)
        # Places without other guards, which no reset reaches.
        values |= {f"g{i}": 0.37 + 0.11 * i for i in range(4)}
        arcs = [
            simulate(system("loops", order), start, (0.0, END), mode="A", parameters=values)
            for order in ((0, 1, 2, 3), (3, 2, 1, 0))
        ]
        if len(set(arcs[0].jumps.t)) < len(arcs[0].jumps):
            continue
        assert fired(arcs[0]) == fired(arcs[1])
        np.testing.assert_allclose(arcs[0].x[-1], arcs[1].x[-1], atol=1e-12)
