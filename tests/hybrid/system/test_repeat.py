"""Many of a kind: members are ordinary components, and run as the same model written by hand."""

import pickle

import attrs
import cloudpickle
import numpy as np
import pytest

from hybrid import (
    After,
    ArgumentError,
    At,
    Delay,
    Every,
    Guard,
    HybridSystem,
    Laws,
    Mode,
    ModelError,
    Reset,
    Transition,
    from_equations,
    repeat,
    simulate,
    simulate_many,
    split,
)
from hybrid.system.graph import laws_of
from hybrid.testing import Case, PropertyError, check_laws


def fire(**changes):
    given = {
        "guard": Guard(lambda t, x, p, i: x.cell[i].u - 1.0, +1),
        "reset": Reset(lambda t, x, p, i: {"u": 0.0, "n": x.cell[i].n + 1}),
        "name": "fire",
    }
    given |= changes
    return Transition("run", "run", given["guard"], given["reset"], name=given["name"])


def cells(count=3, **changes):
    """Cells that charge, each at its own rate, and fire."""
    given = {
        "state": ("u",),
        "counters": ("n",),
        "parameters": {"rate": [1.0 + 0.5 * i for i in range(count)]},
        "field": lambda t, x, p, i: {"u": p.cell[i].rate},
        "transitions": [fire()],
    }
    return repeat("cell", count, **(given | changes))


def system(*repeats, **changes):
    given = {"modes": [Mode("run", lambda t, x, p: ())], "repeats": repeats or [cells()]}
    return HybridSystem(**(given | changes))


