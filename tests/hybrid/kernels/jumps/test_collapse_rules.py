"""Rules of the limit of jumps at one instant: which rounds go on as they are, counters, affine rounds."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.jumps import collapse
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain


class TestFiresInTurn:
    """Transition 5, then 6: the first adds 1 to the state, the second one doubles it."""

    def fires(self, speeds, *, directions=(1, 1), rounds=4.0, turn=2):
        asked = []

        def field(mode, t, x, parameters, out):
            assert (mode, t, parameters) == (1, 7.0, "p")
            out[:] = -x

        def guard_speed(model, transition, t, x, rates, gradient):
            assert t == 7.0
            assert rates.tolist() == (-x).tolist()
            asked.append((transition, x.tolist()))
            return speeds[transition - 5]

        def reset(transition, t, x, parameters, out):
            assert (t, parameters) == (7.0, "p")
            out[:] = x + 1.0 if transition == 5 else 2.0 * x

        model = SimpleNamespace(
            dimension=2,
            parameters="p",
            field=field,
            reset=reset,
            direction=np.array([0] * 5 + list(directions)),
        )
        run = SimpleNamespace(
            mode=1, phase=7.0, jumps=9, recent=np.array([0] * 7 + [5, 6] + [0] * 7), visits=np.zeros((16, 1))
        )
        work = SimpleNamespace(gradient=None, **{name: np.zeros(2) for name in ("new", "field", "state")})
        tested = plain(
            collapse,
            guard_speed=guard_speed,
            speed_rounding=lambda model, run, transition, mode, t, x, work: (
                0.125 if (mode, t) == (1, 7.0) else 99
            ),
        )
        start = np.array([3.0, 4.0])
        found = bool(tested.fires_in_turn(model, run, turn, start, rounds, work))
        assert start.tolist() == [3.0, 4.0]
        self.asked, self.after = asked, work.new.tolist()
        return found

    def test_each_guard_is_asked_at_the_state_that_the_resets_before_have_made(self):
        assert self.fires((1.0, 1.0))
        assert self.asked == [(5, [3.0, 4.0]), (6, [4.0, 5.0])]
        assert self.after == [8.0, 10.0]
        assert self.fires((1.0, 1.0), turn=1)
        assert (self.asked, self.after) == ([(6, [3.0, 4.0])], [6.0, 8.0])

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("late", [0, 1])
    def test_a_guard_may_move_back_by_what_rounding_hides(self, late, way):
        """An eighth in each of four rounds."""
        for speed, expected in ((0.0, True), (-0.49, True), (-0.51, False), (np.nan, False), (9.0, True)):
            speeds, directions = [1.0, 1.0], [1, 1]
            speeds[late], directions[late] = way * speed, way
            assert self.fires(speeds, directions=directions) == expected
            assert len(self.asked) == (1 if not expected and late == 0 else 2)
        assert not self.fires((-0.49, 1.0), rounds=2.0)


def test_a_counter_is_only_added_to():
    """Nothing else depends on it, and it keeps what it was."""
    tally = np.full(3, 88.0)
    for matrix, expected in (
        (np.eye(3), [1.0, 1.0, 1.0]),
        (np.diag([1.0, 0.5, -1.0]), [1.0, 0.0, 0.0]),
        # It may depend on others.
        (np.array([[1.0, 2.0, 3.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]]), [1.0, 0.0, 0.0]),
        (np.array([[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]]), [0.0, 1.0, 1.0]),
        (np.array([[1.0, 0.0, -0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), [1.0, 1.0, 0.0]),
        (np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0]]), [1.0, 0.0, 1.0]),
    ):
        plain(collapse).mark_tallies(matrix, 3, tally)
        assert tally.tolist() == expected


def test_the_product_of_matrices():
    one, other = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[5.0, -6.0], [0.0, 8.0]])
    out = np.full((3, 3), 99.0)
    plain(collapse).multiply_matrices(one, other, out, 2)
    assert out[:2, :2].tolist() == [[5.0, 10.0], [15.0, 14.0]]
    assert np.all(out[2] == 99.0)
    assert np.all(out[:, 2] == 99.0)


class TestAffine:
    def affine(self, apart, *, move=(1.0, 1.0), scale=(1.0, 1.0), matrix=((2.0, -3.0), (0.0, 5.0))):
        """Whether a round is affine whose Jacobian differs by ``apart`` at both ends of a move."""
        matrix = np.array(matrix)

        def round_jacobian(model, run, turn, start, out, work):
            assert turn == 3
            out[:] = matrix if start is run.y else matrix + apart

        run = SimpleNamespace(y=np.array([7.0, 8.0]), scale=np.array(scale))
        work = SimpleNamespace(settled=run.y + np.array(move), jacobian=np.zeros((2, 2)))
        work.saltation = np.zeros((2, 2))
        tested = plain(collapse, round_jacobian=round_jacobian).is_affine
        return bool(tested(SimpleNamespace(dimension=2), run, 3, work))

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("i", [0, 1])
    @pytest.mark.parametrize("j", [0, 1])
    def test_each_entry_is_the_same_up_to_rounding(self, i, j, way):
        """Up to 64 units of its own size."""
        matrix = np.array([[4.0, -4.0], [-4.0, 4.0]])
        for units, expected in ((0.0, True), (60.0, True), (70.0, False), (np.nan, False)):
            apart = np.zeros((2, 2))
            apart[i, j] = way * units * EPSILON * 4.0
            assert self.affine(apart, matrix=matrix) == expected
        # Entries that grow from zero differ by all of their size.
        apart = np.zeros((2, 2))
        apart[i, j] = way * 1e-30
        assert not self.affine(apart, matrix=np.zeros((2, 2)))

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_components_that_hardly_move_tell_nothing(self, way):
        """By no more than 64 units of their scale: 2 and 16 here."""
        for j, unit in ((0, 2.0 * EPSILON), (1, 16.0 * EPSILON)):
            apart = np.zeros((2, 2))
            apart[:, j] = 1.0
            for units, expected in ((60.0, True), (70.0, False)):
                move = np.array([1.0, 1.0])
                move[j] = way * units * unit
                assert self.affine(apart, move=move, scale=(2.0, 16.0)) == expected


def test_only_the_last_48_jumps_must_have_been_in_turn():
    for turn in (1, 2, 16):
        recent = np.array([20] * 16 + list(range(turn)) * (48 // turn))
        run = SimpleNamespace(jumps=64, jumps_here=60, recent=recent, visits=np.zeros((64, 1)), mode=0)
        model = SimpleNamespace(target=np.zeros(21, dtype=int), direction=np.ones(21, dtype=int))
        assert plain(collapse).round_at_once(model, run) == turn


class TestDoubling:
    """One component, which a round maps to ``r x + d``; nothing changes the order of the jumps."""

    def followed(self, ratio, shift, start=0.0):
        asked = []

        def fires_in_turn(model, run, turn, x, rounds, work):
            asked.append((float(x[0]), rounds))
            work.new[0] = ratio * x[0] + shift
            return True

        tested = plain(
            collapse,
            fires_in_turn=fires_in_turn,
            round_jacobian=lambda model, run, turn, x, out, work: out.fill(ratio),
        )
        names = ("trial", "new", "error", "settled", "state", "field_after")
        work = SimpleNamespace(**{name: np.zeros(1) for name in names})
        work.saltation, work.sizes = np.zeros((1, 1)), np.zeros((1, 1))
        rounds = tested.follow_doubling(SimpleNamespace(dimension=1), None, 1, np.array([start]), 1.0, work)
        return rounds, asked, work.settled[0]

    def test_the_state_is_checked_after_each_doubling(self):
        """From 0 with ``x -> x / 2 + 1`` to 2, which is left by a half per round."""
        rounds, asked, limit = self.followed(0.5, 1.0)
        assert asked[:5] == [
            (0.0, 1.0),
            (1.5, 2.0),
            (1.875, 4.0),
            (2.0 - 2.0**-7, 8.0),
            (2.0 - 2.0**-15, 16.0),
        ]
        # The second 32 of 64 rounds still move it by 2^-31, the second 64 of 128 by 2^-63.
        assert (rounds, limit) == (128.0, 2.0)

    def test_moves_are_rounding_below_sixteen_units_for_each_round(self):
        """After 64 rounds ``2^-44`` of the way is left, which the rounding of 128 rounds hides."""
        for unit in (2.0**-20, 1.0, 2.0**20):
            assert self.followed(2.0 ** (-44 / 64), unit)[0] == 128.0

    def test_a_counter_stays_where_it_is(self):
        for step in (0.25, -0.25, 4.0):
            assert self.followed(1.0, step, 3.0)[::2] == (2.0, 3.0)

    def test_a_start_that_does_not_move_is_its_own_limit(self):
        assert self.followed(0.5, 1.0, 2.0) == (2.0, [(2.0, 1.0), (2.0, 2.0)], 2.0)
        # Also if the state keeps what is added, but nothing is.
        assert self.followed(1.0, 0.0, 5.0) == (2.0, [(5.0, 1.0), (5.0, 2.0)], 5.0)

    def test_a_component_that_grows_has_no_limit(self):
        rounds, asked, _ = self.followed(1.0 + 1e-12, 1.0)
        assert rounds == 0.0
        assert len(asked) == 1 + collapse.MOST_DOUBLINGS

    def test_a_component_that_grows_beyond_all_numbers_has_none_either(self):
        """Its rounding is then infinite, too."""
        with np.errstate(over="ignore", invalid="ignore"):
            for ratio in (1.0 + 1e-6, 2.0):
                assert self.followed(ratio, 1.0)[0] == 0.0
