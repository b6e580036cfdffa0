"""Outputs and components by name, of arcs and their jumps: values and derivatives."""

import attrs
import numpy as np
import pytest

import hybrid
import models
from hybrid import ArgumentError, Every, Guard, HybridSystem, Mode, Reset, Table, Transition, simulate

TIMES = np.linspace(0.0, 1.0, 41)


def force(t, x, p):
    return -p.k * x.q - p.c * x.v


def energy(t, x, p):
    return p.m * (x.v**2 / 2 + p.g * x.q) + p.k * np.minimum(x.q, 0.0) ** 2 / 2


def soft_ball(**outputs):
    return HybridSystem(
        state=("q", "v"),
        parameters={"m": 2.0, "g": 9.81, "k": 2e4, "c": 30.0},
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -p.g)),
            Mode("contact", lambda t, x, p: (x.v, -p.g + force(t, x, p) / p.m)),
        ],
        transitions=[
            Transition("flight", "contact", Guard(lambda t, x, p: x.q, -1), name="touch"),
            Transition("contact", "flight", Guard(lambda t, x, p: x.q, +1), name="leave"),
        ],
        start="flight",
        outputs={"force": {"contact": force}, "energy": energy, **outputs},
    )


def run(system, span=(0.0, 1.0), **options):
    return simulate(system, (0.2, 0.0), span, **options)


@pytest.fixture(scope="module")
def arc():
    return run(soft_ball())


def by_hand(x):
    """The energy of states."""
    return 2.0 * (x[:, 1] ** 2 / 2 + 9.81 * x[:, 0]) + 2e4 * np.minimum(x[:, 0], 0.0) ** 2 / 2


class TestValues:
    def test_an_output_of_every_mode(self, arc):
        np.testing.assert_allclose(arc["energy"], by_hand(arc.x), rtol=1e-13)

    def test_an_output_of_one_mode_is_nan_in_the_other(self, arc):
        touches = arc.mode == "contact"
        assert 0 < touches.sum() < len(touches)
        assert np.all(np.isnan(arc["force"][~touches]))
        x = arc.x[touches]
        np.testing.assert_allclose(arc["force"][touches], -2e4 * x[:, 0] - 30.0 * x[:, 1], rtol=1e-13)

    def test_the_dense_output(self, arc):
        np.testing.assert_allclose(arc(TIMES, "energy"), by_hand(arc(TIMES)), rtol=1e-13)
        np.testing.assert_array_equal(arc(TIMES, "v"), arc(TIMES)[:, 1])
        assert arc(0.5, "energy").shape == ()
        assert arc([[0.5], [0.6]], "energy").shape == (2, 1)

    def test_at_a_jump_the_dense_output_is_that_after_it(self, arc):
        touch, leave = arc.jumps[0], arc.jumps[1]
        assert arc(touch.t, "force") == pytest.approx(-30.0 * touch.x_plus[1])
        assert np.isnan(arc(leave.t, "force"))

    def test_samples(self):
        sampled = run(soft_ball(), samples=TIMES)
        np.testing.assert_allclose(sampled["energy"], by_hand(sampled.x), rtol=1e-13)

    def test_the_dense_output_of_a_run_without_length(self):
        assert run(soft_ball(), (0.0, 0.0))(0.0, "energy") == pytest.approx(2.0 * 9.81 * 0.2)

    def test_both_sides_of_jumps(self, arc):
        jumps, touch = arc.jumps, arc.jumps.transition == "touch"
        assert np.all(np.isnan(jumps.before("force")[touch]))
        np.testing.assert_allclose(jumps.after("force")[touch], -30.0 * jumps.x_plus[touch, 1], atol=1e-12)
        np.testing.assert_array_equal(jumps.before("v"), jumps.x_minus[:, 1])

    def test_after_the_jump_that_ends_a_run_the_mode_is_the_last_one(self):
        ends = HybridSystem(
            state=("q",),
            modes=[Mode("on", lambda t, x, p: (1.0,))],
            transitions=[Transition("on", None, Guard(lambda t, x, p: x.q - 1.0, +1))],
            outputs={"twice": {"on": lambda t, x, p: 2.0 * x.q}},
        )
        jumps = simulate(ends, (0.0,), (0.0, 5.0)).jumps
        assert jumps.after("twice") == pytest.approx([2.0])

    def test_of_the_time_and_of_a_table(self):
        curve = Table([0.0, 0.5, 1.0], [0.0, 2.0, 0.0])
        arc = run(soft_ball(drive=lambda t, x, p: p.m * curve(t) + np.sin(t)))
        np.testing.assert_allclose(
            arc["drive"], 2.0 * np.interp(arc.t, [0.0, 0.5, 1.0], [0.0, 2.0, 0.0]) + np.sin(arc.t), atol=1e-13
        )

    def test_of_parameters_that_a_run_changes(self):
        arc = run(soft_ball(), parameters={"m": 3.0, "c": 0.0})
        assert arc["energy"][0] == pytest.approx(3.0 * 9.81 * 0.2)
        assert arc["energy"][-1] == pytest.approx(arc["energy"][0], rel=1e-8)

    def test_of_held_components_and_counters(self):
        loop = HybridSystem(
            state=("x",),
            held=("u",),
            counters=("n",),
            modes=[Mode("run", lambda t, x, p: (x.u,))],
            transitions=[
                Transition("run", "run", Every(0.25), Reset(lambda t, x, p: {"u": -x.x, "n": x.n + 1}))
            ],
            outputs={"sum": lambda t, x, p: x.x + 10.0 * x.u + 100.0 * x.n},
        )
        arc = simulate(loop, {"x": 1.0}, (0.0, 1.0))
        np.testing.assert_allclose(arc["sum"], arc.x @ [1.0, 10.0, 100.0], rtol=1e-13)

    def test_of_a_state_without_names(self):
        system = HybridSystem(
            state=2, modes=[Mode("turn", lambda t, x, p: (x[1], -x[0]))], outputs={"r": lambda t, x, p: x @ x}
        )
        np.testing.assert_allclose(simulate(system, (1.0, 0.0), (0.0, 3.0))["r"], 1.0, rtol=1e-8)

    def test_a_constant(self, arc):
        assert np.all(run(soft_ball(one=lambda t, x, p: 1))["one"] == 1.0)

    def test_a_comparison_is_one_or_zero(self):
        arc = run(soft_ball(low=lambda t, x, p: x.q < 0.1))
        np.testing.assert_array_equal(arc["low"], arc["q"] < 0.1)

    def test_a_function_that_cannot_be_traced_is_called_point_by_point(self):
        def branched(t, x, p):
            return p.k * x.q if x.q > 0.0 else -x.v

        arc = run(soft_ball(branched=branched))
        expected = np.where(arc["q"] > 0.0, 2e4 * arc["q"], -arc["v"])
        np.testing.assert_allclose(arc["branched"], expected, rtol=1e-13)

    def test_where_a_function_is_not_real_it_is_nan_or_infinite(self):
        arc = run(soft_ball(root=lambda t, x, p: np.sqrt(x.v), inverse=lambda t, x, p: 1.0 / x.v))
        assert np.all(np.isnan(arc["root"]) == (arc["v"] < 0.0))
        assert np.isinf(arc["inverse"][0])


