"""Transitions at one instant: each rule by itself, with a known answer."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, StatusCode, Taylor, Transition, simulate


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
