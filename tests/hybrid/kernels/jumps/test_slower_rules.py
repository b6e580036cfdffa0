"""Impacts slower than the last one, rule by rule, on a ball whose restitution and kick are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.jumps import slower
from hybrid.kernels.types.codes import ENDLESS
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(slower)
T = 3.0
KIND = 0.5


def ball(restitution=lambda speed: KIND, kick=lambda speed: 0.0, condition=lambda speed: True, more=0.0):
    """A state (height, speed, place) whose guard is the height; an impact kicks the place.

    After an impact the speed of the guard is larger by ``more``, since the place drives it.
    """

    def field(mode, t, x, parameters, out):
        assert (mode, t) == (1, T)
        out[:] = x[1], -4.0, 0.0

    def reset(transition, t, x, parameters, out):
        assert (transition, t) == (1, T)
        out[:] = x[0], -restitution(x[1]) * x[1] + more, x[2] + kick(x[1])

    def guard(transition, t, x, parameters, out):
        # The condition of transition 1 comes after the guards of two transitions.
        assert (transition, t) == (3, T)
        out[0] = 1.0 if condition(x[1]) else -1.0

    return SimpleNamespace(
        dimension=3,
        period=0.0,
        parameters=None,
        timed=np.array([0, 0]),
        target=np.zeros(2),
        field=field,
        reset=reset,
        guard=guard,
        guard_gradient=lambda transition, t, x, parameters, out: out.__setitem__(slice(None), (1, 0, 0, 0)),
    )


def memory():
    names = ("new", "second_error", "settled", "field")
    work = SimpleNamespace(**{name: np.full(3, 88.0) for name in names})
    work.settled[:] = 0.0, 0.0, 5.0
    work.gradient, work.scalar = np.zeros(4), np.zeros(1)
    return work


def test_restitution_and_change_of_an_impact():
    after = np.zeros(3)
    model = ball(restitution=lambda speed: 0.75, more=0.125)
    found = kernels.impact(model, SimpleNamespace(mode=1), 1, T, np.array([0.0, -2.0, 5.0]), after, memory())
    assert found == (1.625 / 2.0, 1.625 + 2.0)
    assert after.tolist() == [0.0, 1.625, 5.0]


class TestAlike:
    """The last impact came at a speed of -8; its restitution was 1/2, and the limit is 2 later."""

    SPEED, SPAN, RTOL, ATOL = -8.0, 2.0, 1e-6, 1e-4

    def alike(self, *, misfit=1.0, rounding=1e-30, endless=(0.0, 0.0, 0.0), impulse=(0.0, 1.0, 0.0), **given):
        self.asked = []
        condition = given.pop("condition", lambda speed: True)

        def noted(speed):
            self.asked.append(speed)
            return condition(speed)

        model = ball(condition=noted, **given)
        run = SimpleNamespace(
            mode=1, phase=T - self.SPAN, restitution=KIND, trail=np.zeros((5, 3)), since_entry=0.0
        )
        run.scale = np.ones(3)
        run.trail[ENDLESS] = endless
        method = SimpleNamespace(rtol=self.RTOL, atol=self.ATOL)
        tested = plain(slower, speed_rounding=lambda *given: rounding)
        return bool(
            tested.slower_are_alike(
                model, method, run, 1, self.SPEED, self.SPAN, np.array(impulse), misfit, memory()
            )
        )

    def test_speeds_that_are_tried(self):
        """Ten times slower each, along the impulse from the limit, which leads away from the guard."""
        assert self.alike()
        assert self.asked == pytest.approx([8.0 * 0.1**k for k in range(1, 13)][: len(self.asked)], rel=1e-12)
        assert len(self.asked) in (11, 12)

    def test_down_to_a_thousand_times_their_rounding(self):
        for rounding, tried in ((0.79e-3 / 1e3, 4), (0.81e-3 / 1e3, 3)):
            assert self.alike(rounding=rounding)
            assert len(self.asked) == tried
        assert self.alike(rounding=1.0, condition=lambda speed: False)
        assert self.asked == []

    @pytest.mark.parametrize("below", [1.0, 1e-3, 1e-9])
    def test_their_condition_must_hold(self, below):
        assert not self.alike(condition=lambda speed: speed > below)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("misfit", [0.5, 1.0, 3.0])
    def test_their_restitution_may_change_the_limit_by_ten_tolerances(self, way, misfit):
        """All impacts below the speed tried before, ``slow`` times the last one, may have that restitution.

        The limit changes by ``slow * span * change / (1 - restitution)``.
        """
        for slow, speed in ((1.0, 0.8), (0.1, 0.08)):
            for share, expected in ((0.99, True), (1.01, False)):
                allowed = 10.0 * max(misfit, 1.0) * self.RTOL / slow
                # The restitution that is tried stands in the bound, too.
                change = share * allowed * 0.5 / (1.0 + way * allowed * share)

                def restitution(found, speed=speed, change=change):
                    return KIND + (way * change if abs(found - speed) < 0.5 * speed else 0.0)

                assert self.alike(restitution=restitution, misfit=misfit) == expected

    def test_the_rounding_of_time_counts(self):
        """It has come from 1e9 units of time since the last jump: 8 roundings of it are 1.8e-6."""
        allowed = 10.0 * 8.0 * EPSILON * 1e9 * 0.5 / self.SPAN

        def alike(change):
            model = ball(restitution=lambda speed: KIND + (change if speed > 0.5 else 0.0))
            run = SimpleNamespace(mode=1, phase=1.0, restitution=KIND, trail=np.zeros((5, 3)))
            run.scale, run.since_entry = np.ones(3), 1e9
            method = SimpleNamespace(rtol=0.0, atol=1.0)
            tested = plain(slower, speed_rounding=lambda *given: 1e-4)
            impulse = np.array([0.0, 1.0, 0.0])
            return bool(tested.slower_are_alike(model, method, run, 1, -8.0, 2.0, impulse, 1.0, memory()))

        assert alike(0.99 * allowed)
        assert not alike(1.01 * allowed)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_their_kick_may_change_the_limit_by_ten_tolerances(self, way):
        """Impacts below a speed change the guard's speed by ``speed * (1 + r) / (1 - r)`` together."""
        allowed = 10.0 * (self.ATOL + self.RTOL * 5.0) / (8.0 * 1.5 / 0.5)
        for share, expected in ((0.99, True), (1.01, False)):

            def kick(speed, share=share):
                # The speed of the guard falls by 3/2 of the speed, which is positive here.
                return -1.5 * speed * way * share * allowed if speed > 0.4 else 0.0

            assert self.alike(kick=kick) == expected
            assert self.alike(kick=kick, endless=(0.0, 0.0, 1.0))
        # The kick of the last impact is no change.
        assert self.alike(kick=lambda speed: -1.5 * speed * 0.25, impulse=(0.0, 1.0, 0.25))
        assert not self.alike(kick=lambda speed: 0.0, impulse=(0.0, 1.0, 0.25))

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_kick_that_is_rounding_of_the_state_is_none(self, way):
        """However slow an impact is, it changes the place by 16 roundings of it at most."""
        self.ATOL = self.RTOL = 0.0
        for units, expected in ((12.0, True), (20.0, False)):
            kick = way * units * EPSILON
            assert self.alike(kick=lambda speed, kick=kick: kick if speed < 1e-2 else 0.0) == expected