def test_a_run_never_computes_an_output():
    calls = []

    def counted(t, x, p):
        calls.append(1)
        return x.q

    system = soft_ball(counted=counted)
    made = len(calls)
    arc = run(system, tangent=True, sensitivities=("k",))
    assert arc.jump_count > 0
    assert len(calls) == made
    assert arc["counted"][0] == pytest.approx(0.2, rel=1e-14)
    assert len(calls) > made


def test_a_run_with_outputs_is_the_run_without():
    plain = run(attrs.evolve(soft_ball(), outputs={}))
    np.testing.assert_array_equal(run(soft_ball()).x, plain.x)


class TestDerivatives:
    STEP = 1e-5

    def differences(self, name, change):
        ends = [change(sign * self.STEP)[name][-1] for sign in (1.0, -1.0)]
        return (ends[0] - ends[1]) / (2.0 * self.STEP)

    def test_in_parameters_and_in_the_start(self):
        system = soft_ball()
        arc = run(system, sensitivities=("m", "g", "c"), tangent=True)
        for i, name in enumerate(("m", "g", "c")):
            value = system.parameters[name]
            expected = self.differences(
                "energy", lambda h, name=name, value=value: run(system, parameters={name: value + h})
            )
            assert arc.sensitivity_of("energy")[i] == pytest.approx(expected, rel=1e-5)
        for i in range(2):
            expected = self.differences(
                "energy", lambda h, i=i: simulate(system, np.array([0.2, 0.0]) + h * np.eye(2)[i], (0.0, 1.0))
            )
            assert arc.fundamental_of("energy")[i] == pytest.approx(expected, rel=1e-5, abs=1e-6)

    def test_those_of_a_component_are_its_rows(self):
        arc = run(soft_ball(), sensitivities=("m", "g"), tangent=True)
        np.testing.assert_array_equal(arc.sensitivity_of("v"), arc.sensitivity[1])
        np.testing.assert_array_equal(arc.fundamental_of("v"), arc.fundamental[1])

    def test_at_samples(self):
        arc = run(soft_ball(), sensitivities=("m", "g"), samples=TIMES)
        x, v = arc.x.T
        slopes = np.column_stack([2.0 * 9.81 + 2e4 * np.minimum(x, 0.0), 2.0 * v])
        own = np.column_stack([v**2 / 2 + 9.81 * x, 2.0 * x])
        expected = np.einsum("ij,ijk->ik", slopes, arc.sampled_sensitivity) + own
        np.testing.assert_allclose(arc.sampled_sensitivity_of("energy"), expected, rtol=1e-9, atol=1e-9)
        expected = np.einsum("ij,ijk->ik", slopes, arc.sampled_fundamental)
        np.testing.assert_allclose(arc.sampled_fundamental_of("energy"), expected, rtol=1e-9, atol=1e-9)

    def test_along_a_tangent_vector(self):
        arc = run(soft_ball(), tangent=[[1.0], [0.0]])
        assert arc.fundamental_of("energy").shape == (1,)

    def test_where_the_output_has_no_value_it_has_no_derivative(self):
        arc = run(soft_ball(), sensitivities=("c",), tangent=True)
        assert arc.mode[-1] == "flight"
        assert np.isnan(arc.sensitivity_of("force")).all()
        assert np.isnan(arc.fundamental_of("force")).all()

    def test_by_the_complex_step_where_tracing_cannot_follow(self):
        def looked_up(t, x, p):
            return {0: p.m * x.q**2}[0 * hash(x.q)]

        arc = run(soft_ball(looked_up=looked_up), sensitivities=("m",))
        expected = 2.0 * 2.0 * arc["q"][-1] * arc.sensitivity[0, 0] + arc["q"][-1] ** 2
        assert arc.sensitivity_of("looked_up")[0] == pytest.approx(expected, rel=1e-12)

    def test_an_output_without_derivative_says_why(self):
        arc = run(soft_ball(plain=lambda t, x, p: float(x.q)), tangent=True)
        with pytest.raises(
            ArgumentError, match="Output 'plain' has no derivative: its function cannot be traced"
        ):
            arc.fundamental_of("plain")

    def test_a_run_without_derivatives_says_so(self, arc):
        with pytest.raises(ArgumentError, match=r"no tangent vectors\. Run simulate with tangent=True"):
            arc.fundamental_of("energy")
        with pytest.raises(ArgumentError, match="Run simulate with sensitivities="):
            arc.sensitivity_of("energy")


