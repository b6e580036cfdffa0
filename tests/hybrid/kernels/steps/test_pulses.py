"""Pulses between samples of a step, rule by rule: what a step explains, what is rounding, what is hidden.

The program that is looked at is the second one of two, with three rows: a row that nobody checks, a part that
is checked, and the forcing itself.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.steps import pulses
from hybrid.kernels.steps.pulses import (
    BETWEEN,
    BETWEEN_IN_STATE,
    EXPLAINED,
    FLAT,
    HIDDEN,
    NOISY,
    UNKNOWN,
    Samples,
)
from hybrid.kernels.types.layout import Path
from tests.hybrid.kernels.plain import plain

kernels = plain(pulses)
START = 7.0
ALONG = Path(np.zeros((2, 1)), 1, -1, START, 1.0, 1.0, False)
NODES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
CALM = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def memory(nodes=5):
    # The last row of samples is one more than the nodes; rows are no shorter than they must be.
    return SimpleNamespace(
        registers=np.full((4, 6), math.nan),
        samples=np.full((nodes + 1, 9), math.nan),
        intervals=np.zeros((60, 2)),
    )


def model_of(*rows, checked=(0, 1, 1)):
    """A model whose rows are functions of the middle and the radius of a piece, and what it was asked for."""
    asked = []

    def bound(programs, program, path, middle, radius, registers):
        assert (program, path[:5]) == (1, ALONG[:5])
        asked.append((middle, radius))
        for place, row in enumerate(rows):
            registers[place] = row(middle, radius)
        return 2

    programs = SimpleNamespace(first=np.array([0, 2, 5]), checked=np.array([1, 1, *checked]))
    return SimpleNamespace(programs=programs, bound=bound), asked


def fixed(*entries):
    """Low, high, least and most slope, and low and high in the middle, wherever the piece is."""
    return lambda middle, radius: entries


class TestIsSteady:
    def steady(self, *rows, negligible=0.25, h=2.0, checked=(0, 1, 1)):
        model, asked = model_of(*rows, checked=checked)
        found = kernels.is_steady(model, 1, ALONG._replace(length=h), negligible, memory())
        assert asked[0] == (0.5 * h, 0.5 * h)
        assert asked[1:] in ([], [(0.3819 * h, 0.0)])
        return found

    wild = (-5.0, 5.0, -9.0, 9.0, 0.0, 0.0)
    rising = (-5.0, 5.0, 0.0, 9.0, 0.0, 0.0)
    falling = (-5.0, 5.0, -9.0, 0.0, 0.0, 0.0)

    def test_where_the_forcing_is_negligible(self):
        assert self.steady(fixed(*self.wild), fixed(*self.wild), fixed(4.0, 4.25, -9.0, 9.0, 0.0, 0.0)) == (
            True,
            0.0,
        )
        assert not self.steady(
            fixed(*self.wild), fixed(*self.wild), fixed(-4.25, -3.99, -9.0, 9.0, 0.0, 0.0)
        )[0]

    @pytest.mark.parametrize("ends", [(0.0, math.inf), (-math.inf, 0.0), (0.0, math.nan)])
    def test_not_without_bounds_of_the_forcing(self, ends):
        assert self.steady(fixed(*CALM), fixed(*CALM), fixed(*ends, 0.0, 1.0, 0.0, 0.0)) == (False, 0.0)

    def test_where_all_that_is_checked_is_monotone(self):
        for part in (self.rising, self.falling):
            for whole in (self.rising, self.falling):
                assert self.steady(fixed(*self.wild), fixed(*part), fixed(*whole)) == (True, 0.0)

    def test_not_where_a_part_turns_round(self):
        part = fixed(-5.0, 5.0, -1e-9, 9.0, 0.0, 1.0)
        assert self.steady(fixed(*CALM), part, fixed(*self.rising)) == (False, 0.0)
        assert self.steady(fixed(*CALM), part, fixed(*self.rising), checked=(0, 0, 1)) == (True, 0.0)
        assert self.steady(part, fixed(*CALM), fixed(*self.rising), checked=(1, 1, 1)) == (False, 0.0)
        assert self.steady(fixed(*CALM), fixed(*self.rising), part) == (False, 0.0)

    def test_where_the_turn_is_rounding(self):
        """A range at most four times as wide as the range at one point, at two points."""
        part = fixed(3.0, 5.0, -9.0, 9.0, 3.5, 4.0)
        assert self.steady(fixed(*CALM), part, fixed(*self.rising)) == (True, 0.0)
        assert self.steady(fixed(*CALM), fixed(*self.rising), part) == (True, 2.0)
        # The middle alone is too narrow.
        part = lambda middle, radius: (3.0, 5.0, -9.0, 9.0, *((3.0, 3.1) if radius > 0.0 else (3.0, 4.5)))  # noqa: E731
        assert self.steady(fixed(*CALM), part, fixed(*self.rising)) == (False, 0.0)
        wider = fixed(3.0, 5.0, -9.0, 9.0, 3.5, 3.99)
        assert self.steady(fixed(*CALM), wider, fixed(*self.rising)) == (False, 0.0)

    def test_not_where_the_range_is_wide_in_the_middle_alone(self):
        for elsewhere, steady in (((3.5, 4.0), True), ((3.5, 3.99), False), ((3.5, 3.5), False)):
            part = lambda middle, radius, e=elsewhere: (  # noqa: E731
                (3.0, 5.0, -9.0, 9.0, 3.0, 4.5) if radius > 0.0 else (3.0, 3.0, 0.0, 0.0, *e)
            )
            assert self.steady(fixed(*CALM), part, fixed(*self.rising)) == (steady, 0.0)
            assert self.steady(fixed(*CALM), fixed(*self.rising), part) == (steady, 2.0 if steady else 0.0)


def test_samples():
    """Ranges in the middle, and of all of them the largest low end and the smallest high end."""
    ends = {0.0: (1.0, 4.0), 0.5: (-2.0, 2.0), 1.0: (0.0, 1.0), 1.5: (-3.0, 5.0), 2.0: (0.5, 6.0)}
    model, asked = model_of(
        fixed(0.0, 0.0, 0.0, 0.0, 8.0, 9.0),
        fixed(0.0, 0.0, 0.0, 0.0, -8.0, -7.0),
        lambda middle, radius: (-99.0, 99.0, 0.0, 0.0, *ends[middle]),
    )
    work = memory()
    kernels._take_samples(model, 1, ALONG._replace(length=2.0), Samples(NODES, False), work)
    assert asked == [(2.0 * node, 0.0) for node in NODES]
    assert work.samples[:, :2].tolist() == [[8.0, 9.0]] * 6
    assert work.samples[:, 2:4].tolist() == [[-8.0, -7.0]] * 6
    assert work.samples[:, 4:6].tolist() == [*map(list, ends.values()), [1.0, 1.0]]


@pytest.mark.parametrize(
    ("samples", "between"),
    [
        ((1.0, 2.0, 4.0, 5.0), (2.0, 4.0)),
        ((4.0, 5.0, 1.0, 2.0), (2.0, 4.0)),
        ((1.0, 4.0, 2.0, 5.0), (2.0, 4.0)),
        ((0.0, 9.0, 2.0, 3.0), (2.0, 3.0)),
        ((1.0, 1.0, 1.0, 1.0), (1.0, 1.0)),
    ],
)
def test_the_range_between_two_samples(samples, between):
    assert kernels._sampled_range(*samples) == between


class TestJudged:
    """The part is sampled as 2 and 4 at the samples 1 and 2, and the forcing as 10 and 12."""

    part = (2.0, 4.0, 1.0, 1.0, 3.0, 3.0)
    # A little beyond the samples, so that it is not negligible.
    forcing = (9.9, 12.1, -1.0, 1.0, 11.0, 11.0)
    wild = (-1e6, 1e6, -9.0, 9.0, 1e6, 1e6)

    def work(self, part=part, forcing=forcing, noise=0.0, common=1.0, falls=False):
        work = memory()
        work.registers[:] = self.wild, part, forcing, self.wild
        one, other = (2, 1) if falls else (1, 2)
        work.samples[one, :6] = 0.0, 0.0, 2.0 - noise, 2.0, 10.0 - noise, 10.0
        work.samples[other, :6] = 0.0, 0.0, 4.0, 4.0 + noise, 12.0, 12.0 + noise
        # The largest low end less the smallest high end: what samples differ by.
        work.samples[5, :6] = 0.0, 0.0, 4.0, 4.0 - common, 12.0, 12.0 - common
        return work

    def judged(self, work, *, whole=False, length=1.0, negligible=0.0, tolerance=0.0, between=0.25):
        programs = SimpleNamespace(checked=np.array([0, 0, 0, 1, 1]), first=np.array([0, 2, 5]))
        tolerance /= pulses.SHARE_OF_PIECE
        demand = pulses.Demand(tolerance, negligible, between, math.nan, 1, False)
        return kernels._judged(programs, 1, 1, whole, length, demand, work)

    def test_what_lies_beyond_the_samples(self):
        for row, beyond in (
            ((1.5, 4.25), 0.5),
            ((1.75, 4.5), 0.5),
            ((2.5, 3.5), -0.5),
            ((2.25, 3.0), -0.25),
        ):
            work = self.work(part=(*row, 0.0, 0.0, 0.0, 0.0))
            assert kernels._beyond(work.registers[1], 1, 1, work) == beyond

    @pytest.mark.parametrize("falls", [False, True])
    def test_what_stays_between_the_samples_is_explained(self, falls):
        """Whether they rise or fall."""
        assert self.judged(self.work(falls=falls)) == EXPLAINED
        for row in ((1.7, 4.0, 1.0, 1.0, 1.7, 1.7), (2.0, 4.3, 1.0, 1.0, 4.3, 4.3)):
            assert self.judged(self.work(part=row, falls=falls)) == HIDDEN

    @pytest.mark.parametrize("row", ["part", "forcing"])
    @pytest.mark.parametrize("side", [-1.0, 1.0])
    def test_by_a_share_of_what_samples_differ_it_may_leave_them(self, row, side):
        low, high = (2.0, 4.0) if row == "part" else (10.0, 12.0)

        def made(beyond, middle, common=1.0, noise=0.0):
            ends = (low - beyond, high) if side < 0 else (low, high + beyond)
            mid = (low - middle if side < 0 else high + middle,) * 2
            return self.work(**{row: (*ends, -1.0, 1.0, *mid)}, common=common, noise=noise)

        assert self.judged(made(0.25, 0.25)) == EXPLAINED
        assert self.judged(made(0.26, 0.25)) == UNKNOWN
        assert self.judged(made(0.26, 0.26)) == HIDDEN
        assert self.judged(made(0.9, 0.9), between=1.0) == EXPLAINED
        assert self.judged(made(0.9, 0.9, common=4.0)) == EXPLAINED
        assert self.judged(made(1.1, 1.1, common=4.0)) == HIDDEN
        # Samples that all have one value in common do not differ.
        assert self.judged(made(0.01, 0.01, common=-1.0)) == HIDDEN

    @pytest.mark.parametrize("row", ["part", "forcing"])
    @pytest.mark.parametrize("side", [-1.0, 1.0])
    def test_rounding_explains_four_times_its_width(self, row, side):
        low, high = (2.0, 4.0) if row == "part" else (10.0, 12.0)

        def made(beyond, width, noise, middle=0.0):
            ends = (low - beyond, high) if side < 0 else (low, high + beyond)
            far = low - middle if side < 0 else high + middle
            mid = (far - width, far) if side < 0 else (far, far + width)
            return self.work(**{row: (*ends, -1.0, 1.0, *mid)}, noise=noise)

        # The samples are as wide as the middle of the piece, wider, or half as wide.
        assert self.judged(made(0.75, 0.125, 0.125)) == NOISY
        assert self.judged(made(0.76, 0.125, 0.125)) == UNKNOWN
        assert self.judged(made(0.75, 0.125, 9.0)) == NOISY
        assert self.judged(made(0.76, 0.125, 9.0)) == UNKNOWN
        assert self.judged(made(0.5, 0.125, 0.0625)) == NOISY
        assert self.judged(made(0.51, 0.125, 0.0625)) == UNKNOWN
        assert self.judged(made(0.25, 0.125, 0.125)) == EXPLAINED
        assert self.judged(made(0.76, 0.125, 0.125, middle=0.74)) == UNKNOWN
        assert self.judged(made(0.76, 0.125, 0.125, middle=0.76)) == HIDDEN
        # A middle without bounds and a sample without: then nothing is known to be rounding.
        assert self.judged(made(0.26, math.inf, math.inf)) == UNKNOWN

    def test_a_sample_of_one_side_may_be_the_wide_one(self):
        for first in (True, False):
            work = self.work(part=(1.3, 4.0, -1.0, 1.0, 2.875, 3.0))
            work.samples[1 if first else 2, 2] -= 0.125
            assert self.judged(work) == NOISY

    def test_hidden_counts_more_than_noise(self):
        noisy, unknown, hidden = (
            (10.0, 12.3, -1.0, 1.0, 11.0, 11.1),
            (10.0, 14.0, -1.0, 1.0, 11.0, 11.0),
            (10.0, 14.0, -1.0, 1.0, 13.0, 13.0),
        )
        less = {"common": 1.0, "noise": 0.1}
        moved = {
            name: (row[0] - 8.0, row[1] - 8.0, -1.0, 1.0, row[4] - 8.0, row[5] - 8.0)
            for name, row in (("noisy", noisy), ("unknown", unknown), ("hidden", hidden))
        }
        assert self.judged(self.work(moved["noisy"], noisy, **less)) == NOISY
        assert self.judged(self.work(moved["noisy"], unknown, **less)) == UNKNOWN
        assert self.judged(self.work(moved["unknown"], noisy, **less)) == UNKNOWN
        assert self.judged(self.work(moved["hidden"], unknown, **less)) == HIDDEN
        assert self.judged(self.work(moved["unknown"], hidden, **less)) == HIDDEN

    def test_where_the_forcing_is_negligible_so_are_its_parts(self):
        work = self.work(part=self.wild, forcing=(10.0, 12.5, -1.0, 1.0, 99.0, 99.0))
        assert self.judged(work) == HIDDEN
        assert self.judged(work, negligible=0.5) == EXPLAINED
        assert self.judged(work, negligible=0.49) == HIDDEN
        assert self.judged(work, length=4.0, tolerance=2.0) == EXPLAINED
        assert self.judged(work, length=4.0, tolerance=1.99) == HIDDEN

    @pytest.mark.parametrize("ends", [(-math.inf, 0.0), (0.0, math.inf), (math.nan, 0.0), (0.0, math.nan)])
    def test_a_part_without_bounds_is_one_that_is_not_used(self, ends):
        assert self.judged(self.work(part=(*ends, -1.0, 1.0, 99.0, 99.0))) == EXPLAINED

    def test_a_whole_piece_is_explained_by_its_ends_if_it_is_monotone(self):
        for slopes in ((0.0, 1.0), (-1.0, 0.0)):
            work = self.work(part=(0.0, 9.0, *slopes, 8.0, 8.0), forcing=(0.0, 99.0, *slopes, 50.0, 50.0))
            assert self.judged(work, whole=True) == EXPLAINED
            assert self.judged(work, whole=False) == HIDDEN
        turning = self.work(part=(0.0, 9.0, -0.1, 0.1, 8.0, 8.0))
        assert self.judged(turning, whole=True) == HIDDEN
        for ends in ((0.0, math.inf), (-math.inf, 99.0)):
            endless = self.work(forcing=(*ends, 0.0, 1.0, 50.0, 50.0))
            assert self.judged(endless, whole=True) == HIDDEN


class TestUnseen:
    def test_with_a_tolerance_it_is_the_integral_of_the_noise(self):
        assert kernels._unseen(np.array([-3.0, 2.0]), 0.5, 4.0, 1e-9) == 2.0

    @pytest.mark.parametrize("row", [(-4.0, 2.0), (-2.0, 4.0)])
    def test_without_it_is_all_or_nothing(self, row):
        assert kernels._unseen(np.array(row), 1.0, 4.0, 0.0) == 0.0
        assert kernels._unseen(np.array(row), 1.01, 4.0, 0.0) == math.inf


def bump(center, radius, height=1.0, base=0.0):
    """A row of ``height`` within ``radius`` of a place, of ``base`` elsewhere, with its range on a piece."""

    def row(middle, half):
        low, high = middle - half, middle + half
        inside, touched = abs(middle - center) <= radius, high >= center - radius and low <= center + radius
        covered = low >= center - radius and high <= center + radius
        least = height if covered else base
        most = height if touched else base
        slope = 0.0 if covered or not touched else 1.0
        at = height if inside else base
        return (min(least, most), max(least, most), -slope, slope, at, at)

    return row


class TestFirstHidden:
    def hidden(self, forcing, part=None, *, h=1.0, tolerance=1e-6, finest=1e-12, of_state=False, nodes=NODES):
        model, asked = model_of(fixed(*CALM), part or fixed(*CALM), forcing)
        work = memory(len(nodes))
        demand, path = kernels.demand_on(h, tolerance, finest, of_state), ALONG._replace(length=h)
        found = kernels.first_hidden(model, 1, path, Samples(nodes, False), demand, work)
        return found, asked

    def test_one_evaluation_explains_a_monotone_forcing(self):
        found, asked = self.hidden(fixed(0.0, 9.0, 0.0, 1.0, 3.0, 3.0), h=2.0)
        assert found == (2.0, 2.0, 0.0)
        assert asked == [(1.0, 1.0)]

    def test_a_steady_forcing_without_a_tolerance_may_be_rounding(self):
        """The forcing itself tells how much of it that is, not its parts."""
        part = fixed(0.0, 1e9, 0.0, 1.0, 0.0, 0.0)
        for size, unseen in ((3.0, math.inf), (1e9, 0.0)):
            noisy = fixed(size - 1.0, size, -1.0, 1.0, size - 1.0, size)
            assert self.hidden(noisy, part, tolerance=0.0)[0] == (1.0, 1.0, unseen)

    def test_one_evaluation_each_explains_pieces_on_which_it_is_monotone(self):
        """However far the bounds lie beyond the samples."""
        turning = lambda middle, half: (  # noqa: E731
            middle - 9.0 * half,
            middle + 9.0 * half,
            -1.0 if half == 0.5 else 0.0,
            1.0,
            middle,
            middle,
        )
        found, asked = self.hidden(turning)
        assert found == (1.0, 1.0, 0.0)
        assert asked == [
            (0.5, 0.5),
            *((node, 0.0) for node in NODES),
            *((at, 0.125) for at in NODES[:4] + 0.125),
        ]

    def test_a_part_of_a_pulse_on_which_it_is_monotone_is_a_pulse(self):
        def row(middle, half):
            if middle == 0.3125:
                return (0.0, 2.0, 0.0, 1.0, 1.5, 1.5)
            return (0.0, 2.0, -1.0, 1.0, 0.0, 0.0) if (middle, half) in ((0.5, 0.5), (0.375, 0.125)) else CALM

        assert self.hidden(row)[0][:2] == (0.25, 0.3125)

    def test_the_noise_of_a_steady_forcing_adds_to_its_integral(self):
        noisy = fixed(3.0, 5.0, -9.0, 9.0, 3.0, 4.0)
        assert self.hidden(noisy, h=2.0)[0] == (2.0, 2.0, 4.0)
        assert self.hidden(noisy, h=2.0, tolerance=0.0)[0] == (2.0, 2.0, math.inf)

    def test_a_share_of_the_tolerance_is_negligible(self):
        """A tenth of it on the whole step: a height of 0.1 over 2."""
        turning = fixed(0.0, 0.1, -9.0, 9.0, 0.0, 0.0)
        found, asked = self.hidden(turning, h=2.0, tolerance=2.0)
        assert (found, len(asked)) == ((2.0, 2.0, 0.0), 1)
        found, asked = self.hidden(turning, h=2.0, tolerance=1.99)
        assert len(asked) > 1

    @pytest.mark.parametrize("h", [1.0, 4.0])
    @pytest.mark.parametrize("height", [1.0, -1.0])
    def test_a_pulse_is_found_by_halving(self, height, h):
        """Pieces of a quarter are halved until the middle of one is on the pulse."""
        for place, low, middle in ((0.3125, 0.25, 0.3125), (0.65, 0.625, 0.65625), (0.97, 0.9375, 0.96875)):
            found, _ = self.hidden(bump(place * h, 0.01 * h, height), h=h)
            assert found == (low * h, middle * h, 0.0)

    def test_a_pulse_of_a_part_counts_too(self):
        rising = lambda middle, half: (middle - 1.5 * half, middle + 1.5 * half, -1.0, 1.0, middle, middle)  # noqa: E731
        assert self.hidden(rising)[0][:2] == (1.0, 1.0)
        found, _ = self.hidden(rising, bump(0.3125, 0.01))
        assert found[:2] == (0.25, 0.3125)

    def test_the_first_of_two_pulses_is_told(self):
        one, other = bump(0.3125, 0.01), bump(0.65, 0.01)
        both = lambda *piece: [max(a, b) for a, b in zip(one(*piece), other(*piece), strict=True)]  # noqa: E731
        found, _ = self.hidden(lambda *piece: (0.0, *both(*piece)[1:2], -1.0, 1.0, *both(*piece)[4:]))
        assert found[:2] == (0.25, 0.3125)

    def test_a_pulse_that_a_sample_shows_is_explained(self):
        """Samples differ by 1, so that one of 1.2 is between them, and one of 1.3 is not."""
        shown = bump(0.5, 0.01)
        assert self.hidden(shown)[0] == (1.0, 1.0, 0.0)

        def two(height):
            beside = bump(0.3125, 0.01, height)

            def row(*piece):
                one, other = shown(*piece), beside(*piece)
                at = max(one[4], other[4])
                return (min(one[0], other[0]), max(one[1], other[1]), -1.0, 1.0, at, at)

            return row

        assert self.hidden(two(1.2))[0][:2] == (1.0, 1.0)
        assert self.hidden(two(1.3))[0][:2] == (0.25, 0.3125)

    def test_pieces_too_short_to_halve_are_told_by_what_they_may_add(self):
        """Bounds that are wide on the first quarter and in no middle: height 2 on pieces of 1/16."""
        wide = lambda middle, half: (  # noqa: E731
            (0.0, 2.0, -1.0, 1.0, 0.0, 0.0) if middle - half < 0.25 and half > 0.0 else CALM
        )
        assert self.hidden(wide, finest=0.0625)[0] == (1.0, 1.0, 0.125)
        assert self.hidden(wide, finest=0.06)[0] == (1.0, 1.0, 0.0625)
        assert self.hidden(wide, finest=0.0625, tolerance=0.0)[0] == (1.0, 1.0, 0.0)

    def test_noise_of_pieces_adds_to_the_integral(self):
        """Rounding of the width 1 from 0.25 to 0.5, where the forcing leaves its samples by 3."""

        def noisy(middle, half):
            if half == 0.5:
                return (-3.0, 1.0, -1.0, 1.0, 0.0, 0.0)
            return (-3.0, 1.0, -1.0, 1.0, 0.0, 1.0) if 0.25 <= middle < 0.5 else CALM

        found, _ = self.hidden(noisy)
        assert found == (1.0, 1.0, 0.75)

    def test_after_many_pieces_the_place_is_told(self):
        """Nothing on the first quarter is certain, down to any length: that is hidden, but not of a state."""
        wide = lambda middle, half: (  # noqa: E731
            (0.0, 2.0, -1.0, 1.0, 0.0, 0.0) if middle - half < 0.25 and half > 0.0 else CALM
        )
        (low, middle, _), asked = self.hidden(wide, finest=1e-6)
        assert len(asked) == 1 + 5 + 400
        assert 0.0 <= low < middle < 0.25
        found, asked = self.hidden(wide, finest=1e-6, of_state=True)
        assert found[:2] == (1.0, 1.0)
        assert 1 + 5 + 64 <= len(asked) < 1 + 5 + 64 + 80

    def test_between_two_samples_of_a_state_there_are_pieces_of_their_own(self):
        """Bounds are wide on the first quarter, and a pulse comes after it."""
        pulse = bump(0.65, 0.01)
        wide = lambda middle, half: (  # noqa: E731
            (0.0, 2.0, -1.0, 1.0, 0.0, 0.0) if middle - half < 0.25 and half > 0.0 else pulse(middle, half)
        )
        found, _ = self.hidden(wide, finest=1e-6, of_state=True)
        assert found[:2] == (0.625, 0.65625)

    def test_of_a_state_more_may_lie_beyond_samples(self):
        shown = bump(0.5, 0.01)

        def two(height):
            beside = bump(0.3125, 0.01, height)

            def row(*piece):
                one, other = shown(*piece), beside(*piece)
                at = max(one[4], other[4])
                return (min(one[0], other[0]), max(one[1], other[1]), -1.0, 1.0, at, at)

            return row

        assert self.hidden(two(1.9), of_state=True)[0][:2] == (1.0, 1.0)
        assert self.hidden(two(2.1), of_state=True)[0][:2] == (0.25, 0.3125)
        assert (BETWEEN, BETWEEN_IN_STATE, FLAT) == (0.25, 1.0, 4.0)
