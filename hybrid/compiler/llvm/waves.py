"""Sines and cosines of whole registers; a number is a register of one."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from hybrid.kernels.instructions.loops import declared
from hybrid.kernels.instructions.registers import DOUBLE, built_in, vector_of

# Beyond this size the quadrant is no longer exact; there the functions of one number are called.
LARGEST = 1e5
# Pi half in three parts: products of the first two with whole numbers have no rounding (Cody and Waite).
PER_QUADRANT = 0.6366197723675814
QUADRANT = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
# A float plus this number is rounded to a whole number, which its last bits hold.
ROUND = 6755399441055744.0
# Minimax polynomials on a quadrant, the highest power first (fdlibm, k_sin.c and k_cos.c).
SINE = (
    1.58969099521155010221e-10, -2.50507602534068634195e-08, 2.75573137070700676789e-06,
    -1.98412698298579493134e-04, 8.33333333332248946124e-03, -1.66666666666666324348e-01,
)  # fmt: skip
COSINE = (
    -1.13596475577881948265e-11, 2.08757232129817482790e-09, -2.75573143513906633035e-07,
    2.48015872894767294178e-05, -1.38888888888741095749e-03, 4.16666666666666019037e-02,
)  # fmt: skip


def sine(builder: Any, x: Any, *, shift: int = 0) -> Any:
    """The sine of each number of a register, within about a unit in the last place.

    For ``shift`` 1 it is the cosine.
    """
    width = x.type.count
    kind, whole = vector_of(width), ir.VectorType(ir.IntType(64), width)

    def all_of(number: float) -> Any:
        return kind([number] * width)

    def fused(a: Any, b: Any, c: Any) -> Any:
        return built_in(builder, "fmuladd", width, a, b, c)

    def polynomial(coefficients: tuple[float, ...], z: Any) -> Any:
        total = all_of(coefficients[0])
        for each in coefficients[1:]:
            total = fused(total, z, all_of(each))
        return total

    shifted = fused(x, all_of(PER_QUADRANT), all_of(ROUND))
    quadrants = builder.fsub(shifted, all_of(ROUND))
    bits = builder.add(builder.bitcast(shifted, whole), whole([shift] * width))
    rest = x
    for part in QUADRANT:
        rest = fused(quadrants, all_of(-part), rest)
    z = builder.fmul(rest, rest)
    odd = fused(builder.fmul(rest, z), polynomial(SINE, z), rest)
    even = fused(builder.fmul(z, z), polynomial(COSINE, z), fused(z, all_of(-0.5), all_of(1.0)))
    ones = whole([1] * width)
    takes_even = builder.icmp_signed("==", builder.and_(bits, ones), ones)
    value = builder.bitcast(builder.select(takes_even, even, odd), whole)
    # The second bit of the quadrant is the sign.
    sign = builder.shl(builder.and_(bits, whole([2] * width)), whole([62] * width))
    value = builder.bitcast(builder.xor(value, sign), kind)
    return _beyond(builder, x, value, "cos" if shift else "sin")


def _beyond(builder: Any, x: Any, value: Any, name: str) -> Any:
    """A value, or that of the function of one number where ``x`` is large."""
    width = x.type.count
    size = built_in(builder, "fabs", width, x)
    near = builder.fcmp_ordered("<=", size, vector_of(width)([LARGEST] * width))
    every = builder.icmp_signed(
        "==", builder.bitcast(near, ir.IntType(width)), ir.IntType(width)((1 << width) - 1)
    )
    with builder.goto_entry_block():
        place = builder.alloca(value.type)
    builder.store(value, place)
    with builder.if_then(builder.not_(every), likely=False):
        exact = value.type(ir.Undefined)
        function = declared(builder.module, ir.FunctionType(DOUBLE, [DOUBLE]), f"llvm.{name}.f64")
        for lane in range(width):
            index = ir.IntType(32)(lane)
            number = builder.call(function, [builder.extract_element(x, index)])
            exact = builder.insert_element(exact, number, index)
        builder.store(builder.select(near, value, exact), place)
    return builder.load(place, typ=value.type)
