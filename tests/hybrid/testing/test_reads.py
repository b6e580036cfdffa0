"""Parameters that nothing reads, and numbers that stand in for one, are found without a run."""

import numpy as np
import pytest
from hypothesis.errors import UnsatisfiedAssumption

import models
from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition
from hybrid.expression.reads import names_read
from hybrid.testing import PropertyError, check_reads, check_system
from hybrid.testing.reads import is_passed

MU = 0.3
G = 9.81


def block(rate=lambda t, x, p: -x.q - p.mu * np.sign(x.v), **options):
    return HybridSystem(
        state=("q", "v"),
        parameters={"mu": 0.3},
        modes=[Mode("slide", lambda t, x, p: (x.v, rate(t, x, p)))],
        **options,
    )


def test_what_a_function_reads():
    system = block()
    assert names_read(system, lambda t, x, p: np.where(x.q > 0, np.cos(t), p.mu)) == {"q", "t", "mu"}
    assert names_read(system, lambda t, x, p: 2.0) == set()


def test_a_number_where_a_parameter_belongs():
    with pytest.raises(
        PropertyError, match=r"no function reads parameter 'mu'\n  likely: .* where p.mu belongs"
    ):
        check_reads(block(lambda t, x, p: -x.q - 0.3 * np.sign(x.v)))


def test_a_number_of_the_module_under_the_name_of_a_parameter():
    faulty = block(lambda t, x, p: -x.q - MU * np.sign(x.v) + 0.0 * p.mu)
    with pytest.raises(PropertyError, match=r"MU = 0.3 is read from outside the model, and parameter 'mu'"):
        check_system(faulty, examples=2)


def test_a_number_from_a_closure_under_the_name_of_a_parameter():
    def model(mu):
        return block(lambda t, x, p: -x.q - mu * np.sign(x.v) + 0.0 * p.mu)

    with pytest.raises(PropertyError, match=r"mu = 0.5 is read from outside"):
        check_reads(model(0.5))


def test_a_number_with_another_value_is_another_quantity():
    """The gas constant R and the radius r."""
    R = 8.3

    check_reads(block(lambda t, x, p: -R * x.q - p.mu * x.v))
    ring = HybridSystem(
        state=("q",), parameters={"r": 0.2}, modes=[Mode("m", lambda t, x, p: (-R * p.r * x.q,))]
    )
    check_reads(ring)


def test_other_numbers_of_the_module_are_told():
    report = check_system(block(lambda t, x, p: -G * x.q - p.mu * x.v), examples=2, t_span=(0.0, 1.0))
    assert report.numbers == {"G": 9.81}
    assert "Read from outside the model, and never varied: G = 9.81" in str(report)


@pytest.mark.parametrize(
    "system",
    [
        block(lambda t, x, p: -x.q, period=lambda p: 2 * np.pi * p.mu),
        block(
            lambda t, x, p: -x.q, laws=Laws(conserved={"energy": lambda t, x, p: p.mu * (x.q**2 + x.v**2)})
        ),
        block(
            lambda t, x, p: -x.q,
            transitions=[
                Transition(
                    "slide", "slide", Guard(lambda t, x, p: x.q), Reset(lambda t, x, p: {"v": p.mu * x.v})
                )
            ],
        ),
    ],
)
def test_a_parameter_may_be_read_anywhere(system):
    check_reads(system)


def test_what_cannot_be_traced_may_read_everything():
    def rate(t, x, p):
        return -x.q if x.v > 0 else 0.0

    with pytest.raises(UnsatisfiedAssumption, match="cannot be traced"):
        check_reads(block(rate))


@pytest.mark.parametrize(
    "name", ["bouncing_table", "buck_converter", "chua_circuit", "stick_slip", "vibroimpact"]
)
def test_right_models_read_all_their_parameters(name):
    check_reads(getattr(models, name)())


def test_guards_that_the_state_passes():
    """A clock, and a counter of turns; not a wall, nor one whose reset is forgotten."""

    def back(name, guard, reset=lambda t, x, p: {"v": -x.v}):
        return Transition("slide", "slide", Guard(guard, -1), Reset(reset), name=name)

    def angle(t, x, p):
        return x.q

    system = HybridSystem(
        state=("q", "v", "n"),
        modes=[Mode("slide", lambda t, x, p: (x.v, -x.q, 0.0))],
        transitions=[
            back("wall", angle),
            back("forgotten", angle, lambda t, x, p: x),
            back("tick", lambda t, x, p: np.sin(t)),
            back("count", angle, lambda t, x, p: {"n": x.n + 1.0}),
        ],
    )
    assert [is_passed(system, name) for name in system.transition_names] == [False, False, True, True]
