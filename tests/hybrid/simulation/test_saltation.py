"""Saltation matrices: closed forms, finite differences of the flow, and invariances."""

import attrs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hybrid
import models
from hybrid import Guard, HybridSystem, Mode, Reset, Transition, saltation_matrix, simulate
from models import bouncing_ball, impact_oscillator
from tests.cases import systems
from tests.hybrid.systems import shaken_table
from tests.reference.load import reference

TIGHT = hybrid.DOP853(rtol=1e-13, atol=1e-14)
STEP = 1e-5


def forced():
    """Two forced nonlinear modes, a moving curved guard, a reset that depends on time and state."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"w": 1.7},
        modes=[
            Mode("before", lambda t, x, p: (x.v + 0.2 * np.sin(x.q), np.cos(p.w * t) - x.q**3)),
            Mode("after", lambda t, x, p: (-0.5 * x.q + t * x.v, np.sin(x.q + t) - x.v)),
        ],
        transitions=[
            Transition(
                "before",
                "after",
                Guard(lambda t, x, p: x.q**2 + 0.3 * x.v - 0.5 - 0.1 * t**2, +1),
                Reset(lambda t, x, p: (x.q * np.cos(t) + 0.1 * x.v**2, x.v + np.exp(-x.q) * t)),
                name="cross",
            )
        ],
    )


TABLE, FORCED, BALL, OSCILLATOR = shaken_table(), forced(), bouncing_ball(), impact_oscillator()


def differenced(system, x0, t0, t1, mode, parameters=None):
    """Central differences of the flow from ``t0`` to ``t1``, and the tangent map that it should equal."""

    def end(x):
        arc = simulate(system, x, (t0, t1), mode=mode, parameters=parameters, solver=TIGHT)
        assert len(arc.jumps) == 1
        return arc.x[-1]

    x0 = np.array(x0)
    columns = [(end(x0 + h) - end(x0 - h)) / (2 * STEP) for h in STEP * np.eye(len(x0))]
    arc = simulate(system, x0, (t0, t1), mode=mode, parameters=parameters, solver=TIGHT, tangent=True)
    return np.column_stack(columns), arc.fundamental


class TestClosedForms:
    @given(st.floats(-20.0, -0.1), st.floats(0.0, 1.0), st.floats(0.5, 20.0))
    def test_ball(self, v, e, g):
        found = saltation_matrix(BALL, "bounce", 0.0, (0.0, v), parameters={"e": e, "g": g})
        np.testing.assert_allclose(found, [[-e, 0.0], [g * (1 + e) / abs(v), -e]], rtol=1e-13, atol=1e-13)

    @given(st.floats(0.1, 5.0), st.floats(-3.0, 3.0))
    def test_impact_oscillator(self, V, t):
        k, A, d, r, w = 1.0, 1.0, 1.0, 0.8, 1.0
        s = (1 + r) * (A * np.cos(w * t) - k * d) / V
        found = saltation_matrix(OSCILLATOR, "impact", t, (d, V))
        np.testing.assert_allclose(found, [[-r, 0.0], [s, -r]], rtol=1e-10, atol=1e-10)

    @given(st.floats(0.0, 3.0), st.floats(-8.0, -1.0))
    def test_moving_table(self, t, v):
        """The matrix is that of fixed ground with speed and acceleration relative to the table."""
        e, a, w, g = 0.7, 0.1, 5.0, 9.81
        relative = v - a * w * np.cos(w * t)
        pull = g - a * w**2 * np.sin(w * t)
        found = saltation_matrix(TABLE, "hit", t, (a * np.sin(w * t), v))
        # The reset keeps the position, so the first row comes from the guard alone.
        expected = [[-e, 0.0], [(1 + e) * pull / -relative, -e]]
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)

    @pytest.mark.parametrize("transition", ["bounce", BALL.transitions[0]])
    def test_by_name_and_by_object(self, transition):
        found = saltation_matrix(BALL, transition, 0.0, (0.0, -4.0))
        np.testing.assert_allclose(found, [[-0.8, 0.0], [9.81 * 1.8 / 4, -0.8]])

    def test_references(self):
        expected = reference("saltation")
        found = saltation_matrix(systems.constant_fields(), "left->right", 0.0, (0.0, 0.0))
        np.testing.assert_allclose(found, expected["constant_fields"], atol=1e-15)


class TestFiniteDifferences:
    def test_moving_table(self):
        expected, found = differenced(TABLE, (0.5, -1.0), 0.2, 0.6, "flight")
        np.testing.assert_allclose(found, expected, atol=1e-7)

    @pytest.mark.parametrize("t0", [0.0, 0.4])
    @pytest.mark.parametrize("w", [1.7, 6.0])
    def test_forced_fields_moving_guard_reset_in_time(self, t0, w):
        expected, found = differenced(FORCED, (0.3, 0.6), t0, t0 + 1.2, "before", {"w": w})
        np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())

    def test_impact_oscillator(self):
        expected, found = differenced(OSCILLATOR, (0.0, 1.2), 0.3, 2.5, "flight")
        np.testing.assert_allclose(found, expected, atol=1e-7)

    def test_incline(self):
        system = systems.incline()
        expected, found = differenced(system, (0.1, 0.5, 0.3, -0.2), 0.0, 0.7, "fall")
        np.testing.assert_allclose(found, expected, atol=1e-7)

    def test_the_jump_of_a_run_holds_the_same_matrix(self):
        arc = simulate(FORCED, (0.3, 0.6), (0.0, 1.2), mode="before", solver=TIGHT)
        (jump,) = arc.jumps
        found = saltation_matrix(FORCED, jump.transition, jump.t, jump.x_minus)
        np.testing.assert_allclose(found, jump.saltation, rtol=1e-12, atol=1e-12)


class TestIdentities:
    @pytest.mark.parametrize(
        ("system", "transition", "x"),
        [
            (BALL, "bounce", (0.0, -3.0)),
            (models.rimless_wheel(), "step", (0.08 + np.pi / 8, 1.4)),
            (systems.constant_fields(), "left->right", (0.0, 0.3)),
            (systems.switched_linear(), "first->second", (1.0, 2.75)),
            (systems.incline(), "landing", (0.0, 0.0, 1.0, -2.0)),
        ],
        ids=["ball", "wheel", "constant", "switched", "incline"],
    )
    def test_the_flow_before_goes_into_the_flow_after(self, system, transition, x):
        """``f_plus = Xi f_minus`` for an autonomous system."""
        (index,) = (i for i, tr in enumerate(system.transitions) if tr.name == transition)
        tr = system.transitions[index]
        matrix = saltation_matrix(system, transition, 0.0, x)

        p = system.variables.parameter_view(system.parameter_values())
        x_minus = system.variables.state_view(x)
        x_plus = (
            x_minus if tr.reset is None else system.variables.state_view(tr.reset.function(0.0, x_minus, p))
        )
        f_minus = system.modes[system.mode_index(tr.source)].field(0.0, x_minus, p)
        f_plus = system.modes[system.mode_index(tr.target)].field(0.0, x_plus, p)
        np.testing.assert_allclose(matrix @ f_minus, f_plus, rtol=1e-12, atol=1e-12)

    @settings(max_examples=20)
    @given(st.floats(-1.0, 1.0))
    def test_identity_where_field_and_state_are_continuous(self, a):
        found = saltation_matrix(systems.jerk(), "left->right", 0.0, (0.0, 0.7, a))
        np.testing.assert_array_equal(found, np.eye(3))

    def test_extension_of_the_reset_off_the_guard_does_not_matter(self):
        matrices = []
        for reset in (
            lambda t, x, p: (0.0, -p.e * x.v),
            lambda t, x, p: (x.q, -p.e * x.v),
            lambda t, x, p: (-5.0 * x.q, -p.e * x.v + 7 * x.q * x.v),
            lambda t, x, p: (np.sin(x.q), -p.e * x.v * np.exp(3 * x.q) + t * x.q),
        ):
            (bounce,) = BALL.transitions
            system = attrs.evolve(BALL, transitions=[attrs.evolve(bounce, reset=Reset(reset))])
            matrices.append(saltation_matrix(system, "bounce", 0.3, (0.0, -2.0)))
        for matrix in matrices[1:]:
            np.testing.assert_allclose(matrix, matrices[0], rtol=1e-13, atol=1e-13)

    @pytest.mark.parametrize("factor", [-3.0, 1e-9, 1e12])
    def test_scale_of_the_guard_does_not_matter(self, factor):
        (bounce,) = BALL.transitions
        guard = Guard(lambda t, x, p: factor * x.q)
        system = attrs.evolve(BALL, transitions=[attrs.evolve(bounce, guard=guard)])
        np.testing.assert_allclose(
            saltation_matrix(system, "bounce", 0.0, (0.0, -2.0)),
            saltation_matrix(BALL, "bounce", 0.0, (0.0, -2.0)),
            rtol=1e-13,
        )


class TestErrors:
    def test_a_graze_has_no_matrix(self):
        text = (
            r"Transition 'bounce': the saltation matrix does not exist at t = 0.5, x = \(0.0, 0.0\); "
            "the transversality is"
        )
        with pytest.raises(hybrid.ArgumentError, match=text):
            saltation_matrix(BALL, "bounce", 0.5, (0.0, 0.0))

    def test_a_graze_of_a_continuous_field_has(self):
        found = saltation_matrix(systems.jerk(), "left->right", 0.0, (0.0, 0.0, 1.0))
        np.testing.assert_array_equal(found, np.eye(3))

    def test_unknown_transition(self):
        text = "Transition 'bonce' does not exist. Transitions: bounce. Did you mean 'bounce'?"
        with pytest.raises(hybrid.ModelError, match=text):
            saltation_matrix(BALL, "bonce", 0.0, (0.0, -1.0))

    @pytest.mark.parametrize(
        ("t", "x", "text"),
        [
            (0.0, (0.0,), r"^x has shape \(1,\); the state needs shape \(2,\)"),
            (np.nan, (0.0, -1.0), "t must be finite; got nan"),
            ("now", (0.0, -1.0), "t must be a number; got 'now'"),
            (0.0, (0.0, np.inf), "component 'v' must be finite"),
        ],
    )
    def test_arguments(self, t, x, text):
        with pytest.raises(hybrid.ArgumentError, match=text):
            saltation_matrix(BALL, "bounce", t, x)


class TestOfARun:
    """Matrices of a run without tangent vectors, compared with those of a run with tangent vectors."""

    @pytest.mark.parametrize(
        ("name", "x0", "mode", "t_end"),
        [
            ("bouncing_ball", (1.0, 0.0), "flight", 2.0),
            # The jumps accumulate, and the limit has its own matrix.
            ("bouncing_table", (0.1, 0.0), "flight", 3.0),
            ("stop_oscillator", (0.0, 0.0), "free", 40.0),
            ("rocking_block", (0.0, np.cos(0.15), 0.1, 0.0, 0.0, 0.0), None, 3.0),
            ("stick_slip", (0.5, 0.2), "sliding", 60.0),
        ],
    )
    def test_with_and_without_tangent_vectors(self, name, x0, mode, t_end):
        system = getattr(models, name)()
        plain = simulate(system, x0, (0.0, t_end), mode=mode)
        carrying = simulate(system, x0, (0.0, t_end), mode=mode, tangent=True)
        assert len(plain.jumps) > 2
        np.testing.assert_array_equal(plain.jumps.kind, carrying.jumps.kind)
        np.testing.assert_allclose(plain.jumps.t, carrying.jumps.t, rtol=1e-9)
        np.testing.assert_allclose(plain.jumps.saltation, carrying.jumps.saltation, rtol=1e-6, atol=1e-6)

    def test_of_more_jumps_than_a_record_holds(self):
        """Each matrix belongs to its own transition, time and state."""
        system = models.impact_oscillator()
        jumps = simulate(system, (0.0, 0.0), (0.0, 10000.0)).jumps
        assert len(jumps) > 1100
        for jump in jumps[::301]:
            expected = saltation_matrix(system, jump.transition, jump.t, jump.x_minus)
            np.testing.assert_allclose(jump.saltation, expected, rtol=1e-9)
