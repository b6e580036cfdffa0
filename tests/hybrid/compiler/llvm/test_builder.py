"""Instructions as text, against what LLVM makes of them; nothing is kept of modules that are gone."""

import ctypes
import gc

import numpy as np
import pytest
from llvmlite import binding, ir

from hybrid import HybridSystem, Mode, simulate
from hybrid.compiler.llvm import functions
from hybrid.compiler.llvm.builder import Builder, Line


@pytest.fixture
def _nothing_older():
    """Searches among all objects find only those that the test makes."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


def types_alive():
    gc.collect()
    # A weak proxy among the objects would ask for the class of what is gone.
    return sum(issubclass(type(each), ir.Type) for each in gc.get_objects())


@pytest.mark.usefixtures("_nothing_older")
def test_types_of_dropped_modules_are_freed(monkeypatch):
    # Nothing comes from an earlier process.
    monkeypatch.setattr(functions, "kept_of_model", lambda *given: None)

    def run_with(rate):
        decay = HybridSystem(state=("q",), modes=[Mode("a", lambda t, x, p: (-rate * x.q**3,))])
        simulate(decay, (1.0,), (0.0, 0.1))

    run_with(0.7253)
    before = types_alive()
    run_with(0.7254)
    run_with(0.7255)
    assert types_alive() == before


NUMBER, WHOLE = ir.DoubleType(), ir.IntType(64)
ROW = NUMBER.as_pointer()


def function_of(*kinds):
    """An empty function of a new module, and the builder of its only block."""
    module = ir.Module()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), "run")
    return module, function, Builder(function.append_basic_block("entry"))


def run(module, *arguments):
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    parsed = binding.parse_assembly(str(module))
    parsed.verify()
    machine = binding.Target.from_default_triple().create_target_machine()
    with binding.create_mcjit_compiler(parsed, machine) as engine:
        engine.finalize_object()
        kinds = [ctypes.c_void_p if isinstance(each, np.ndarray) else ctypes.c_int64 for each in arguments]
        call = ctypes.CFUNCTYPE(None, *kinds)(engine.get_function_address("run"))
        call(*(each.ctypes.data if isinstance(each, np.ndarray) else each for each in arguments))


@pytest.mark.parametrize("whole", [False, True])
def test_instructions_compute_what_they_say(whole):
    module, function, builder = function_of(ROW, WHOLE)
    row, index = function.args
    a, b = (builder.load(builder.gep(row, [WHOLE(place)])) for place in (0, 1))
    results = [builder.fadd(a, b), builder.fsub(a, b), builder.fmul(a, b), builder.fdiv(a, b)]
    wholes = [builder.add(index, WHOLE(3)), builder.sub(index, WHOLE(3)), builder.mul(index, WHOLE(3))]
    for place, value in enumerate([*results, *(builder.sitofp(each, NUMBER) for each in wholes)]):
        builder.store(value, builder.gep(row, [builder.add(WHOLE(2), WHOLE(place))]), whole=whole)
    builder.ret_void()
    out = np.array([6.0, -4.0, *[0.0] * 8])
    run(module, out, 5)
    np.testing.assert_array_equal(out, [6.0, -4.0, 2.0, 10.0, -24.0, -1.5, 8.0, 2.0, 15.0, 0.0])
    assert ("store volatile" in str(module)) is whole


def test_lines_are_numbered_from_one_and_follow_each_other():
    _, function, builder = function_of(ROW)
    [row] = function.args
    first = builder.load(row)
    second = builder.fmul(first, first, flags=("fast",))
    assert (first.reference, second.reference) == ('%"line.1"', '%"line.2"')
    assert str(first) == '%"line.1" = load double, double* %".1"'
    assert str(second) == '%"line.2" = fmul fast double %"line.1", %"line.1"'
    assert second.get_reference() == second.reference
    assert [str(each) for each in builder.block.instructions] == [str(first), str(second)]
    # At another place of the block, lines are inserted there.
    builder.position_at_start(builder.block)
    third, fourth = builder.load(row), builder.load(row)
    assert builder.block.instructions == [third, fourth, first, second]


def test_alignment():
    _, function, builder = function_of(ROW)
    [row] = function.args
    value = builder.load(row, align=8)
    assert str(value).endswith('%".1", align 8')
    assert str(builder.store(value, row, align=16)).endswith(", align 16")
    assert "align" not in str(builder.store(value, row))
    assert str(builder.load(row, typ=WHOLE)).startswith('%"line.2" = load i64, double*')


def test_values_of_other_types():
    _, function, builder = function_of(ROW)
    [row] = function.args
    assert builder.bitcast(row, ROW) is row
    other = builder.bitcast(row, WHOLE.as_pointer())
    assert isinstance(other, Line)
    assert str(other) == '%"line.1" = bitcast double* %".1" to i64*'
    assert other.type == WHOLE.as_pointer()
    with pytest.raises(ValueError, match="fadd of double and i64: the types must be equal"):
        builder.fadd(NUMBER(1.0), WHOLE(1))
    with pytest.raises(TypeError, match="double cannot be stored at i64"):
        builder.store(NUMBER(1.0), other)
