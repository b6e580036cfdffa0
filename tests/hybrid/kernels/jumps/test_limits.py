"""Which limit of chatter a run goes to, and what is done there, in order; the parts have known answers."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.jumps import limits
from hybrid.kernels.jumps.collapse import UNTIL_NEXT_LOOK
from hybrid.kernels.jumps.drift import BRIEF
from hybrid.kernels.jumps.skipped import MANY_AT_ONCE
from hybrid.kernels.types.codes import LIMIT_OF_CHATTER, NO_MODE, NO_TRANSITION
from tests.hybrid.kernels.plain import plain

MODE, TRANSITION, LIMIT_MODE = 1, 2, 3


@pytest.mark.parametrize("marker", [0, 1])
@pytest.mark.parametrize("previous", [MODE, 0])
@pytest.mark.parametrize("here", [MANY_AT_ONCE - 1, MANY_AT_ONCE, MANY_AT_ONCE + 1])
@pytest.mark.parametrize("shorter", [False, True])
@pytest.mark.parametrize("turn", [0, 1, 2])
def test_when_jumps_may_accumulate(marker, previous, here, shorter, turn):
    """One transition back into its mode, many jumps at one instant, or several in turn, ever faster."""
    tested = plain(limits, shortens=lambda *given: shorter, transitions_in_turn=lambda *given: turn)
    run = SimpleNamespace(mode=MODE, previous_mode=previous, jumps_here=here)
    model = SimpleNamespace(marker=np.array([1 - marker, 1 - marker, marker]))
    itself = previous == MODE and marker == 0
    expected = itself or here >= MANY_AT_ONCE or (shorter and turn > 0)
    assert bool(tested.may_accumulate(model, run, TRANSITION)) == expected


class Scene:
    """A task, and the calls of the parts with their numbers; ``answers`` are what the parts find."""

    def __init__(self, *, tangents=0, orthonormal=0, limit_mode=LIMIT_MODE, answers=None, **run):
        self.calls = []
        n = 2
        self.model = SimpleNamespace(
            dimension=n,
            period=6.5,
            marker=np.array([1, 1, 0]),
            accumulates_to=np.array([7, 7, limit_mode]),
        )
        self.run = SimpleNamespace(
            **{
                "mode": MODE,
                "previous_mode": MODE,
                "restitution": 0.5,
                "chattering": 5,
                "stay": np.array([8.0, 0.125, 8.0, 8.0]),
                "phase": 3.0,
                "y": np.arange(10.0, 10.0 + n * (1 + tangents)),
                "instant": np.arange(20.0, 26.0),
                "round": 0,
                "jumps_here": MANY_AT_ONCE,
                "singular_jumps": 4,
                "log_determinant": 0.5,
            }
            | run
        )
        self.work = SimpleNamespace(
            settled=np.array([1.0, 2.0]),
            jacobian=np.full((n, n + 1), 1.5),
            state=np.zeros(n),
            field=np.zeros(n),
            saltation=np.full((n, n), 6.0),
        )
        self.task = SimpleNamespace(
            attempts=None,
            model=self.model,
            method=SimpleNamespace(),
            run=self.run,
            record=SimpleNamespace(),
            work=self.work,
            tangents=tangents,
            orthonormal=orthonormal,
        )
        answers = {"way_is_free": True, "may_be_held": True} | (answers or {})
        doers = (
            *(
                "chatter_matrix",
                "remember_flight",
                "begin_instant",
                "forward",
                "remember_jump",
                "assume_sizes",
            ),
            *("carry_tangents", "whole_jacobian", "drift", "move"),
        )
        target = self.run.mode if limit_mode == NO_MODE else limit_mode
        self.kernels = plain(
            limits,
            **{name: self.noted(name, answers.get(name)) for name in {*doers, *answers}},
            mode_of_limit=lambda *given: (target, NO_TRANSITION),
        )

    def noted(self, name, answer):
        def call(*given):
            told = [each for each in given if isinstance(each, int | float | np.integer)]
            self.calls.append((name, *told))
            if name == "move":
                assert given[-1] is self.work.settled
            if name in ("forward", "begin_instant"):
                assert given[0] is self.run
            if name == "remember_flight":
                assert given[-1] is self.work.settled
            if name == "drift":
                assert given[3] is self.work.jacobian
                self.calls[-1] = (*self.calls[-1], "y" if given[0] is self.run.y else "instant")
            return answer

        return call

    def names(self):
        return [name for name, *_ in self.calls]


class TestImpacts:
    def follow(self, *, span=0.25, remaining=1.0, known=True, noise=0.0, feedback=0.0, apart=False, **others):
        answers = {
            "accumulation": span,
            "rounding_of_tangents": noise,
            "drift_is_known": known,
            "feedback": feedback,
            "add_change_of_duration": apart,
        }
        scene = Scene(answers=answers | others.pop("answers", {}), **others)
        return scene, scene.kernels.follow_impacts(scene.task, TRANSITION, remaining)

    def test_the_limit_of_a_state(self):
        for limit_mode, target in ((LIMIT_MODE, LIMIT_MODE), (0, 0), (NO_MODE, MODE)):
            scene, found = self.follow(limit_mode=limit_mode)
            assert found
            assert scene.run.round == 1
            assert scene.calls == [
                ("accumulation", TRANSITION, 0.125),
                ("way_is_free", 1, 0.25),
                ("chatter_matrix", TRANSITION),
                ("add_change_of_duration", target, 0.25),
                ("may_be_held", 1, 0.25),
                ("remember_flight", 2, 0.25),
                ("begin_instant", 2, 0),
                ("forward", 6.5, 0.25),
                ("remember_jump", TRANSITION, 0.0, LIMIT_OF_CHATTER, True),
                ("move", TRANSITION, target),
            ]

    @pytest.mark.parametrize("tangents", [1, 2])
    @pytest.mark.parametrize("orthonormal", [0, 1])
    def test_the_limit_of_tangent_vectors(self, tangents, orthonormal):
        for limit_mode, target in ((LIMIT_MODE, LIMIT_MODE), (NO_MODE, MODE)):
            scene, found = self.follow(tangents=tangents, orthonormal=orthonormal, limit_mode=limit_mode)
            assert found
            assert scene.calls == [
                ("accumulation", TRANSITION, 0.125),
                ("rounding_of_tangents", TRANSITION, 0.25),
                ("drift_is_known", target, 0.25, 0.0),
                ("feedback", 2),
                ("way_is_free", 1, 0.25),
                ("chatter_matrix", TRANSITION),
                ("add_change_of_duration", target, 0.25),
                ("may_be_held", 1, 0.25),
                ("remember_flight", 2, 0.25),
                ("begin_instant", 2, tangents),
                ("forward", 6.5, 0.25),
                ("remember_jump", TRANSITION, 0.0, LIMIT_OF_CHATTER, True),
                ("assume_sizes", 2),
                ("carry_tangents", tangents, orthonormal == 1, False),
                ("whole_jacobian", target, 3.0),
                ("drift", 2, tangents, 0.25, "y"),
                ("drift", 2, 2, 0.25, "instant"),
                ("move", TRANSITION, target),
            ]

    def test_a_drift_of_the_mean_field_is_in_the_matrix(self):
        scene, found = self.follow(tangents=1, apart=True)
        assert found
        assert "drift" not in scene.names()
        assert "whole_jacobian" not in scene.names()

    def test_a_steep_mean_field_has_to_wait(self):
        """The error of third order is less than rounding, or the feedback over the time is brief."""
        for feedback, noise, apart, found in (
            (4.0 * 0.99 * BRIEF, 0.0, True, True),
            (4.0 * 1.01 * BRIEF, 0.0, True, False),
            (4.0 * 1.01 * BRIEF, 0.0, False, True),
            (4.0 * 0.99e-2, 1e-6, True, True),
            (4.0 * 1.01e-2, 1e-6, True, False),
        ):
            scene, result = self.follow(tangents=2, feedback=feedback, noise=noise, apart=apart)
            assert result == found
            assert ("move" in scene.names()) == found

    @pytest.mark.parametrize(("previous", "marker"), [(0, 0), (MODE, 1)])
    def test_other_jumps_are_left_alone(self, previous, marker):
        scene = Scene(answers={"accumulation": 0.25}, previous_mode=previous)
        scene.model.marker[TRANSITION] = marker
        assert not scene.kernels.follow_impacts(scene.task, TRANSITION, 1.0)
        assert scene.calls == []
        assert scene.run.chattering == 5

    @pytest.mark.parametrize("restitution", [1.0, 0.0, -0.5, 1.5, math.nan])
    def test_jumps_without_a_steady_loss_are_no_chatter(self, restitution):
        scene, found = self.follow(restitution=restitution)
        assert not found
        assert scene.calls == []
        assert scene.run.chattering == 0

    def test_a_limit_lies_before_the_end_of_the_run(self):
        for span, found in ((0.0, False), (-0.25, False), (1.0, True), (1.25, False), (1e-3, True)):
            scene, result = self.follow(span=span)
            assert result == found
            assert ("move" in scene.names()) == found
            assert scene.run.chattering == 5

    def test_nothing_is_done_where_something_is_in_the_way_or_unknown(self):
        for others in (
            {"answers": {"way_is_free": False}},
            {"answers": {"may_be_held": False}},
            {"known": False, "tangents": 1},
        ):
            scene, found = self.follow(**others)
            assert not found
            assert scene.names()[-1] in ("way_is_free", "may_be_held", "drift_is_known")


class TestOthers:
    def test_rounds(self):
        for left, free, remaining, found in (
            (0.5, True, 1.0, True),
            (1.0, True, 1.0, True),
            (1.5, True, 1.0, False),
            (0.0, True, 1.0, False),
            (0.5, False, 1.0, False),
        ):
            scene = Scene(answers={"limit_of_rounds": (left, 3), "way_is_free": free, "go_to_limit": True})
            assert bool(scene.kernels.follow_rounds(scene.task, remaining)) == found
            assert scene.calls[:1] == [("limit_of_rounds",)]
            if 0.0 < left <= remaining:
                assert scene.calls[1] == ("way_is_free", 3, left)
            assert scene.calls[2:] == ([("go_to_limit", 3, left)] if found else [])
        scene = Scene(answers={"limit_of_rounds": (0.5, 3), "go_to_limit": False})
        assert not scene.kernels.follow_rounds(scene.task, 1.0)

    def test_rest(self):
        for here, rests, free, goes, calls in (
            (MANY_AT_ONCE, True, True, True, 4),
            (MANY_AT_ONCE + 1, True, True, True, 4),
            (MANY_AT_ONCE - 1, True, True, True, 0),
            (MANY_AT_ONCE, False, True, True, 2),
            (MANY_AT_ONCE, True, False, True, 3),
            (MANY_AT_ONCE, True, True, False, 4),
        ):
            answers = {
                "jumps_in_turn": 4,
                "has_come_to_rest": rests,
                "way_is_free": free,
                "go_to_limit": goes,
            }
            scene = Scene(answers=answers, jumps_here=here)
            assert bool(scene.kernels.follow_to_rest(scene.task)) == (calls == 4 and goes)
            expected = [
                ("jumps_in_turn",),
                ("has_come_to_rest", 4, 1.0),
                ("way_is_free", 4, 0.0),
                ("go_to_limit", 4, 0.0),
            ]
            assert scene.calls == expected[:calls]
            settled = [10.0, 11.0] if scene.calls else [1.0, 2.0]
            assert scene.work.settled.tolist() == settled

    def collapse(self, here=MANY_AT_ONCE, turn=4, **answers):
        known = {"limit_at_once": (turn, 6.0), "has_come_to_rest": True, "go_to_limit": True}
        scene = Scene(answers=known | answers, jumps_here=here)
        return scene, bool(scene.kernels.follow_collapse(scene.task))

    def test_collapse(self):
        scene, found = self.collapse()
        assert found
        assert scene.calls == [
            ("limit_at_once",),
            ("has_come_to_rest", 4, 6.0),
            ("way_is_free", 4, 0.0),
            ("go_to_limit", 4, 0.0),
        ]
        assert self.collapse(turn=1)[1]
        assert not self.collapse(turn=0)[1]
        for name in ("has_come_to_rest", "way_is_free", "go_to_limit"):
            scene, found = self.collapse(**{name: False})
            assert not found
            assert scene.names()[-1] == name

    def test_collapse_is_looked_for_now_and_then(self):
        for later in range(-1, 3 * UNTIL_NEXT_LOOK):
            scene, found = self.collapse(here=MANY_AT_ONCE + later)
            assert found == (later in (0, UNTIL_NEXT_LOOK, 2 * UNTIL_NEXT_LOOK))
            assert bool(scene.calls) == found
        # Fewer jumps are never enough.
        assert not self.collapse(here=MANY_AT_ONCE - UNTIL_NEXT_LOOK)[1]


class TestGoing:
    @pytest.mark.parametrize("tangents", [0, 1, 2])
    @pytest.mark.parametrize("left", [0.0, 0.5])
    def test_what_is_known_of_the_limit(self, tangents, left):
        for limit_mode, target in ((LIMIT_MODE, LIMIT_MODE), (0, 0), (NO_MODE, MODE)):
            answers = {"next_in_turn": TRANSITION}
            scene = Scene(answers=answers, tangents=tangents, limit_mode=limit_mode)
            assert scene.kernels.go_to_limit(scene.task, 3, left)
            assert scene.calls == [
                ("next_in_turn", 3),
                ("may_be_held", 3, left),
                *([("remember_flight", 2, left)] if left > 0.0 else []),
                ("forward", 6.5, left),
                ("remember_jump", TRANSITION, 0.0, LIMIT_OF_CHATTER, True),
                ("begin_instant", 2, tangents),
                ("move", TRANSITION, target),
            ]
            assert np.all(np.isnan(scene.work.saltation))
            run = scene.run
            assert run.round == 3
            assert run.y[:2].tolist() == [10.0, 11.0]
            assert np.all(np.isnan(run.y[2:]))
            assert run.singular_jumps == (5 if tangents else 4)
            assert math.isnan(run.log_determinant) == (tangents > 0)
            assert np.isnan(run.instant).tolist() == [True, True, False, False, False, False]

    def test_another_transition_names_the_limit(self):
        scene = Scene(answers={"next_in_turn": NO_TRANSITION})
        assert not scene.kernels.go_to_limit(scene.task, 3, 0.5)
        assert scene.calls == [("next_in_turn", 3)]
        assert np.all(scene.work.saltation == 6.0)

    def test_a_counter_that_something_depends_on(self):
        scene = Scene(answers={"next_in_turn": TRANSITION, "may_be_held": False})
        assert not scene.kernels.go_to_limit(scene.task, 3, 0.5)
        assert scene.calls == [("next_in_turn", 3), ("may_be_held", 3, 0.5)]


@pytest.mark.parametrize("finds", range(5))
def test_limits_are_tried_in_turn(finds):
    names = ("follow_impacts", "follow_rounds", "follow_to_rest", "follow_collapse")
    scene = Scene(answers={name: i == finds for i, name in enumerate(names)})
    assert bool(scene.kernels.finish_chatter(scene.task, TRANSITION, 1.5)) == (finds < 4)
    asked = [
        ("follow_impacts", TRANSITION, 1.5),
        ("follow_rounds", 1.5),
        ("follow_to_rest",),
        ("follow_collapse",),
    ]
    assert scene.calls == asked[: finds + 1]
