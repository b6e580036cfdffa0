"""The search for a change of sign, piece by piece, on guards whose bounds are known exactly."""

import math

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP, JUMPING
from hybrid.kernels.guards import isolate
from hybrid.kernels.guards.isolate import MOST_PIECES
from hybrid.kernels.guards.pieces import NO_COLUMN, NOWHERE, Guard
from hybrid.kernels.guards.touch import APART
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.events.curves import (
    ALONG,
    PACE,
    START,
    TRANSITION,
    UNITS,
    Curve,
    approx,
    polynomial,
    scene,
)
from tests.hybrid.kernels.plain import plain

kernels = plain(isolate)


class TestFirstChange:
    def change(self, curve, side, *, length=1.0, hidden=0.0, exact=True, **others):
        """Place, side and proved part, and the run."""
        model, method, run, work = scene(curve, **others)
        on_guard = others.get("on_guard", 0)
        with np.errstate(invalid="ignore"):
            path = ALONG._replace(length=length, exact=exact)
            guard = Guard(TRANSITION, NO_COLUMN, side, on_guard, 0.0, 0.0, 0.0)
            found = kernels.first_change(model, method, run, path, guard, hidden, work)
        assert all(
            -EPSILON * length <= middle - radius and middle + radius <= length * (1.0 + 2.0 * APART)
            for middle, radius in curve.asked
        )
        return found, run

    @pytest.mark.parametrize("unit", UNITS)
    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("loose", [False, True])
    def test_is_the_first_one_in_the_direction(self, unit, way, loose):
        for direction, place, side in (
            (0, 0.2, -1),
            (-1, 0.2, -1),
            (1, 0.45, 1),
        ):
            curve = polynomial(
                *(unit * each for each in (0.2, 0.45, 0.8)), factor=-way, loose=loose, noise=1e-15 * unit**3
            )
            found, run = self.change(curve, way, length=unit, direction=way * direction)
            assert found == (approx(unit * place, 20.0), way * side, unit)
            assert (run.unproved, run.grazing_place) == (0, NO_ROOT)
            assert len(curve.asked) < 200

    @pytest.mark.parametrize("way", [1, -1])
    def test_is_none_without_roots_or_in_the_other_direction_alone(self, way):
        for roots, direction, side in (
            ((-0.2, 1.2), 0, 1),
            ((0.3,), 1, -1),
            ((0.3, 0.6), 2, 1),
            ((1.01,), 0, 1),
        ):
            curve = polynomial(*roots, factor=way * (-1) ** sum(root > 0.0 for root in roots))
            found, run = self.change(curve, way, direction=way * direction)
            assert found == (NOWHERE, way * side, 1.0)
            assert (run.unproved, run.grazing_place) == (0, NO_ROOT)

    @pytest.mark.parametrize("way", [1, -1])
    def test_may_be_at_either_end(self, way):
        assert self.change(polynomial(1.0, factor=-way), way)[0] == (NOWHERE, way, 1.0)
        assert self.change(polynomial(1.0 - 4.0 * EPSILON, factor=-way), way)[0] == (
            approx(1.0, 4.0),
            -way,
            1.0,
        )
        # A guard that is beyond zero at the start crosses there; one without a side does not.
        assert self.change(polynomial(-0.5, factor=-way), way)[0] == (0.0, -way, 1.0)
        assert self.change(polynomial(-0.5, factor=-way), 0)[0] == (NOWHERE, -way, 1.0)
        assert self.change(polynomial(-0.5, factor=-way), way, direction=way)[0] == (NOWHERE, -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_of_a_guard_that_jumps(self, way, unit):
        root = 0.3 * unit
        jump = Curve(lambda place: -way if place >= root else way, lambda place: 0.0, (root,), steep=(root,))
        found, run = self.change(jump, way, length=unit)
        assert found == (approx(root, 2.0), -way, unit)
        assert found[0] >= root
        assert (run.unproved, run.grazing_place) == (0, NO_ROOT)

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_a_guard_that_ends(self, way):
        """Where it has no value it has not crossed."""
        for domain, expected in (
            ((0.0, 0.4), (approx(0.3, 4.0), -way)),
            ((0.5, 1.0), (approx(0.5, 4.0), -way)),
        ):
            curve = Curve(lambda place: way * (0.3 - place), lambda place: -way, domain=domain)
            found, _ = self.change(curve, way)
            assert found == (*expected, 1.0)
        curve = Curve(lambda place: way * (0.3 - place), lambda place: -way, domain=(0.0, 0.2))
        assert self.change(curve, way)[0] == (NOWHERE, way, 1.0)
        curve = Curve(lambda place: math.nan, lambda place: math.nan, domain=(3.0, 4.0))
        assert self.change(curve, way)[0] == (NOWHERE, way, 1.0)
        assert len(curve.asked) < 10

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_of_a_guard_that_ends_and_falls_up_to_there(self, way, unit):
        """Its slope keeps its sign, but the signs at the ends of the step do not tell."""
        for domain, expected in (
            ((0.0, 0.4), (approx(0.3 * unit, 4.0), -way)),
            ((0.25, 0.95), (approx(0.3 * unit, 4.0), -way)),
            ((0.0, 0.2), (NOWHERE, way)),
            ((0.05, 0.2), (NOWHERE, way)),
        ):
            curve = Curve(
                lambda place: way * (0.3 - place / unit),
                lambda place: -way / unit,
                domain=(domain[0] * unit, domain[1] * unit),
                sure=True,
            )
            found, run = self.change(curve, way, length=unit)
            assert found == (*expected, unit)
            assert (run.unproved, run.grazing_place) == (0, NO_ROOT)

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_a_guard_with_a_value_on_a_small_part_alone(self, way):
        for domain, root in (((0.0, 0.1), 0.05), ((0.9, 1.0), 0.95), ((0.45, 0.48), 0.47)):
            curve = Curve(lambda place, root=root: way * (root - place), lambda place: -way, domain=domain)
            found, _ = self.change(curve, way)
            assert found == (approx(root, 4.0), -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_a_guard_with_a_pole_in_the_middle(self, way):
        """Beyond zero it has no bound on one side there, but it has values before and after."""
        curve = polynomial(0.3, 0.7, factor=way)
        plainly = curve.ranges

        def ranges(low, high):
            least, most, *_, near, far = plainly(low, high)
            if not low <= 0.5 <= high:
                return plainly(low, high)
            central = low + high == 1.0
            if way > 0:
                return -math.inf, most, -math.inf, math.inf, -math.inf if central else near, far
            return least, math.inf, -math.inf, math.inf, near, math.inf if central else far

        curve.ranges = ranges
        found, run = self.change(curve, way)
        assert found == (approx(0.3, 4.0), -way, 1.0)
        assert (run.unproved, run.grazing_place) == (0, NO_ROOT)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_piece_is_not_halved_where_rounding_hides_all_of_it(self, way):
        """Its bounds are no wider than those in its middle."""
        curve = Curve(lambda place: 0.2 * way, lambda place: 0.0, noise=1.0, tilts=1.0)
        found, _ = self.change(curve, way)
        assert found[0] == NOWHERE
        assert sum(radius > 0.0 for _, radius in curve.asked) == 1

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_a_cusp_that_reaches_zero_is_a_touch(self, way, unit):
        place = 0.4 * unit
        curve = Curve(
            lambda s: way * math.sqrt(abs(s - place) / unit),
            lambda s: way * math.copysign(0.5, s - place) / math.sqrt((abs(s - place) + 1e-300) * unit),
            (place,),
            steep=(place,),
            noise=1e-6,
        )
        found, run = self.change(curve, way, length=unit)
        assert found == (NOWHERE, way, unit)
        assert run.grazing_place == pytest.approx(0.4, rel=1e-6)
        assert (run.grazing_guard, run.next_grazing, run.unproved) == (TRANSITION, NO_ROOT, 0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_leaves_zero_at_the_start_does_not_touch_it_there(self, way):
        for on_guard, touches in ((BY_ACCELERATION, False), (0, True)):
            curve = polynomial(1e-9, 1e-9, factor=way, noise=1e-16)
            found, run = self.change(curve, way, on_guard=on_guard)
            assert found == (NOWHERE, way, 1.0)
            assert (run.grazing_place < 1.0) == touches

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_jumps_at_the_start_may_be_before_its_jump_by_rounding(self, way):
        """Time has a rounding of 16 units: the state is sure only after that, or after half of the step."""
        edge = 16.0 * EPSILON * START / PACE
        for jump, scale, place in (
            (0.9 * edge, 1.0, 0.75),
            (20.0 * edge, 1.0, 0.0),
            (0.4, 1e17, 0.75),
        ):
            curve = Curve(
                lambda s, jump=jump: -way if s < jump or s >= 0.75 else way,
                lambda s: 0.0,
                (jump, 0.75),
                steep=(jump, 0.75),
            )
            found, run = self.change(curve, way, on_guard=JUMPING, scale=scale)
            assert found == (approx(place, 2.0) if place else 0.0, -way, 1.0)
            assert run.grazing_place == NO_ROOT

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_leaves_its_jump_by_signs_may_cross_after_them(self, way):
        """Up to there either sign is possible; its transition may fire again at once."""
        for root, hidden in ((0.75, 0.25), (0.125, 0.0625)):
            curve = Curve(
                lambda s, root=root, hidden=hidden: way * (-1.0 if s < 0.5 * hidden or s >= root else 1.0),
                lambda s: 0.0,
                (0.5 * hidden, root),
                steep=(0.5 * hidden, root),
            )
            found, _ = self.change(
                curve, way, on_guard=JUMPING, hidden=hidden, fired=TRANSITION, since_entry=0.0
            )
            assert found == (approx(root, 2.0), -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_a_touch_is_no_change(self, way, unit):
        curve = polynomial(0.4 * unit, 0.4 * unit, factor=way, noise=1e-15 * unit**2)
        found, run = self.change(curve, way, length=unit)
        assert found == (NOWHERE, way, unit)
        assert run.grazing_place == pytest.approx(0.4, rel=1e-6)
        assert run.grazing_value == pytest.approx(0.0, abs=1e-12 * unit**2)
        assert (run.grazing_guard, run.next_grazing, run.unproved) == (TRANSITION, NO_ROOT, 0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_turns_within_the_tolerances_are_touches(self, way):
        """The slope is 1e-3 at most where the guard is looked at: the tolerance of the place counts 1e-2."""
        for height, tolerance, exact, touches in (
            (1e-6, 1e-2, False, True),
            (1e-6, 1e-2, True, False),
            (1e-3, 1e-4, False, False),
        ):
            curve = Curve(
                lambda place, height=height: way * ((place - 0.4) ** 2 + height),
                lambda place: way * 2.0 * (place - 0.4),
                (0.4,),
                noise=1e-15,
            )
            found, run = self.change(curve, way, exact=exact, tolerance=tolerance)
            assert found == (NOWHERE, way, 1.0)
            if touches:
                assert run.grazing_place == pytest.approx(0.4, abs=1e-6)
                assert run.grazing_value == pytest.approx(way * height, rel=1e-6)
            else:
                assert run.grazing_place == NO_ROOT

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_two_touches(self, way, unit):
        touches = (unit * each for each in (0.3, 0.3, 0.8, 0.8))
        curve = polynomial(*touches, factor=way, noise=1e-15 * unit**4)
        found, run = self.change(curve, way, length=unit)
        assert found == (NOWHERE, way, unit)
        assert run.grazing_place == pytest.approx(0.3, rel=1e-6)
        assert run.next_grazing == pytest.approx(0.8, rel=1e-6)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_dip_beyond_zero_within_rounding_has_both_its_crossings(self, way):
        """It is deeper than a half of the rounding in its middle."""
        for depth in (1e-4, 1e-6, 1e-12):
            curve = Curve(
                lambda place, depth=depth: way * ((place - 0.4) ** 2 - depth),
                lambda place: way * 2.0 * (place - 0.4),
                (0.4,),
                noise=1e-17,
            )
            shift = math.sqrt(depth)
            found, run = self.change(curve, way)
            assert found == (pytest.approx(0.4 - shift, abs=1e-9), -way, 1.0)
            found, _ = self.change(curve, way, direction=way)
            assert found == (pytest.approx(0.4 + shift, abs=1e-9), way, 1.0)
            assert run.grazing_place == NO_ROOT
            found, _ = self.change(curve, way, exact=False, tolerance=10.0)
            assert found == (pytest.approx(0.4 - shift, abs=1e-9), -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_is_zero_at_the_start_is_searched_after_that(self, way):
        """The rest of its value there, and of its slope if that is zero too, is rounding."""
        for on_guard, roots in ((BY_SPEED, 1), (BY_ACCELERATION, 2), (BY_STEP, 3)):
            for rounding in (0.0, 1e-7, -1e-7):
                for unit in UNITS:
                    exact = polynomial(*[0.0] * roots, 0.5 * unit, factor=-way / unit ** (roots + 1))

                    def value(place, exact=exact, rounding=rounding, roots=roots, unit=unit):
                        return exact(place) - way * rounding * (1.0 + (place / unit if roots > 1 else 0.0))

                    def slope(place, exact=exact, rounding=rounding, roots=roots, unit=unit):
                        return exact.slope(place) - way * (rounding / unit if roots > 1 else 0.0)

                    curve = Curve(value, slope, exact.turns, noise=1e-12)
                    found, run = self.change(curve, way, on_guard=on_guard, length=unit)
                    # Once the whole guard is on its side, its later root is what counts.
                    assert found == (pytest.approx(0.5 * unit, rel=4e-6), -way, unit)
                    assert run.grazing_place == NO_ROOT
                    assert run.unproved == 0
                    # What is rounding at the start does not split the step any further.
                    assert len(curve.asked) < 60

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_is_zero_and_goes_the_other_way_crosses_at_the_start(self, way):
        """But not if its transition has just fired."""
        for on_guard, roots, tilts in ((BY_SPEED, 1, 0.6), (BY_ACCELERATION, 2, 0.0), (BY_STEP, 3, 0.0)):
            for fired, since, place in ((-1, 0.0, True), (TRANSITION, 0.0, False), (TRANSITION, 1.0, True)):
                curve = polynomial(*[0.0] * roots, -0.5, factor=-way, noise=1e-20, tilts=tilts)
                found, _ = self.change(curve, way, on_guard=on_guard, fired=fired, since_entry=since)
                assert found[1:] == (-way, 1.0)
                if place:
                    assert 0.0 <= found[0] <= 1e-12
                else:
                    assert found[0] == NOWHERE

    @pytest.mark.parametrize("way", [1, -1])
    def test_signs_up_to_a_place_may_be_noise(self, way):
        curve = polynomial(0.0, 0.0, 0.0, 0.125, 0.75, factor=-way)
        assert self.change(curve, -way, on_guard=BY_STEP)[0][0] == approx(0.125, 4.0)
        found, _ = self.change(curve, way, hidden=0.25, on_guard=BY_STEP)
        assert found == (approx(0.75, 4.0), -way, 1.0)
        assert all(middle - radius >= 0.25 for middle, radius in curve.asked[10:] if radius > 0.0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_a_jump_has_left_beyond_zero_returns(self, way):
        """It moves back to its side where the step starts, so it has not crossed there."""
        for turn, place in ((1e-6, NOWHERE), (-1e-6, 0.0)):
            curve = Curve(
                lambda place, turn=turn: -way * ((place - turn) ** 2 + 1e-12),
                lambda place, turn=turn: -way * 2.0 * (place - turn),
                (turn,),
                noise=1e-11,
            )
            assert self.change(curve, way)[0] == (place, -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_step_with_too_many_pieces_is_cut_to_its_proved_part(self, way):
        """From 0.3 on the bounds say nothing."""
        for edge, proved in ((0.3, pytest.approx(0.3, abs=1e-3)), (1e-3, 1.0 / 64.0)):
            curve = polynomial(2.0, factor=-way)
            plainly = curve.ranges

            def ranges(low, high, plainly=plainly, edge=edge):
                found = plainly(low, high)
                wide = (-9.0, 9.0, -9.0, 9.0)
                return (*wide, *found[4:]) if high > edge and high > low else found

            curve.ranges = ranges
            found, run = self.change(curve, way)
            assert found == (NOWHERE, way, proved)
            assert sum(radius > 0.0 for _, radius in curve.asked) > MOST_PIECES
            assert (run.unproved > 0) == (edge < 0.01)


class TestCrossingOnPath:
    def crossing(self, curve, side, *, length=2.0, end=0.0, exact=True, program=True, rests=None, **others):
        """Share of the crossing, side after it and proved share, and the run."""
        given = []

        def hidden_until(*arguments):
            given.append(arguments)
            return rests

        model, method, run, work = scene(curve, side=side, **others)
        if not program:
            model.programs.first[:] = 0
        model.field = None
        tested = plain(isolate, hidden_until=hidden_until).crossing_on_path
        path = ALONG._replace(length=length, exact=exact)
        theta, share = tested(model, method, run, TRANSITION, NO_COLUMN, path, end, work)
        if rests is not None:
            ((*_, asked, _),) = given
            assert asked == end
        return (theta, run.rehearsal[3, TRANSITION], share), run

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("program", [True, False])
    def test_places_are_shares_of_the_step(self, way, program):
        found, run = self.crossing(polynomial(0.5, factor=-way), way, program=program)
        assert found == (approx(0.25, 4.0), -way, 1.0)
        assert run.unproved == (not program)
        found, run = self.crossing(polynomial(0.0, 2.5, factor=-way), way, on_guard=BY_SPEED, program=program)
        assert found == (NO_ROOT, way, 1.0)
        assert run.on_guard.tolist() == [5, 0]

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_at_rest_stays_on_zero(self, way):
        found, run = self.crossing(polynomial(0.5, factor=-way), way, on_guard=BY_STEP, rests=(2.0, True))
        assert found == (NO_ROOT, way, 1.0)
        assert run.on_guard.tolist() == [5, BY_STEP]

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("direction", [-1, 0, 1])
    def test_a_guard_that_is_noise_all_over_the_step(self, way, direction):
        """Its value at the end tells its side, and it crosses at the start unless it has just fired."""
        for end, after in ((0.25, 1), (-0.25, -1), (0.0, way)):
            for fired in (-1, TRANSITION):
                crosses = after == -way and direction in (0, after) and fired != TRANSITION
                found, run = self.crossing(
                    polynomial(0.5), way, on_guard=BY_STEP, rests=(2.0, False), end=end,
                    direction=direction, fired=fired,
                )  # fmt: skip
                assert found == (0.0 if crosses else NO_ROOT, after, 1.0)
                assert run.on_guard.tolist() == [5, 0]

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_jumps_is_left_by_its_signs(self, way):
        """It is beside the jump for a moment of 1/16, two of which are a place of 1/8.

        Where the signs show the other side, it has yet to jump at 1/10 of the step of 2.
        """
        for beside, fired, expected in ((way, TRANSITION, 0.5), (-way, TRANSITION, 0.05), (way, -1, 0.0)):
            curve = Curve(
                lambda s: way if 0.1 <= s < 1.0 else -way, lambda s: 0.0, (0.1, 1.0), steep=(0.1, 1.0)
            )
            model, method, run, work = scene(curve, side=way, on_guard=JUMPING, fired=fired)
            asked = []

            def field(mode, t, x, parameters, out):
                assert (mode, t, x is run.y, out is work.field) == (0, START, True, True)  # noqa: B023
                asked.append(mode)  # noqa: B023

            def signs_beside(*given, beside=beside):
                assert given[2:4] == (TRANSITION, START)
                return -beside, beside, 0.0625

            model.field = field
            tested = plain(isolate, signs_beside=signs_beside).crossing_on_path
            found = tested(model, method, run, TRANSITION, NO_COLUMN, ALONG._replace(length=2.0), 0.0, work)
            assert len(asked) == (fired == TRANSITION)
            if fired == TRANSITION:
                assert found[0] == approx(expected, 4.0)
            else:
                assert found[0] == expected
            assert run.on_guard.tolist() == [5, 0]

    @pytest.mark.parametrize("way", [1, -1])
    def test_the_rest_of_the_step_after_noise(self, way):
        found, _ = self.crossing(
            polynomial(0.0, 0.0, 0.0, 0.125, 1.0, factor=-way), way, on_guard=BY_STEP, rests=(0.25, False)
        )
        assert found == (approx(0.5, 4.0), -way, 1.0)


class TestAtTheStart:
    """Crossings within 64 units of the start, where a transition that has just fired does not fire again."""

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_is_certain_to_have_left_may_cross_again(self, way):
        change = TestFirstChange().change
        just = {"fired": TRANSITION, "since_entry": 0.0}
        root = 32.0 * EPSILON
        # By its speed.
        found, run = change(polynomial(0.0, root, factor=-way), way, on_guard=BY_SPEED, **just)
        assert found == (approx(root, 4.0), -way, 1.0)
        assert run.passed[TRANSITION] == NO_ROOT
        # By the signs beside its jump: up to 8 units either is possible.
        edge = 4.0 * EPSILON

        def jump(s):
            return way * (1.0 if edge <= s < root else -1.0)

        def curve():
            return Curve(jump, lambda s: 0.0, (edge, root), steep=(edge, root))

        found, _ = change(curve(), way, on_guard=JUMPING, hidden=8.0 * EPSILON, **just)
        assert found == (approx(root, 4.0), -way, 1.0)
        # Without signs beside it, what the step shows is only its side.
        found, run = change(curve(), way, on_guard=JUMPING, **just)
        assert found == (NOWHERE, -way, 1.0)
        assert run.passed[TRANSITION] == NO_ROOT

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_crossings_in_the_other_direction_are_remembered(self, way, unit):
        """As shares of the step; the last one counts."""
        change = TestFirstChange().change
        curve = polynomial(0.25 * unit, factor=-way)
        found, run = change(curve, way, direction=way, length=unit)
        assert found == (NOWHERE, -way, unit)
        assert run.passed.tolist() == [NO_ROOT, approx(0.25, 4.0)]
        found, run = change(polynomial(0.25 * unit, factor=-way), way, direction=-way, length=unit)
        assert run.passed.tolist() == [NO_ROOT, NO_ROOT]