class TestExpansion:
    def test_members_are_ordinary_components_parameters_and_transitions(self):
        both = system(
            cells(2, held=("on",), outputs={"twice": lambda t, x, p, i: 2 * x.cell[i].u}),
            repeat("lamp", 1, state=("T",), field=lambda t, x, p, i: (0.0,)),
            state=("q",),
            held=("h",),
            counters=("k",),
            parameters={"low": 0.5},
            modes=[Mode("run", lambda t, x, p: (1.0,))],
        )
        assert both.state == ("q", "cell[0].u", "cell[1].u", "lamp[0].T")
        assert both.held == ("h", "cell[0].on", "cell[1].on")
        assert both.counters == ("k", "cell[0].n", "cell[1].n")
        assert dict(both.parameters) == {"low": 0.5, "cell[0].rate": 1.0, "cell[1].rate": 1.5}
        assert both.transition_names == ("cell[0].fire", "cell[1].fire")
        assert [*both.outputs] == ["cell[0].twice", "cell[1].twice"]

    def test_one_number_is_that_of_each_member(self):
        assert [*system(cells(parameters={"rate": 2})).parameters.values()] == [2.0, 2.0, 2.0]

    def test_a_system_with_members_is_changed_as_others_are(self):
        first = system()
        other = attrs.evolve(first, parameters=first.parameters | {"cell[1].rate": 4.0}, name="pack")
        assert other.state == first.state
        arc = simulate(other, {"cell.u": 0.0}, (0.0, 0.9))
        np.testing.assert_allclose(arc["cell.u"][-1], [0.9, 3.6 % 1, 1.8 % 1])

    def test_members_can_be_added_to_a_system(self):
        lamps = repeat("lamp", 2, state=("T",), field=lambda t, x, p, i: {"T": x.cell[i].u})
        arc = simulate(attrs.evolve(system(), repeats=[lamps]), [0.0] * 5, (0.0, 0.5))
        np.testing.assert_allclose(arc["lamp.T"][-1], [0.125, 0.1875], rtol=1e-12)
        np.testing.assert_allclose(arc["cell.u"][-1], [0.5, 0.75, 0.0], atol=1e-12)

    def test_one_field_for_all_modes_or_one_for_each(self):
        modes = [Mode("up", lambda t, x, p: ()), Mode("down", lambda t, x, p: ())]
        turn = Transition("up", "down", Guard(lambda t, x, p: t - 1.0, +1))
        fields = {"up": lambda t, x, p, i: (1.0 + i,), "down": lambda t, x, p, i: {"u": -1.0}}
        found = {}
        for name, field in (("each", fields), ("one", lambda t, x, p, i: {"u": 1.0})):
            cell = repeat("cell", 2, state=("u",), field=field)
            both = HybridSystem(repeats=[cell], modes=modes, transitions=[turn], start="up")
            found[name] = simulate(both, {"cell.u": 0.0}, (0.0, 3.0))["cell.u"][-1]
        np.testing.assert_allclose(found["each"], [-1.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(found["one"], [3.0, 3.0])

    def test_a_member_may_have_held_components_alone(self):
        flags = repeat(
            "flag",
            2,
            held=("up",),
            transitions=[
                Transition("run", "run", Every(lambda p, i: 1.0 + i), Reset(lambda t, x, p, i: {"up": t}))
            ],
        )
        arc = simulate(
            HybridSystem(state=("q",), repeats=[flags], modes=[Mode("run", lambda t, x, p: (0.0,))]),
            [0.0],
            (0.0, 3.5),
        )
        assert arc["flag.up"][-1].tolist() == [3.0, 2.0]
        assert arc.jumps.transition.tolist() == [
            "flag[0].run->run",
            "flag[0].run->run",
            "flag[1].run->run",
            "flag[0].run->run",
        ]

    def test_a_system_is_pickled_with_its_members(self):
        again = pickle.loads(cloudpickle.dumps(system()))
        ends = [simulate(each, {"cell.u": 0.2}, (0.0, 2.0)).x[-1] for each in (system(), again)]
        np.testing.assert_array_equal(*ends)
        with pytest.raises(ModelError, match="field cannot be pickled"):
            pickle.dumps(system())


class TestFunctions:
    def test_functions_see_members_in_every_form(self):
        seen = {}

        def rates(t, x, p, i):
            seen[i] = len(x.cell), len(x.cell[1:]), x.cell[-1] == x.cell[2]
            mean = sum(each.u for each in x.cell) / len(x.cell)
            pulled = np.mean(x.cell.u) - np.max(x.cell[:2].u) + np.dot(p.cell.rate, x.cell.u)
            return {"u": mean - x.cell[i - 1].u + pulled}

        ring = system(cells(field=rates, transitions=[]))
        u, rate = np.array([0.2, 0.5, 0.9]), np.array([1.0, 1.5, 2.0])
        expected = 2 * u.mean() - np.roll(u, 1) - 0.5 + rate @ u
        field = ring.modes[0].field
        x, p = ring.variables.state_view([*u, 0.0, 0.0, 0.0]), ring.variables.parameter_view(rate)
        np.testing.assert_allclose(field(0.0, x, p), expected)
        arc = simulate(ring, {"cell.u": u}, (0.0, 1e-6))
        np.testing.assert_allclose((arc["cell.u"][-1] - u) / 1e-6, expected, rtol=1e-4)
        assert seen == dict.fromkeys(range(3), (3, 2, True))

    def test_arrays_of_members_are_those_of_numpy_in_fields_and_resets(self):
        share = Reset(lambda t, x, p: {"cell.u": np.where(x.cell.u > 0.5, x.cell.u / 2, x.cell.u)})
        halved = system(cells(4), transitions=[Transition("run", "run", At([0.1]), share, name="share")])
        arc = simulate(halved, {"cell.u": [0.1, 0.2, 0.7, 0.6]}, (0.0, 0.2))
        expected = np.array([0.3, 0.5, (0.7 + 0.2) / 2 + 0.2, (0.6 + 0.25) / 2 + 0.25])
        np.testing.assert_allclose(arc["cell.u"][-1], expected, rtol=1e-12)

    def test_what_does_not_exist_is_said(self):
        for function, text in (
            (lambda t, x, p, i: {"u": x.cell[i].w}, "State component 'w' does not exist"),
            (lambda t, x, p, i: {"u": x.cell.w[0]}, "State component of cell 'w' does not exist"),
            (lambda t, x, p, i: {"u": p.cell[i].w}, "Parameter 'w' does not exist"),
            (lambda t, x, p, i: {"u": x.cel[i].u}, "State component 'cel' does not exist.*'cell'"),
            (lambda t, x, p, i: {"u": x["cell"][i].u}, r"x\['cell'\] is written x.cell"),
            (lambda t, x, p, i: {"u": x.cell[i + 1].u}, r"cell\[3\] does not exist: cell has 3 members"),
        ):
            with pytest.raises(ModelError, match=text):
                system(cells(field=function))

    def test_arrays_of_members_cannot_be_written_to(self):
        def rates(t, x, p, i):
            x.cell.u[i] = 0.0
            return {"u": 1.0}

        with pytest.raises(ModelError, match="writes into its argument"):
            system(cells(field=rates))

    def test_functions_that_cannot_be_traced_are_refused(self):
        by_branch = system(cells(field=lambda t, x, p, i: {"u": 1.0 if x.cell[i].u > 0 else 2.0}))
        with pytest.raises(ModelError, match="cannot be traced, as the functions of a system with repeats"):
            simulate(by_branch, {"cell.u": 0.1}, (0.0, 1.0))

    def test_globals_of_members_are_watched(self):
        speed = [1.0]
        moved = system(cells(field=lambda t, x, p, i: {"u": speed[0]}, transitions=[]))
        ends = []
        for value in (1.0, 3.0):
            speed[0] = value
            ends.append(simulate(moved, {"cell.u": 0.0}, (0.0, 2.0))["cell.u"][-1, 0])
        assert ends == pytest.approx([2.0, 6.0])


class TestTransitions:
    def test_members_that_fire_at_one_instant_fire_in_order(self):
        first = Transition("run", "run", Guard(lambda t, x, p: x.q - 1.0, +1), name="own")
        both = system(
            cells(3, parameters={"rate": 1.0}, transitions=[fire(), fire(name="again")]),
            state=("q",),
            modes=[Mode("run", lambda t, x, p: (1.0,))],
            transitions=[first],
            listed_order=True,
        )
        arc = simulate(both, [0.0] * 4, (0.0, 1.5))
        order = arc.jumps.transition.tolist()
        assert order[0] == "own"
        members = [name for name in order if name != "own"]
        assert members == sorted(members, key=lambda name: name.partition("]")[0])
        assert np.ptp(arc.jumps.t) < 1e-12

    def test_resets_change_their_own_others_and_the_system(self):
        def reset(t, x, p, i):
            return {"u": 0.0, f"cell[{(i + 1) % 3}].u": 0.25, "q": 10.0 + i}

        both = system(
            cells(transitions=[fire(reset=Reset(reset))]),
            state=("q",),
            modes=[Mode("run", lambda t, x, p: (0.0,))],
        )
        arc = simulate(both, {"q": 0.0, "cell.u": [0.0, 0.0, 0.9]}, (0.0, 0.06))
        np.testing.assert_allclose(arc.jumps[0].x_plus[:4], [12.0, 0.25, 0.075, 0.0], atol=1e-12)

    def test_a_reset_may_give_all_components_of_its_member_in_order(self):
        arc = simulate(
            system(cells(transitions=[fire(reset=Reset(lambda t, x, p, i: (0.5, 7)))])),
            {"cell.u": [0.9, 0.0, 0.0]},
            (0.0, 0.15),
        )
        assert arc.jumps[0].x_plus.tolist() == pytest.approx([0.5, 0.15, 0.2, 7.0, 0.0, 0.0])

    def test_conditions_directions_and_ends(self):
        guard = Guard(lambda t, x, p, i: x.cell[i].u - 1.0, +1, when=lambda t, x, p, i: i != 2)
        ends = Transition("run", None, guard, name="full")
        arc = simulate(system(cells(transitions=[ends])), {"cell.u": 0.0}, (0.0, 5.0))
        assert (arc.jumps[0].transition, arc.jumps[0].t) == ("cell[1].full", pytest.approx(2 / 3))
        assert arc.status.code.name == "TERMINAL"

    @pytest.mark.parametrize(
        ("clock", "times"),
        [
            (Every("rate"), {0: [1.0, 2.0], 1: [1.5], 2: [2.0]}),
            (Every(1.0, offset=lambda p, i: 0.25 * i), {0: [1.0, 2.0], 1: [0.25, 1.25, 2.25], 2: [0.5, 1.5]}),
            (At([0.5, "rate"]), {0: [0.5, 1.0], 1: [0.5, 1.5], 2: [0.5, 2.0]}),
            (At(lambda p, i: p.cell[i].rate + p.late), {0: [1.1], 1: [1.6], 2: [2.1]}),
            (At("due"), {0: [0.7], 1: [1.4], 2: [2.1]}),
            (At(lambda p, i: p.cell[i].due + p.late), {0: [0.8], 1: [1.5], 2: [2.2]}),
            (After(lambda p, i: p.cell.rate[i] / 2), {0: [0.5], 1: [0.75], 2: [1.0]}),
        ],
    )
    def test_clocks_of_members(self, clock, times):
        mark = Transition("run", "run", clock, name="tick")
        both = system(cells(held=("due",), transitions=[mark]), parameters={"late": 0.1})
        start = {"cell.u": 0.0, "cell.due": [0.7, 1.4, 2.1]}
        arc = simulate(both, start, (0.0, 2.3))
        for i, expected in times.items():
            found = [jump.t for jump in arc.jumps[f"cell[{i}].tick"]]
            assert found[: len(expected)] == pytest.approx(expected, rel=1e-12)
        tangents = simulate(both, start, (0.0, 0.4), tangent=True).fundamental
        assert np.all(np.isfinite(tangents))

    def test_a_clock_does_not_read_what_has_a_field(self):
        for clock in (At("u"), At(lambda p, i: p.cell[i].u)):
            with pytest.raises(ModelError, match=r"At reads 'cell\[0\].u', which has a field"):
                simulate(
                    system(cells(transitions=[Transition("run", "run", clock)])), {"cell.u": 0.1}, (0.0, 1.0)
                )

    def test_derivatives_through_the_jumps_of_members(self):
        arc = simulate(
            system(), {"cell.u": [0.5, 0.3, 0.1]}, (0.0, 1.1), tangent=True, sensitivities=("cell[1].rate",)
        )
        # Each cell is a clock of its own: a sawtooth of slope 1 in its start, and 1.1 in its rate.
        np.testing.assert_allclose(arc.fundamental[:3, :3], np.eye(3), atol=1e-9)
        np.testing.assert_allclose(arc.sensitivity[:3, 0], [0.0, 1.1, 0.0], atol=1e-9)
        np.testing.assert_allclose(arc.jumps["cell[2].fire"][0].saltation, np.eye(3), atol=1e-9)

    def test_a_given_gradient_and_jacobian_of_members_are_checked(self):
        def gradient(t, x, p, i):
            return [1.0 if j == i else 0.0 for j in range(3)] + [0.0] * 3

        right = Guard(lambda t, x, p, i: x.cell[i].u - 1.0, +1, gradient=gradient)
        arc = simulate(system(cells(transitions=[fire(guard=right)])), {"cell.u": 0.0}, (0.0, 0.9))
        assert len(arc.jumps) == 2
        wrong = attrs.evolve(right, gradient=lambda t, x, p, i: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        with pytest.raises(ModelError, match=r"Transition 'cell\[1\].fire': gradient"):
            system(cells(transitions=[fire(guard=wrong)]))


class TestNames:
    def test_starts_by_name_of_one_of_all_and_in_order(self):
        both = system()
        for start in (
            {"cell.u": [0.1, 0.2, 0.3]},
            {"cell[0].u": 0.1, "cell[1].u": 0.2, "cell[2].u": 0.3, "cell.n": 0},
            {"cell.u": 0.2, "cell[0].u": 0.1, "cell[2].u": 0.3},
            [0.1, 0.2, 0.3],
            [0.1, 0.2, 0.3, 0.0, 0.0, 0.0],
        ):
            found = simulate(both, start, (0.0, 0.0)).x[0]
            np.testing.assert_allclose(found, [0.1, 0.2, 0.3, 0.0, 0.0, 0.0], rtol=1e-12)
        with pytest.raises(ArgumentError, match=r"x0: 'cell.u' must be one value for all, or one for each"):
            simulate(both, {"cell.u": [0.1, 0.2]}, (0.0, 1.0))
        with pytest.raises(ArgumentError, match=r"State component 'cell\.v' does not exist"):
            simulate(both, {"cell.v": 0.1}, (0.0, 1.0))

    def test_parameters_of_one_and_of_all(self):
        both = system()
        arc = simulate(both, [0.0] * 3, (0.0, 0.4), parameters={"cell[1].rate": 0.5, "cell.rate": 2.0})
        np.testing.assert_allclose(arc["cell.u"][-1], [0.8, 0.2, 0.8], rtol=1e-12)
        assert arc.parameters["cell[0].rate"] == pytest.approx(2.0)
        arc = simulate(both, [0.0] * 3, (0.0, 0.4), parameters={"cell.rate": [0.1, 0.2, 0.3]})
        np.testing.assert_allclose(arc["cell.u"][-1], [0.04, 0.08, 0.12], rtol=1e-12)

    def test_an_end_goes_on_only_with_its_parameters(self):
        both = system()
        end = simulate(both, [0.0] * 3, (0.0, 0.4)).end
        given = {"cell.rate": [1.0, 1.5, 2.0]}
        assert simulate(both, end, (0.4, 0.5), parameters=given).status.ok
        with pytest.raises(ArgumentError, match=r"the end of a run with cell\[0\]\.rate = .*; got"):
            simulate(both, end, (0.4, 0.5), parameters={"cell.rate": 5.0})

    def test_results_by_name_of_one_and_of_all(self):
        both = system(cells(outputs={"left": lambda t, x, p, i: 1.0 - x.cell[i].u}))
        arc = simulate(both, {"cell.u": 0.0}, (0.0, 2.1))
        assert arc["cell.u"].shape == arc["cell.left"].shape == (len(arc.t), 3)
        np.testing.assert_array_equal(arc["cell.u"][:, 1], arc["cell[1].u"])
        np.testing.assert_allclose(arc["cell.left"], 1.0 - arc["cell.u"])
        assert arc([0.1, 0.2], "cell.u").shape == (2, 3)
        np.testing.assert_allclose(arc(0.3, "cell.u"), [0.3, 0.45, 0.6])
        assert arc.jumps.before("cell.u").shape == (len(arc.jumps), 3)
        assert len(arc.jumps["cell.fire"]) == len(arc.jumps) == 9
        assert {jump.transition for jump in arc.jumps["cell[2].fire"]} == {"cell[2].fire"}
        data = arc.to_xarray()
        np.testing.assert_array_equal(data.x.sel(state="cell[2].u"), arc["cell[2].u"])
        with pytest.raises(ArgumentError, match=r"State component or output 'cell\.v' does not exist"):
            arc["cell.v"]

    def test_many_starts(self):
        starts = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
        found = simulate_many(system(), {"cell.u": starts}, (0.0, 0.1), parameters={"cell.rate": 1.0})
        np.testing.assert_allclose(found.x_end.values[:, :3], starts + 0.1)
        assert found.attrs["model_parameters"].count("1.0") == 3
        varied = simulate_many(system(), {"cell.u": 0.1, "cell[1].u": [0.2, 0.3]}, (0.0, 0.1))
        np.testing.assert_allclose(varied.x0.values[:, :3], [[0.1, 0.2, 0.1], [0.1, 0.3, 0.1]])

    def test_units_and_angles_of_members(self):
        both = system(
            cells(units={"u": "V", "rate": "V/s"}, outputs={"w": lambda t, x, p, i: 0.0}),
            units={"cell.w": "W", "t": "s"},
        )
        assert both.units["cell[2].u"] == "V"
        assert both.units["cell[1].rate"] == "V/s"
        assert both.units["cell[0].w"] == "W"
        turning = repeat("arm", 2, state=("phi",), angles={"phi": 6.0}, field=lambda t, x, p, i: (1.0,))
        assert system(turning).turn_lengths.tolist() == [6.0, 6.0]
        crooked = repeat(
            "arm", 2, state=("phi",), angles={"phi": 6.0}, field=lambda t, x, p, i: (x.arm[i].phi,)
        )
        with pytest.raises(ModelError, match="turn"):
            system(crooked)

    def test_a_system_is_shown_with_one_name_for_all_members(self):
        text = repr(system(cells(12, units={"u": "V"})))
        assert "state: cell.u (V) ×12" in text
        assert "cell.rate = 1 to 6.5 ×12" in text
        assert text.count("cell.fire") == 1
        assert "cell.fire ×12" in text
        assert "after cell.rate" in repr(system(cells(transitions=[Transition("run", "run", After("rate"))])))


class TestLaws:
    def test_laws_of_members_are_laws_of_each(self):
        laws = Laws(
            invariant={"room": lambda t, x, p, i: 1.0 - x.cell[i].u, "run": {"number": "n"}},
            across={"fire": lambda t, minus, plus, p, i: plus.cell[i].n - minus.cell[i].n - 1},
            dissipated={"filled": ("u", lambda t, x, p, i: p.cell[i].rate)},
        )
        both = system(cells(2, laws=laws), laws=Laws(invariant={"rates": lambda t, x, p: sum(p.cell.rate)}))
        found = laws_of(both)
        names = [law.name for law in found.invariant]
        assert names == ["rates", "cell[0].room", "cell[0].number", "cell[1].room", "cell[1].number"]
        assert [law.of for law in found.across] == ["cell[0].fire", "cell[1].fire"]
        check_laws(Case(both, both.parameters, "run", (0.5, 0.2, 0.0, 0.0), 0.0, 2.0))

    def test_a_broken_law_names_its_member(self):
        laws = Laws(invariant={"little": lambda t, x, p, i: 0.5 + i - x.cell[i].u})
        both = system(cells(2, laws=laws))
        with pytest.raises(PropertyError, match=r"'cell\[0\].little' is non-negative"):
            check_laws(Case(both, both.parameters, "run", (0.2, 0.2, 0.0, 0.0), 0.0, 2.0))

    def test_components_that_turn_back_are_those_of_all_members(self):
        swing = {"state": ("q", "v"), "field": lambda t, x, p, i: (x.ball[i].v, -x.ball[i].q)}
        balls = repeat("ball", 2, **swing, laws=Laws(elastic=("v",)))
        own = {"state": ("w",), "modes": [Mode("run", lambda t, x, p: (0.0,))]}
        both = system(balls, **own, laws=Laws(elastic=("w",)))
        assert both.laws.elastic == ("w", "ball[0].v", "ball[1].v")
        with pytest.raises(ModelError, match="elastic is a function of the whole state"):
            system(balls, **own, laws=Laws(elastic=lambda x: x))

    def test_an_involution_belongs_to_the_system(self):
        with pytest.raises(ModelError, match="elastic must be names of components of a member"):
            system(cells(laws=Laws(elastic=lambda x: x)))


def test_split_makes_modes_of_kinks_in_members():
    blocks = repeat(
        "block",
        2,
        state=("q", "v"),
        field=lambda t, x, p, i: {"q": x.block[i].v, "v": -x.block[i].q - 0.1 * np.sign(x.block[i].v)},
        transitions=[
            Transition(
                "slide",
                "slide",
                Guard(lambda t, x, p, i: x.block[i].q - 1.0, +1),
                Reset(lambda t, x, p, i: {"v": -x.block[i].v}),
                name="wall",
            )
        ],
    )
    dry = split(HybridSystem(repeats=[blocks], modes=[Mode("slide", lambda t, x, p: ())]))
    arc = simulate(dry, {"block.q": 0.0, "block.v": [1.0, 2.0]}, (0.0, 1.0))
    assert len(arc.jumps["block.wall"]) == len(arc.jumps["block[1].wall"]) == 1
    assert not arc.jumps["block[0].wall"]
    # Before it turns, block 1 swings about -0.1.
    t = arc.jumps["block.wall"][0].t
    assert 2.0 * np.sin(t) - 0.1 * (1 - np.cos(t)) == pytest.approx(1.0, rel=1e-10)


def test_plain_equations_of_members():
    """Two blocks that are damped by dry friction come to rest."""
    blocks = repeat(
        "block",
        2,
        state=("q", "v"),
        parameters={"mu": [0.3, 0.5]},
        field=lambda t, x, p, i: (x.block[i].v, -x.block[i].q - p.block[i].mu * np.sign(x.block[i].v)),
    )
    dry = from_equations(lambda t, x, p: (-x.T,), state=("T",), repeats=[blocks])
    arc = simulate(dry, {"T": 1.0, "block.q": [1.0, 0.9], "block.v": 0.0}, (0.0, 7.0))
    # A swing ends 2 mu nearer to the middle; a block that begins within mu of it stays.
    np.testing.assert_allclose(arc["block.q"][-1], [-0.4 + 0.2, -0.9 + 1.0], atol=1e-9)
    assert arc["T"][-1] == pytest.approx(np.exp(-7.0))


class TestRefusals:
    @pytest.mark.parametrize(
        ("make", "text"),
        [
            (lambda: repeat("2cell", 3), "repeat: name must be a Python identifier"),
            (lambda: repeat("cell", 0), "repeat 'cell': count must be a whole number of at least 1; got 0."),
            (lambda: repeat("cell[0].gate", 3), "A repeat inside of a repeat is not supported"),
            (lambda: cells(transitions=[cells()]), "transitions holds 'cell', which is a repeat"),
            (lambda: cells(state=("a b",)), "'a b' cannot be written as an attribute"),
            (lambda: cells(held=("u",)), "'u' stands in state and in held"),
            (lambda: cells(parameters={"rate": [1.0, 2.0]}), "one for each of the 3 members"),
            (lambda: cells(parameters={"rate": "fast"}), "parameter 'rate' must be a number"),
            (lambda: cells(field=None), "field is missing: the components u need rates"),
            (lambda: cells(field=3), r"field must be a function of \(t, x, p, i\)"),
            (lambda: cells(field=lambda t, x, p: (0.0,)), r"field must take \(t, x, p, i\)"),
            (lambda: cells(transitions=[fire(), fire()]), "transition names must differ; given twice: fire"),
            (lambda: cells(transitions=[fire(name="u>1")]), "'u>1' cannot be the name of a transition"),
            (
                lambda: cells(transitions=[fire(guard=Guard(lambda t, x, p: x.cell[0].u))]),
                r"transition 'fire': guard must take \(t, x, p, i\)",
            ),
            (
                lambda: cells(transitions=[fire(guard=Every(lambda p: 1.0))]),
                r"number of the clock must take \(p, i\)",
            ),
            (lambda: cells(outputs={"w": lambda t, x, p: 0.0}), r"Output 'w' must take \(t, x, p, i\)"),
            (lambda: cells(units={"w": "V"}), "units: Name 'w' does not exist"),
            (lambda: system(cells(), cells()), "repeat 'cell': the name is taken"),
            (lambda: system(parameters={"cell": 1.0}), "repeat 'cell': the name is taken"),
            (lambda: system(state=3), "repeats= needs a state with names; got state=3"),
            (lambda: system(repeats=3), "repeats must be a list of what hybrid.repeat returns"),
            (lambda: system(repeats=["cell"]), "each repeat must be a Repeat"),
            (
                lambda: system(state=("u",), modes=[Mode("run", lambda t, x, p: (0.0,))]),
                "'u' is a component of each member and of the system",
            ),
            (
                lambda: system(modes=[Mode("run", lambda t, x, p: (), jacobian=lambda t, x, p: ())]),
                "Mode 'run': jacobian= cannot be given",
            ),
            (lambda: system(cells(field={"rum": lambda t, x, p, i: (0.0,)})), "mode 'rum' does not exist"),
            (
                lambda: HybridSystem(
                    repeats=[repeat("cell", 2, state=("u",), field={"a": lambda t, x, p, i: (0.0,)})],
                    modes=[Mode("a", lambda t, x, p: ()), Mode("b", lambda t, x, p: ())],
                    transitions=[Transition("a", "b", At([1.0]))],
                ),
                "repeat 'cell': field lacks the mode 'b'",
            ),
            (
                lambda: system(modes=[Mode("run", lambda t, x, p: (1.0,))]),
                "the system: 1 values were returned for 0 components",
            ),
            (
                lambda: system(cells(state=("u", "v"), field=lambda t, x, p, i: {"u": 0.0})),
                r"cell\[0\] lacks the rate of v. Return one rate for each of u, v",
            ),
            (
                lambda: system(cells(field=lambda t, x, p, i: {"u": 0.0, "n": 1.0})),
                r"cell\[0\]: component 'n' does not exist. With a field: u",
            ),
            (lambda: system(cells(field=lambda t, x, p, i: 1.0)), "must be a dict by name, or in order"),
            (
                lambda: system(cells(transitions=[fire(reset=Reset(lambda t, x, p, i: {"w": 0.0}))])),
                "State component 'w' does not exist",
            ),
            (
                lambda: system(
                    cells(transitions=[fire(reset=Reset(lambda t, x, p, i: {"u": 0.0, f"cell[{i}].u": 1.0}))])
                ),
                r"'cell\[0\].u' is given twice",
            ),
            (
                lambda: system(cells(transitions=[fire(reset=Reset(lambda t, x, p, i: {"cell.u": [0.0]}))])),
                "a dict of what changes: 'cell.u' must be one value for all",
            ),
            (lambda: HybridSystem(modes=[Mode("run", lambda t, x, p: ())]), "needs at least one component"),
        ],
    )  # fmt: skip
    def test_what_is_wrong_is_said(self, make, text):
        with pytest.raises(ModelError, match=text):
            make()


def test_a_chain_is_the_chain_written_by_hand():
    """Neurons in a row, coupled by their potentials: with repeat, and with loops of lambdas."""
    n = 6
    drives = [1.2 + 0.3 * np.sin(i) for i in range(n)]

    def rate(t, x, p, i):
        v = x.neuron
        left, right = v[i - 1].V if i else 0.0, v[i + 1].V if i < n - 1 else 0.0
        return {"V": p.neuron[i].I - v[i].V + p.k * (left - 2 * v[i].V + right)}

    spike = Transition(
        "rise",
        "rise",
        Guard(lambda t, x, p, i: x.neuron[i].V - 1.0, +1),
        Reset(lambda t, x, p, i: {"V": 0.0}),
        name="fire",
    )
    row = repeat("neuron", n, state=("V",), parameters={"I": drives}, field=rate, transitions=[spike])
    repeated = HybridSystem(parameters={"k": 0.1}, repeats=[row], modes=[Mode("rise", lambda t, x, p: ())])

    def rates(t, x, p):
        beside = [0.0, *x, 0.0]
        return [drives[i] - x[i] + p.k * (beside[i] - 2 * x[i] + beside[i + 2]) for i in range(n)]

    def fires(i):
        guard = Guard(lambda t, x, p: x[i] - 1.0, +1)
        return Transition(
            "rise",
            "rise",
            guard,
            Reset(lambda t, x, p: [0.0 if j == i else x[j] for j in range(n)]),
            name=f"{i}",
        )

    by_hand = HybridSystem(
        state=n,
        parameters={"k": 0.1},
        modes=[Mode("rise", rates)],
        transitions=[fires(i) for i in range(n)],
    )
    start = [0.5 + 0.4 * np.cos(2 * i) for i in range(n)]
    one, other = (simulate(each, start, (0.0, 10.0), tangent=True) for each in (repeated, by_hand))
    assert len(one.jumps) == len(other.jumps) > 20
    np.testing.assert_allclose(one.jumps.t, other.jumps.t, rtol=1e-11)
    np.testing.assert_allclose(one.x[-1], other.x[-1], rtol=1e-9)
    np.testing.assert_allclose(one.fundamental, other.fundamental, rtol=1e-7, atol=1e-9)


def test_delays_of_members_and_of_all():
    """A wait of each member begins with its own firing; the system counts all that arrive a while later."""
    cells = repeat(
        "cell",
        3,
        state=("u",),
        counters=("heard",),
        parameters={"rate": [1.0, 0.8, 0.5]},
        field=lambda t, x, p, i: {"u": p.cell[i].rate},
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p, i: x.cell[i].u - 1.0, +1),
                Reset(lambda t, x, p, i: {"u": 0.0}),
                name="fire",
            ),
            Transition(
                "run",
                "run",
                Delay("fire", lambda p, i: 0.1 * (i + 1)),
                Reset(lambda t, x, p, i: {"heard": x.cell[i].heard + 1}),
                name="arrive",
            ),
        ],
    )
    system = HybridSystem(
        counters=("all",),
        state=("z",),
        repeats=[cells],
        modes=[Mode("run", lambda t, x, p: {"z": -x.z})],
        transitions=[
            Transition(
                "run", "run", Delay("cell.fire", 0.35), Reset(lambda t, x, p: {"all": x.all + 1}), name="sum"
            )
        ],
    )
    arc = simulate(system, {"z": 1.0, "cell.u": 0.0}, (0.0, 4.0))
    with pytest.raises(ArgumentError, match=r"The state is z, cell\[0\].u, .*cell\[2\].heard; give"):
        simulate(system, {"z": 1.0}, (0.0, 4.0))
    assert arc.status.ok
    fired = []
    for i, rate in enumerate((1.0, 0.8, 0.5)):
        times = np.arange(1.0 / rate, 4.0 + 1e-9, 1.0 / rate)
        fired += times.tolist()
        heard = [jump.t for jump in arc.jumps[f"cell[{i}].arrive"]]
        later = times + 0.1 * (i + 1)
        np.testing.assert_allclose(heard, later[later <= 4.0], rtol=1e-12)
    later = np.sort(np.array(fired) + 0.35)
    np.testing.assert_allclose([jump.t for jump in arc.jumps["sum"]], later[later <= 4.0], rtol=1e-12)


def test_a_field_of_the_system_goes_by_name_beside_members():
    cells = repeat("cell", 2, state=("u",), field=lambda t, x, p, i: {"u": 1.0})
    system = HybridSystem(
        state=("y", "z"), repeats=[cells], modes=[Mode("run", lambda t, x, p: {"z": 2.0, "y": -1.0})]
    )
    arc = simulate(system, {"y": 0.0, "z": 0.0, "cell.u": 0.0}, (0.0, 1.0))
    np.testing.assert_allclose(arc.x[-1], [-1.0, 2.0, 1.0, 1.0], rtol=1e-12)
    with pytest.raises(ModelError, match="the system lacks the rate of y"):
        HybridSystem(state=("y", "z"), repeats=[cells], modes=[Mode("run", lambda t, x, p: {"z": 2.0})])
