"""Laws over outputs, and the property that outputs are what their functions say."""

import attrs
import numpy as np
import pytest

import hybrid.simulation.quantities
import hybrid.testing.outputs
import models
from hybrid import ArgumentError, Guard, HybridSystem, Laws, Mode, Transition, periodic_orbit
from hybrid.testing import Case, PropertyError, check_dimensions, check_outputs, check_reads, check_system

RANGES = {"q": (0.0, 0.3), "v": (-1.0, 1.0)}
UNITS = {"q": "m", "v": "m/s", "t": "s", "m": "kg", "g": "m/s^2", "k": "N/m", "c": "N s/m", "force": "N"}


def force(t, x, p):
    return -p.k * x.q - p.c * x.v


def energy(t, x, p):
    return p.m * (x.v**2 / 2 + p.g * x.q) + p.k * np.minimum(x.q, 0.0) ** 2 / 2


def soft_ball(**options):
    outputs = {
        "force": {"contact": force},
        "energy": energy,
        "power": {"contact": lambda t, x, p: -p.c * x.v**2},
    }
    return HybridSystem(
        **{
            "state": ("q", "v"),
            "parameters": {"m": 2.0, "g": 9.81, "k": 2e4, "c": 30.0},
            "modes": [
                Mode("flight", lambda t, x, p: (x.v, -p.g)),
                Mode("contact", lambda t, x, p: (x.v, -p.g + force(t, x, p) / p.m)),
            ],
            "transitions": [
                Transition("flight", "contact", Guard(lambda t, x, p: x.q, -1), name="touch"),
                Transition("contact", "flight", Guard(lambda t, x, p: x.q, +1), name="leave"),
            ],
            "start": "flight",
            "outputs": outputs,
            **options,
        }
    )


def check(system=None, **options):
    return check_system(system or soft_ball(), states=RANGES, examples=5, **options)


def example(system):
    return Case(system, dict(system.parameters), "flight", (0.2, 0.0), 0.0, 0.5)


class TestLaws:
    def test_a_list_of_names(self):
        assert not check(laws=Laws(dissipated=["energy"])).never_seen

    def test_in_one_mode(self):
        assert not check(laws=Laws(conserved={"flight": {"sum": "energy"}})).never_seen

    def test_pairs(self):
        balance = {"contact": {"sum": ("energy", "power")}}
        assert not check(laws=Laws(balance=balance)).never_seen

    def test_a_component_is_named_too(self):
        assert not check(laws=Laws(invariant={"flight": {"above the ground": "q"}})).never_seen

    def test_those_that_a_system_carries(self):
        assert not check(soft_ball(laws=Laws(dissipated=["energy"]))).never_seen

    def test_a_law_holds_where_the_output_has_a_value(self):
        """The contact pulls before it lets go; in the flight there is no force to be judged."""
        with pytest.raises(
            PropertyError, match=r"'force' is non-negative: this does not hold[\s\S]*'contact'"
        ):
            check(laws=Laws(invariant=["force"]))

    def test_a_force_with_the_wrong_sign_is_found(self):
        wrong = soft_ball(outputs={"energy": lambda t, x, p: p.m * (x.v**2 / 2 - p.g * x.q)})
        with pytest.raises(PropertyError, match="'energy' is conserved in mode 'flight'"):
            check(wrong, laws=Laws(conserved={"flight": {"energy": "energy"}}))

    def test_the_quantity_of_a_case(self):
        system = soft_ball(laws=Laws(invariant=["force"], dissipated=["energy"]))
        case = attrs.evolve(example(system), laws=hybrid.system.graph.laws_of(system))
        assert case.law("energy", 0.0, (0.2, 0.0)) == pytest.approx(2.0 * 9.81 * 0.2)
        assert case.law("force", 0.0, (-0.01, 0.0), "contact") == pytest.approx(200.0)
        assert np.isnan(case.law("force", 0.0, (0.2, 0.0)))

    @pytest.mark.parametrize(
        ("laws", "text"),
        [
            (
                {"invariant": ["forse"]},
                "invariant: 'forse': Output or state component 'forse' does not exist",
            ),
            ({"balance": {"energy": ("energy", "powr")}}, "balance: 'energy', its rate: Output or state"),
            ({"balance": {"energy": "energy"}}, "balance: 'energy' must be a pair"),
            ({"conserved": [3.0]}, "conserved: a name must be a str; got 3.0"),
            ({"across": {"touch": "energy"}}, r"across: 'touch' must be a function of \(t, minus, plus, p\)"),
        ],
    )
    def test_errors(self, laws, text):
        with pytest.raises(ArgumentError, match=text):
            check(laws=Laws(**laws))

    def test_an_orbit_holds_a_conserved_output(self):
        pendulum = HybridSystem(
            state=("q", "v"),
            modes=[Mode("swing", lambda t, x, p: (x.v, -np.sin(x.q)))],
            outputs={"energy": lambda t, x, p: x.v**2 / 2 - np.cos(x.q)},
            laws=Laws(conserved=["energy"]),
        )
        orbit = periodic_orbit(pendulum, (1.0, 0.0), period=6.7)
        assert orbit.status.ok
        assert orbit.arc()["energy"] == pytest.approx(-np.cos(1.0), rel=1e-9)


class TestTheProperty:
    def test_it_is_checked(self):
        held = {each.name: each.examples for each in check().properties}
        assert held[hybrid.testing.outputs.OUTPUTS] > 0

    def test_a_system_without_outputs_does_not_have_it(self):
        plain = soft_ball(outputs={})
        assert hybrid.testing.outputs.OUTPUTS not in {each.name for each in check(plain).properties}

    def test_wrong_values_are_found(self, monkeypatch):
        right = hybrid.simulation.quantities.values_of
        monkeypatch.setattr(hybrid.testing.outputs, "values_of", lambda *args: 1.001 * right(*args))
        with pytest.raises(
            PropertyError, match=r"Output 'force' in mode 'contact' is .* in results and .* by its function"
        ):
            check_outputs(example(soft_ball()))

    @pytest.mark.parametrize(("column", "name"), [(1, "v"), (2, "m")])
    def test_wrong_derivatives_are_found(self, monkeypatch, column, name):
        right = hybrid.simulation.quantities.slopes_of
        factor = np.where(np.arange(6) == column, 1.001, 1.0)
        monkeypatch.setattr(hybrid.testing.outputs, "slopes_of", lambda *args: factor * right(*args))
        with pytest.raises(PropertyError, match=rf"the derivative of Output '(force|energy)'.* in {name} is"):
            check_outputs(example(soft_ball()))

    def test_an_output_without_derivative_has_its_values_checked(self):
        check_outputs(example(soft_ball(outputs={"plain": lambda t, x, p: float(x.q)})))


def test_a_parameter_that_an_output_alone_reads_is_read():
    ball = attrs.evolve(
        models.bouncing_ball(),
        parameters={"g": 9.81, "e": 0.8, "m": 3.0},
        outputs={"momentum": lambda t, x, p: p.m * x.v},
        units={},
        laws=Laws(),
    )
    check_reads(ball)
    with pytest.raises(PropertyError, match="no function reads parameter 'm'"):
        check_reads(attrs.evolve(ball, outputs={}))


def test_units_of_outputs():
    check_dimensions(soft_ball(units=UNITS))
    with pytest.raises(PropertyError, match="output 'force' in mode 'contact': the value is in N"):
        check_dimensions(soft_ball(units={**UNITS, "force": "J"}))
