"""Pairs of which one is zero: relays, jumps of the state, none and several solutions, refusals."""

import pickle

import numpy as np
import pytest

from hybrid import (
    ArgumentError,
    ModelError,
    Pair,
    StatusCode,
    complementarity,
    continue_equilibrium,
    equilibrium,
    filippov,
    simulate,
    simulate_many,
)
from hybrid.testing import check_system
from tests.hybrid.transform.pairs.circuits import boost, capacitors, half_wave, relay


def rates_of_x(t, x, z, p):
    return (z.d - p.b,)


def state(t, x, z, p):
    return x.x


def one(rates=lambda t, x, z, p: (z.d,), w=lambda t, x, z, p: x.x, **given):
    return complementarity(state=("x",), rates=rates, pairs=[Pair("d", w=w)], **given)


class TestRelay:
    @pytest.mark.parametrize("x0", [0.7, -0.7, 0.0])
    def test_slides_and_leaves_as_a_filippov_system(self, x0):
        drive = {"drive": 0.6}
        surface = filippov(
            ("x",),
            {"drive": 0.6},
            below=lambda t, x, p: (1.0 + p.drive * t,),
            above=lambda t, x, p: (-1.0 + p.drive * t,),
            switching=lambda t, x, p: x.x,
        )
        arc, other = (
            simulate(relay(), (x0,), (0.0, 4.0), parameters=drive),
            simulate(surface, (x0,), (0.0, 4.0)),
        )
        times = np.linspace(0.0, 4.0, 81)
        np.testing.assert_allclose(arc(times, "x"), other(times, "x"), atol=1e-12)
        np.testing.assert_allclose(arc.jumps.t, other.jumps.t, atol=1e-12)

    def test_the_share_of_the_sign_where_it_slides(self):
        arc = simulate(relay(), (0.0,), (0.0, 1.0), parameters={"drive": 0.6})
        assert set(arc.mode) == {"up"}
        np.testing.assert_allclose(arc["up.z"] - 1.0, -0.6 * arc.t, atol=1e-12)

    def test_one_that_repels_has_several_motions(self):
        with pytest.raises(ArgumentError, match="'free' or 'up' or 'up\\+low'"):
            simulate(relay(sign=1.0), (0.0,), (0.0, 1.0))
        assert simulate(relay(sign=1.0), (0.0,), (0.0, 1.0), mode="free").x[-1, 0] == pytest.approx(1.0)

    def test_what_is_unique_at_some_parameters_is_asked_again_at_others(self):
        system = one(
            rates=lambda t, x, z, p: (z.d - 0.1,),
            w=lambda t, x, z, p: x.x + np.where(np.mod(t, 2.0) < 1.0, z.d, p.b * z.d),
            parameters={"b": 1.0},
        )
        assert simulate(system, (1.0,), (0.0, 1.5)).status.ok
        # The tick that led on before finds two motions now.
        arc = simulate(system, (1.0,), (0.0, 1.5), parameters={"b": -1.0})
        assert arc.status.code == StatusCode.TERMINAL
        assert arc.jumps[-1].transition == "not unique"
        assert simulate(system, (1.0,), (0.0, 1.5)).status.ok

    def test_an_equilibrium_that_slides_and_where_it_ends(self):
        system = complementarity(
            state=("x", "y"),
            parameters={"a": 0.3},
            rates=lambda t, x, z, p: (z.up - 1.0 + p.a + x.y, -x.y),
            pairs=[
                Pair("up", w=lambda t, x, z, p: x.x + z.low),
                Pair("low", w=lambda t, x, z, p: 2.0 - z.up),
            ],
        )
        rest = equilibrium(system, (0.0, 0.2), mode="up")
        assert rest.admissible
        assert rest["up.z"] == pytest.approx(0.7, abs=1e-12)
        ends = continue_equilibrium(rest, "a", (-2.0, 2.0)).bifurcations
        np.testing.assert_allclose([each.value for each in ends], [-1.0, 1.0], atol=1e-9)


