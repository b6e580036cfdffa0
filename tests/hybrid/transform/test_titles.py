"""Names that an author gives to the modes of a split system."""

import cloudpickle
import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, ModelError, Reset, Transition, from_equations, simulate, split
from hybrid.simulation.identity import facts_of

PLANE = ("q", "v")


def between_stops(t, x, p):
    return x.v, 2 * np.cos(t) - x.q - 20 * np.maximum(x.q - 1, 0) + 20 * np.maximum(-1 - x.q, 0)


def rubbing(t, x, p):
    return x.v, 7 * np.cos(t) - x.q**3 - p.mu * np.sign(x.v) - 4 * np.maximum(x.q - p.gap, 0)


def names_of(field, modes, parameters=None):
    return from_equations(field, state=PLANE, parameters=parameters, modes=modes).mode_names


class TestNames:
    GAP = ("q<-1", "in the gap", "q>1")

    @pytest.mark.parametrize(
        "condition",
        [
            lambda t, x, p: (x.q > -1) & (x.q < 1),
            lambda t, x, p: abs(x.q) < 1,
            lambda t, x, p: np.abs(x.q) < 1,
            lambda t, x, p: np.logical_and(2 * x.q < 2, 0.5 * x.q > -0.5),
            "q<1, q>-1",
            "q > -1, q < 1",
        ],
    )
    def test_a_condition_takes_the_place_of_its_sides(self, condition):
        assert sorted(names_of(between_stops, {"in the gap": condition})) == sorted(self.GAP)

    def test_transitions_and_legends_have_them(self):
        system = from_equations(
            between_stops, state=PLANE, modes={"in the gap": lambda t, x, p: abs(x.q) < 1}
        )
        assert "in the gap->q>1" in system.transition_names
        arc = simulate(system, (0.0, 2.0), (0.0, 20.0), mode="in the gap")
        legend = hybrid.plot(arc)[0].get_legend()
        assert "in the gap" in [text.get_text() for text in legend.get_texts()]
        assert set(arc.part_of) == {"smooth"}

    def test_other_sides_follow(self):
        modes = {
            "free": lambda t, x, p: x.q < p.gap,
            "pressed": lambda t, x, p: x.q > p.gap,
            "stuck": lambda t, x, p: x.v == 0,
        }
        found = names_of(rubbing, modes, {"mu": 1.5, "gap": 1.0})
        assert {"free, v<0", "free, v>0", "pressed, v<0", "free, stuck", "pressed, stuck"} < set(found)

    @pytest.mark.parametrize(
        ("condition", "parts"),
        [
            (lambda t, x, p: (x.v < 0) | (x.v > 0), ["moves, q<gap, v<0", "moves, q<gap, v>0"]),
            (lambda t, x, p: ~(x.v == 0), ["moves, q<gap, v<0", "moves, q<gap, v>0"]),
            (lambda t, x, p: x.v <= 0, ["moves, q<gap", "moves, q<gap, v=0"]),
        ],
    )
    def test_where_a_name_does_not_tell_the_side_the_side_stays(self, condition, parts):
        found = names_of(rubbing, {"moves": condition}, {"mu": 1.5, "gap": 1.0})
        assert set(parts) <= set(found)
        assert len(set(found)) == len(found) == 6

    def test_a_system_with_modes_of_its_own(self):
        ball = HybridSystem(
            state=PLANE,
            modes=[
                Mode("flight", lambda t, x, p: (x.v, -9.81 - 0.5 * x.v * np.abs(x.v))),
                Mode("off", lambda t, x, p: (0.0, 0.0)),
            ],
            transitions=[
                Transition(
                    "flight",
                    "flight",
                    Guard(lambda t, x, p: x.q, -1),
                    Reset(lambda t, x, p: {"v": -0.9 * x.v}),
                ),
                Transition("flight", "off", Guard(lambda t, x, p: x.q - 5.0, +1)),
            ],
        )
        found = split(ball, modes={"down": lambda t, x, p: x.v < 0})
        assert found.mode_names == ("flight: down", "flight: v>0", "off")
        arc = simulate(found, (1.0, 0.0), (0.0, 2.0), mode="flight")
        assert {"flight: down", "flight: v>0"} == set(arc.mode)

    def test_runs_are_those_without_names(self):
        plain = from_equations(rubbing, state=PLANE, parameters={"mu": 1.5, "gap": 1.0})
        called = from_equations(
            rubbing,
            state=PLANE,
            parameters={"mu": 1.5, "gap": 1.0},
            modes={"free": lambda t, x, p: x.q < p.gap},
        )
        one, other = (simulate(each, (0.5, 0.1), (0.0, 20.0)) for each in (plain, called))
        np.testing.assert_array_equal(one.x, other.x)

    def test_modes_that_are_made_on_the_way(self):
        system = from_equations(
            lambda t, x, p: (x.v, -x.q - 0.1 * np.sign(x.v) - 0.5 * np.floor(x.q) + 3 * np.sin(t)),
            state=PLANE,
            modes={"forward": lambda t, x, p: x.v > 0},
        )
        arc = simulate(system, (3.2, 0.0), (0.0, 5.0))
        forward = np.array(["forward" in name for name in arc.mode])
        assert forward.any()
        assert np.all(arc["v"][forward] > -1e-9)
        assert np.all(arc["v"][~forward] < 1e-9)

    def test_a_system_with_names_can_be_pickled(self):
        system = from_equations(
            between_stops, state=PLANE, modes={"in the gap": lambda t, x, p: abs(x.q) < 1}
        )
        assert cloudpickle.loads(cloudpickle.dumps(system)).mode_names == system.mode_names

    def test_a_store_knows_systems_by_their_names(self):
        def growing(modes):
            return from_equations(
                lambda t, x, p: (x.v, -x.q - 0.1 * np.sign(x.v) - 0.5 * np.floor(x.q)),
                state=PLANE,
                modes=modes,
            )

        def facts(system):
            return facts_of(lambda point: {"t": simulate(system, (0.5, 0.0), (0.0, 1.0)).t[-1]})

        plain, again = (facts(growing(None)) for _ in range(2))
        assert plain == again
        assert facts(growing({"forward": lambda t, x, p: x.v > 0})) != plain


@pytest.mark.parametrize(
    ("modes", "text"),
    [
        ({"low": lambda t, x, p: x.q < 0.5}, r"modes\['low'\] compares what is no switch of the equations"),
        (
            {"low": lambda t, x, p: x.q},
            r"modes\['low'\] must return a comparison, such as x\.q < 1.*got x\[0\]",
        ),
        ({"low": lambda t, x, p: x.z < 0}, r"modes\['low'\]: State component 'z' does not exist"),
        ({"low": lambda t, x, p: x.q < 1 and x.q > -1}, r"modes\['low'\] cannot be traced: .*"),
        (
            {"low": "q<2"},
            r"modes\['low'\] holds in no mode\. Modes: 'q<-1', 'q>-1, q<1', 'q>1'|holds in no mode",
        ),
        ({"low": lambda t, x, p: (x.q < -1) & (x.q > 1)}, r"modes\['low'\] holds in no mode"),
        ({"low": 3.0}, r"modes\['low'\] must be a condition, a function of \(t, x, p\), or the sides"),
        ({"": "q<1"}, "modes: a name must be a non-empty text"),
        ([1], "modes must map names to conditions"),
    ],
)
def test_errors(modes, text):
    with pytest.raises(ModelError, match=text):
        names_of(between_stops, modes)