@pytest.mark.parametrize(
    "ask",
    [
        lambda arc: arc["forse"],
        lambda arc: arc(0.5, "forse"),
        lambda arc: arc.jumps.before("forse"),
        lambda arc: arc.jumps.after("forse"),
        lambda arc: arc.fundamental_of("forse"),
        lambda arc: hybrid.plot(arc, components=["forse"]),
        lambda arc: hybrid.plot.plot_phase(arc, "q", "forse"),
    ],
)
def test_an_unknown_name_lists_components_and_outputs(arc, ask):
    text = (
        "State component or output 'forse' does not exist. State components and outputs: q, v, force, energy"
    )
    with pytest.raises(ArgumentError, match=text):
        ask(arc)


class TestDatasets:
    def test_of_an_arc(self, arc):
        found = arc.to_xarray()
        assert found.outputs.dims == ("t", "output")
        np.testing.assert_array_equal(found.outputs.sel(output="force"), arc["force"])

    def test_of_jumps(self, arc):
        found = arc.jumps.to_xarray()
        np.testing.assert_array_equal(found.outputs_plus.sel(output="force"), arc.jumps.after("force"))

    def test_without_outputs_there_is_no_such_axis(self):
        found = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
        plain = attrs.evolve(
            found, system=attrs.evolve(found.system, outputs={}, units={}, laws=hybrid.Laws())
        )
        assert "output" not in plain.to_xarray().dims

    def test_a_saved_arc_has_them(self, arc, tmp_path):
        arc.to_xarray().to_netcdf(tmp_path / "arc.nc")
        saved = hybrid.open_store(tmp_path / "arc.nc")
        np.testing.assert_array_equal(saved.outputs.sel(output="energy"), arc["energy"])

    def test_a_notebook_shows_them(self, arc):
        assert "<th>energy</th>" in arc._repr_html_()


class TestPictures:
    def test_rows_of_outputs(self, arc):
        rows = hybrid.plot(arc, components=["q", "force", "energy"])
        assert [row.get_ylabel() for row in rows] == ["q", "force", "energy"]

    def test_an_arc_alone_shows_its_components(self, arc):
        assert len(hybrid.plot(arc)) == 2

    def test_the_curve_is_fine_enough_for_the_peak(self, arc):
        (row,) = hybrid.plot(arc, components=["force"])
        drawn = np.concatenate([line.get_ydata() for line in row.lines[:2]])
        peak = np.nanmax(arc(np.linspace(0.0, 1.0, 20001), "force"))
        assert np.nanmax(drawn) == pytest.approx(peak, rel=5e-3)
        assert np.nanmax(arc["force"]) < 0.5 * peak

    def test_a_plane_with_an_output(self, arc):
        ax = hybrid.plot.plot_phase(arc, "q", "energy")
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("q", "energy")