class TestJumps:
    def test_capacitors_share_their_charge(self):
        arc = simulate(capacitors(), (10.0, 2.0), (0.0, 5.0))
        p = capacitors().parameters
        joint = (p["C1"] * 10.0 + p["C2"] * 2.0) / (p["C1"] + p["C2"])
        np.testing.assert_allclose(arc.jumps[0].x_plus, joint, rtol=1e-14)
        expected = joint * np.exp(-5.0 / (p["R"] * (p["C1"] + p["C2"])))
        np.testing.assert_allclose(arc.x[-1], expected, rtol=1e-11)

    def test_capacitors_that_are_apart_meet_without_a_jump(self):
        arc = simulate(capacitors(), (1.0, 2.0), (0.0, 5.0))
        assert arc.jumps[0].t == pytest.approx(6.0 * np.log(2.0), abs=1e-12)
        np.testing.assert_allclose(arc.jumps[0].x_plus, 1.0, rtol=1e-12)

    def test_many_starts(self):
        starts = np.array([[10.0, 2.0], [1.0, 2.0]])
        many = simulate_many(capacitors(), starts, (0.0, 1.0)).x_end.values
        alone = [simulate(capacitors(), tuple(each), (0.0, 1.0)).x[-1] for each in starts]
        np.testing.assert_allclose(many, alone, rtol=1e-12)

    def test_a_source_that_steps(self):
        held = one(
            rates=lambda t, x, z, p: (z.d - x.x,),
            w=lambda t, x, z, p: x.x - np.where(np.mod(t, 2.0) < 1.0, 0.0, 3.0),
        )
        arc = simulate(held, (1.0,), (0.0, 2.5))
        np.testing.assert_allclose(arc.jumps.t, [1.0, 2.0], atol=1e-14)
        np.testing.assert_allclose(arc.jumps[0].x_minus, np.exp(-1.0), rtol=1e-12)
        np.testing.assert_allclose(arc.jumps[0].x_plus, 3.0, rtol=1e-14)
        assert arc.x[-1, 0] == pytest.approx(3.0 * np.exp(-0.5), rel=1e-12)

    def test_a_current_below_zero_is_stopped(self):
        arc = simulate(half_wave(), (-2.0,), (0.0, 1.0))
        np.testing.assert_allclose(arc.jumps[0].x_plus, 0.0, atol=1e-15)

    def test_a_jump_that_is_not_along_a_line_is_no_solution(self):
        system = one(
            rates=lambda t, x, z, p: (z.d - x.x,),
            w=lambda t, x, z, p: x.x + x.x**3 - np.where(np.mod(t, 2.0) < 1.0, 0.0, 2.0),
        )
        arc = simulate(system, (0.5,), (0.0, 1.5))
        assert arc.jumps[-1].transition == "no solution"
        held = simulate(system, (1.5,), (1.0, 1.9))
        # It is met without a jump at x = 1, and held there.
        assert held.x[-1, 0] == pytest.approx(1.0, abs=1e-12)
        assert held.mode[-1].endswith("d")

    def test_jumps_to_several_motions(self):
        # Behind the jump to x = 0, w = x + a - a z allows z = 0 and z = 1 beside.
        system = complementarity(
            state=("x", "y"),
            rates=lambda t, x, z, p: (z.d, z.e),
            pairs=[
                Pair("d", w=lambda t, x, z, p: x.x),
                Pair("e", w=lambda t, x, z, p: 1.0 - z.e),
            ],
        )
        arc = simulate(system, (-1.0, 0.0), (0.0, 1.0))
        assert arc.jumps[-1].transition == "not unique"


