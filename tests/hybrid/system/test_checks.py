import math
import re
import subprocess
import sys

import numpy as np
import pytest

from hybrid.errors import ModelError
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.graph import HybridSystem


def system(
    field=lambda t, x, p: (x.v, -p.g), *, guard=None, reset=None, jacobian=None, gradient=None, period=None
):
    return HybridSystem(
        state=("q", "v"),
        parameters={"g": 9.81},
        modes=[Mode("flight", field, jacobian=jacobian)],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(guard or (lambda t, x, p: x.q), gradient=gradient),
                None if reset is None else Reset(reset),
                name="bounce",
            )
        ],
        period=period,
    )


def fails(text, **functions):
    with pytest.raises(ModelError, match=re.escape(text)):
        system(**functions)


def test_arity():
    fails("Mode 'flight': field must take (t, x, p); got a function of (x, p)", field=lambda x, p: x)
    fails("Transition 'bounce': guard must take (t, x, p)", guard=lambda x: x)
    fails("Transition 'bounce': reset must take (t, x, p)", reset=lambda x: x)
    fails("HybridSystem: period must take (p)", period=lambda: 1.0)


def test_unknown_names():
    fails(
        "Mode 'flight': field: State component 'w' does not exist. State components: q, v.",
        field=lambda t, x, p: (x.w, 0.0),
    )
    fails("Transition 'bounce': guard: Parameter 'gg' does not exist", guard=lambda t, x, p: p.gg)
    fails("Did you mean 'g'?", period=lambda p: p.gg)


def test_number_of_values():
    fails(
        "Mode 'flight': field returned 3 values; the state has 2 (q, v). "
        "Return one time derivative per state.",
        field=lambda t, x, p: (1.0, 2.0, 3.0),
    )
    fails("Transition 'bounce': reset returned 1 values; the state has 2", reset=lambda t, x, p: (1.0,))
    fails(
        "Mode 'flight': field must return a tuple or an array of one value per state",
        field=lambda t, x, p: x.q,
    )
    for kind in (
        set,
        iter,
        dict.fromkeys,
        lambda pair: map(float, pair),
        lambda pair: (each for each in pair),
    ):
        fails("field must return a tuple or an array", field=lambda t, x, p, kind=kind: kind((x.v, -x.q)))


def test_kind_of_values():
    fails("Transition 'bounce': guard must return one number", guard=lambda t, x, p: (x.q, x.v))
    fails("Transition 'bounce': guard must return one number", guard=lambda t, x, p: x.q > 0)
    fails("Mode 'flight': field: value 1 is not a number: None", field=lambda t, x, p: (x.q, None))
    fails("HybridSystem: period must return a number", period=lambda p: "long")


@pytest.mark.parametrize(
    ("value", "is_number"),
    [
        (2.5, True),
        (2, True),
        (True, True),
        (np.float64(2.5), True),
        (np.int64(2), True),
        (np.uint8(2), True),
        (np.bool_(True), True),
        (np.array(2.5), True),
        (np.array(2), True),
        (np.array(2, dtype=np.uint8), True),
        (np.array(True), True),
        (np.array([2.5]), False),
        (np.array("a"), False),
        (np.array(2.5j), False),
        (np.array(None), False),
        (2.5j, False),
        ("2.5", False),
        ([2.5], False),
    ],
)
def test_what_counts_as_a_number(value, is_number):
    field = lambda t, x, p: (x.v, value)  # noqa: E731
    if is_number:
        system(field)
    else:
        fails("Mode 'flight': field: value 1 is not a number", field=field)


def test_shape_of_derivatives():
    fails("Mode 'flight': jacobian returned 1 rows of 2 values", jacobian=lambda t, x, p: ((0.0, 1.0),))
    fails("it must return 2 rows of 2 or 3 values", jacobian=lambda t, x, p: ((0.0,), (1.0,)))
    fails("Transition 'bounce': gradient returned 1 values", gradient=lambda t, x, p: (1.0,))
    fails("gradient returned 4 values", gradient=lambda t, x, p: (1.0, 0.0, 0.0, 0.0))
    assert system(gradient=lambda t, x, p: (1.0, 0.0, 0.0)).transitions[0].guard.gradient is not None


def test_an_error_of_the_function_itself_is_told_and_chained():
    with pytest.raises(ModelError, match=r"field fails when called with \(t, x, p\): TypeError") as caught:
        system(lambda t, x, p: (x.q + [None, "a"][0], 0.0))
    assert isinstance(caught.value.__cause__, TypeError)


@pytest.mark.parametrize(
    "field",
    [
        lambda t, x, p: (math.log(-x.q), 0.0),
        lambda t, x, p: (1.0 / (x.q - x.q), np.sqrt(-x.v)),
        lambda t, x, p: (math.exp(1e6), 0.0),
        lambda t, x, p: (1e200 * x.q * 1e200, 0.0),
    ],
)
@pytest.mark.filterwarnings("error")
def test_arithmetic_trouble_at_the_sample_point_is_no_error(field):
    system(field)


def test_a_wrong_derivative_is_found_when_the_system_is_made():
    fails(
        "Mode 'flight': jacobian: entry D_v of q is 2 at", jacobian=lambda t, x, p: ((0.0, 2.0), (0.0, 0.0))
    )


def test_making_a_system_does_not_import_numba():
    code = (
        "import sys; from hybrid.system.graph import HybridSystem, Mode\n"
        "HybridSystem(state=1, modes=[Mode('a', lambda t, x, p: -x)])\n"
        "assert 'numba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_value_error_is_told_as_it_is():
    def field(t, x, p):
        raise ValueError("no such spring")

    fails("Mode 'flight': field fails when called with (t, x, p): ValueError: no such spring", field=field)


def test_writing_into_the_state_is_told():
    def field(t, x, p):
        x[0] = 1.0
        return (x[1], 0.0)

    with pytest.raises(ModelError, match="field writes into its argument, which is the state of the run"):
        HybridSystem(state=2, modes=[Mode("flight", field)])


def test_a_masked_number_is_none():
    """It is nan for NumPy, and was zero in the compiled functions."""
    fails("Mode 'flight': field: value 1 is not a number: masked", field=lambda t, x, p: (x.v, np.ma.masked))