class TestTouches:
    """x = (1 - t)^n comes to zero with a speed of zero."""

    @pytest.mark.parametrize(("n", "start"), [(2, 0.0), (3, 0.0), (2, 1.0), (3, 1.0), (4, 1.0), (5, 1.0)])
    def test_the_first_derivative_that_is_not_zero_decides(self, n, start):
        system = one(rates=lambda t, x, z, p: (-n * (1.0 - t) ** (n - 1) + z.d,))
        arc = simulate(system, ((1.0 - start) ** n,), (start, 2.0))
        expected = 1.0 if n % 2 == 0 else 0.0
        assert arc.status.ok
        assert arc.x[-1, 0] == pytest.approx(expected, abs=1e-12)
        assert arc.mode[-1] == ("free" if n % 2 == 0 else "d")


class TestNoneAndSeveral:
    """With w = x - z two motions begin at x > 0, and none at x < 0."""

    def test_several_at_a_start(self):
        with pytest.raises(ArgumentError, match="'free' or 'd'"):
            simulate(one(w=lambda t, x, z, p: x.x - z.d), (1.0,), (0.0, 1.0))

    def test_none(self):
        system = one(rates=lambda t, x, z, p: (0.1 * z.d - 1.0,), w=lambda t, x, z, p: x.x - z.d)
        arc = simulate(system, (1.0,), (0.0, 5.0), mode="free")
        assert arc.status.code == StatusCode.TERMINAL
        assert arc.jumps[-1].transition == "no solution"
        assert arc.t[-1] == pytest.approx(1.0, abs=1e-12)
        assert "No z >= 0 keeps w >= 0" in arc.status.message

    def test_several_at_a_tick(self):
        system = one(
            rates=lambda t, x, z, p: (z.d - 0.1,),
            w=lambda t, x, z, p: x.x + np.where(np.mod(t, 2.0) < 1.0, z.d, -z.d),
        )
        arc = simulate(system, (1.0,), (0.0, 5.0))
        assert arc.jumps[-1].transition == "not unique"
        assert arc.t[-1] == pytest.approx(1.0)
        assert "Several motions" in arc.status.message


class TestRefusals:
    @pytest.mark.parametrize(
        ("given", "text"),
        [
            ({"rates": lambda t, x, z, p: (z.d**2,)}, "must be affine in z"),
            ({"w": lambda t, x, z, p: x.x + abs(z.d)}, "must be affine in z"),
            ({"rates": lambda t, x, z, p: (z.d + abs(x.x),)}, "a kink or a jump at x=0"),
            ({"rates": lambda t, x, z, p: (z.d, 1.0)}, "must return 1 values"),
            ({"rates": lambda t, x, z, p: (z.e,)}, "Pair 'e' does not exist. Pairs: d"),
            ({"rates": 3}, "must be a function of \\(t, x, z, p\\)"),
            ({"w": lambda t, x, z, p: (x.x, z.d)}, "must return one number; got 2"),
            ({"w": lambda t, x, z, p: x.x + x.x * z.d}, "factors that do not depend on the state"),
            ({"w": lambda t, x, z, p: t}, "relative degree two or more"),
            ({"w": lambda t, x, z, p: 1.0 if x.x > 0 else 0.0}, "cannot be traced"),
            ({"modes": {"on": lambda t, x, p: t > 1}}, "have no clock"),
            (
                {
                    "w": lambda t, x, z, p: x.x + np.where(np.mod(t, 1.0) < 0.5, 0.0, 1.0),
                    "modes": {"night": "mod(t,1)>0.7"},
                },
                "modes\\['night'\\] holds in no mode",
            ),
            ({"outputs": {"d.z": lambda t, x, p: x.x}}, "'d.z' is told of a pair"),
        ],
    )
    def test_what_is_no_system(self, given, text):
        with pytest.raises(ModelError, match=text):
            one(**given)

    def test_a_gap_is_left_to_mechanics(self):
        with pytest.raises(ModelError, match="For bodies that touch use mechanics"):
            complementarity(
                state=("q", "v"),
                rates=lambda t, x, z, p: (x.v, z.d - 9.81),
                pairs=[Pair("d", w=lambda t, x, z, p: x.q)],
            )

    def test_what_is_no_list_of_pairs(self):
        pair = Pair("d", w=lambda t, x, z, p: x.x)
        for pairs, text in (
            ([], "list of Pair"),
            ([pair, pair], "names of their own"),
            ([3], "must be a Pair"),
        ):
            with pytest.raises(ModelError, match=text):
                complementarity(state=("x",), rates=lambda t, x, z, p: (z.d,), pairs=pairs)
        many = [Pair(f"d{i}", w=lambda t, x, z, p: x.x) for i in range(11)]
        with pytest.raises(ModelError, match="at most 10"):
            complementarity(state=("x",), rates=lambda t, x, z, p: (z.d0,), pairs=many)

    @pytest.mark.parametrize(
        ("given", "text"),
        [
            ({"name": "a b"}, "name that can be written as an attribute"),
            ({"name": "free"}, "not be 'free'"),
            ({"w": 1.0}, "w must be a function"),
            ({"says": "a, b"}, "says must be a text without"),
        ],
    )
    def test_what_is_no_pair(self, given, text):
        with pytest.raises(ModelError, match=text):
            Pair(**{"name": "d", "w": lambda t, x, z, p: x.x, **given})

    def test_a_mode_that_does_not_exist(self):
        with pytest.raises(ModelError, match="Mode 'on' does not exist"):
            simulate(one(), (1.0,), (0.0, 1.0), mode="on")

    def test_a_parameter_at_which_the_equations_are_others(self):
        system = one(
            rates=lambda t, x, z, p: (z.d - 1.0,), w=lambda t, x, z, p: x.x + p.r * z.d, parameters={"r": 1.0}
        )
        assert simulate(system, (1.0,), (0.0, 2.0)).x[-1, 0] == pytest.approx(np.exp(-1.0) - 1.0)
        with pytest.raises(ArgumentError, match="in w of 'd' is zero"):
            simulate(system, (1.0,), (0.0, 2.0), parameters={"r": 0.0})

    def test_factors_that_cancel_at_some_parameters(self):
        system = complementarity(
            state=("x",),
            parameters={"r": 1.0},
            rates=lambda t, x, z, p: (z.a,),
            pairs=[
                Pair("a", w=lambda t, x, z, p: z.a + z.b - 1.0 + x.x),
                Pair("b", w=lambda t, x, z, p: z.a + p.r * z.b - 1.0 + 2.0 * x.x),
            ],
        )
        with pytest.raises(ArgumentError, match="cancel at these values"):
            simulate(system, (0.0,), (0.0, 1.0))


@pytest.mark.parametrize(
    ("system", "states"),
    [
        (half_wave(), {"i": (0.0, 2.0)}),
        (boost(), {"i": (0.0, 12.0), "v": (12.0, 40.0)}),
        (relay(), {"x": (-2.0, 2.0)}),
    ],
    ids=["half_wave", "boost", "relay"],
)
def test_what_every_system_must_have(system, states):
    check_system(system, states=states, examples=6)


def test_states_by_number_and_a_copy():
    system = complementarity(
        state=2,
        rates=lambda t, x, z, p: (z.d - x[1], x[0]),
        pairs=[Pair("d", w=lambda t, x, z, p: x[0])],
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 3.0))
    np.testing.assert_allclose(arc.jumps.t, [np.pi / 2.0], atol=1e-12)
    np.testing.assert_allclose(arc.x[-1], [0.0, 1.0], atol=1e-12)


def test_a_pickled_system_makes_its_modes_again():
    system = complementarity(
        state=("x",), rates=rates_of_x, pairs=[Pair("d", w=state)], parameters={"b": 1.0}
    )
    arc = simulate(system, (1.0,), (0.0, 2.0))
    again = simulate(pickle.loads(pickle.dumps(system)), (1.0,), (0.0, 2.0))
    np.testing.assert_allclose(again.jumps.t, [1.0], atol=1e-14)
    assert again.mode[-1] == arc.mode[-1] == "d"
