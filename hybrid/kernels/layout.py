"""The tuples that kernels pass around, and their numba types.

A trajectory is one flat vector ``y`` of ``n (1 + k)`` entries: the state first, then ``k`` tangent vectors
one after the other, so that each of them is contiguous. ``n`` is the dimension, ``k`` the number of tangents.
"""

from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64, types, void

EPSILON = 2.220446049250313e-16

VECTOR = float64[::1]
MATRIX = float64[:, ::1]
CUBE = float64[:, :, ::1]
INDICES = int64[::1]

VECTOR_ROLE = types.FunctionType(void(int64, float64, VECTOR, VECTOR, VECTOR))
SERIES_ROLE = types.FunctionType(void(int64, float64, VECTOR, VECTOR, int64, MATRIX))
MATRIX_ROLE = types.FunctionType(void(int64, float64, VECTOR, VECTOR, MATRIX))


class Model(NamedTuple):
    """The roles of a compiled system, its parameters and its graph as index arrays.

    ``guard(i, ...)`` is the guard of transition ``i`` and ``guard(i + transitions, ...)`` its condition,
    which leaves ``out`` alone if there is none. ``outgoing[first_outgoing[m]:first_outgoing[m + 1]]`` are the
    transitions that leave mode ``m``, in the order they were listed; ``target`` is -1 for one that ends the
    run. ``boundary`` is 1 for a transition that a state on the far side of its guard
    must take at once, 0 for one that only crossings fire; ``accumulates_to`` the mode after a complete
    chatter, or -1. ``propagator`` says how each mode is advanced; ``degree`` is that of its solutions in time
    where they are polynomials, else 0. ``period`` is 0 without a forcing period.
    """

    flow: object
    flow_jacobian: object
    variational_flow: object
    guard: object
    guard_gradient: object
    reset: object
    reset_jacobian: object
    series: object
    parameters: np.ndarray
    dimension: int
    first_outgoing: np.ndarray
    outgoing: np.ndarray
    target: np.ndarray
    direction: np.ndarray
    affine_guard: np.ndarray
    boundary: np.ndarray
    marker: np.ndarray
    accumulates_to: np.ndarray
    propagator: np.ndarray
    degree: np.ndarray
    period: float


MODEL = types.NamedTuple(
    (
        VECTOR_ROLE,
        MATRIX_ROLE,
        VECTOR_ROLE,
        VECTOR_ROLE,
        VECTOR_ROLE,
        VECTOR_ROLE,
        MATRIX_ROLE,
        SERIES_ROLE,
        VECTOR,
        int64,
        INDICES,
        INDICES,
        INDICES,
        INDICES,
        INDICES,
        INDICES,
        INDICES,
        INDICES,
        INDICES,
        INDICES,
        float64,
    ),
    Model,
)


class Method(NamedTuple):
    """A Runge-Kutta method with its interpolant and its tolerances.

    ``a (S, S)``, ``b (s,)``, ``c (S,)`` with ``s`` stages for the step; row ``s`` is the derivative at the
    new point and rows up to ``S`` serve the interpolant alone. ``error`` and ``second_error`` ``(s + 1,)``
    weigh the stages into the error estimate, ``quadrature (s + 1,)`` into an integral over the step.
    ``interpolant (d + 1, S)`` gives the Bernstein coefficients of the step's interpolant: ``y0 + h *
    interpolant @ stages``. With ``implicit`` 1, row 0 is the derivative at the start, rows 1 to ``s`` are
    coupled and have the weights ``b``, and ``error[0]`` is also the coefficient of the estimate's filter.
    ``order`` is that of Taylor series.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    error: np.ndarray
    second_error: np.ndarray
    quadrature: np.ndarray
    interpolant: np.ndarray
    implicit: int
    order: int
    exponent: float
    rtol: float
    atol: float
    max_step: float


METHOD = types.NamedTuple(
    (
        MATRIX,
        VECTOR,
        VECTOR,
        VECTOR,
        VECTOR,
        VECTOR,
        MATRIX,
        int64,
        int64,
        float64,
        float64,
        float64,
        float64,
    ),
    Method,
)


class Run(NamedTuple):
    """The mutable state of one trajectory: all that a run needs to be taken up again.

    ``count`` and ``clock`` have the slots named in ``codes``; ``y (n (1 + k),)``; ``side (transitions,)`` is
    the sign each guard of the mode was last known to have; ``on_guard (transitions,)`` is 1 where the guard
    vanishes at the entry of the mode and has not been left since, 2 where its speed does too, 3 where its
    acceleration does as well; ``first_step (modes,)`` remembers the step a mode began with; ``scale (n,)``
    the size of the components over the last step, against which rounding is judged; ``growth (k,)`` sums the
    logarithms of the lengths taken out of the tangent vectors by orthonormalisation.
    ``trail (3, n + 1)`` follows the jumps of one transition to their limit.
    """

    count: np.ndarray
    clock: np.ndarray
    y: np.ndarray
    side: np.ndarray
    on_guard: np.ndarray
    first_step: np.ndarray
    scale: np.ndarray
    growth: np.ndarray
    trail: np.ndarray


RUN = types.NamedTuple((INDICES, VECTOR, VECTOR, INDICES, INDICES, VECTOR, VECTOR, VECTOR, MATRIX), Run)


class Work(NamedTuple):
    """Scratch memory, allocated once a run.

    ``stages (S, N + 1)`` of the current step, the divergence last in each row, and ``speeds (S,)`` of a guard
    along them; ``trial, new, error, second_error (N,)``; ``jacobian, reset_jacobian (n, n + 1)``; ``gradient
    (n + 1,)``; ``scalar (1,)``; ``field, field_after, state, settled (n,)``; ``saltation (n, n)``;
    ``coefficients (d + 1, n)`` of the step's interpolant; ``polynomial (q + 1,)`` of a guard, ``stack`` and
    ``intervals`` for its isolation; ``nodes (q + 1,)`` and ``fit (q + 1, q + 1)`` from values there to
    Bernstein coefficients.

    For implicit methods, else empty: ``systems ((s + 1) n + s + 4, s n)``, ``pivots ((s + 1) n,)``. The rows
    are the factored matrix of the stages, that of the estimate's filter ``(n, n)``, a right-hand side, and
    the polynomial of the last step: its stages, its start, its end, its length and its mode, -1 for none.
    One array for all, since each one more is paid for wherever this tuple is passed.

    For Taylor series, else empty: ``series (order + 1, columns)``.
    """

    stages: np.ndarray
    speeds: np.ndarray
    trial: np.ndarray
    new: np.ndarray
    error: np.ndarray
    second_error: np.ndarray
    jacobian: np.ndarray
    reset_jacobian: np.ndarray
    gradient: np.ndarray
    scalar: np.ndarray
    field: np.ndarray
    field_after: np.ndarray
    state: np.ndarray
    settled: np.ndarray
    saltation: np.ndarray
    coefficients: np.ndarray
    polynomial: np.ndarray
    stack: np.ndarray
    intervals: np.ndarray
    nodes: np.ndarray
    fit: np.ndarray
    systems: np.ndarray
    pivots: np.ndarray
    series: np.ndarray


WORK = types.NamedTuple(
    (
        MATRIX,  # stages
        VECTOR,  # speeds
        VECTOR,  # trial
        VECTOR,  # new
        VECTOR,  # error
        VECTOR,  # second_error
        MATRIX,  # jacobian
        MATRIX,  # reset_jacobian
        VECTOR,  # gradient
        VECTOR,  # scalar
        VECTOR,  # field
        VECTOR,  # field_after
        VECTOR,  # state
        VECTOR,  # settled
        MATRIX,  # saltation
        MATRIX,  # coefficients
        VECTOR,  # polynomial
        MATRIX,  # stack
        MATRIX,  # intervals
        VECTOR,  # nodes
        MATRIX,  # fit
        MATRIX,  # systems
        INDICES,  # pivots
        MATRIX,  # series
    ),
    Work,
)


class Record(NamedTuple):
    """Room for what a run is asked to remember; arrays of length zero remember nothing.

    ``used (3,)`` counts the steps, jumps and grazings in it. A step: its start ``(phase, length)``, ``(cycle,
    mode, jump count)`` and the Bernstein coefficients ``(d + 1, n + 1)`` of the state and of the time since.
    A jump: its phase and transversality, ``(cycle, transition, kind)``, the states ``(2, n)`` before and
    after, and the saltation matrix ``(n, n)``. A grazing: ``(phase, value, acceleration)`` of the guard,
    ``(cycle, transition, jump count)`` and the state.
    """

    used: np.ndarray
    step_time: np.ndarray
    step_place: np.ndarray
    step_coefficients: np.ndarray
    jump_time: np.ndarray
    jump_place: np.ndarray
    jump_states: np.ndarray
    jump_saltation: np.ndarray
    grazing_time: np.ndarray
    grazing_place: np.ndarray
    grazing_state: np.ndarray


INDEX_MATRIX = int64[:, ::1]
RECORD = types.NamedTuple(
    (INDICES, MATRIX, INDEX_MATRIX, CUBE, MATRIX, INDEX_MATRIX, CUBE, CUBE, MATRIX, INDEX_MATRIX, MATRIX),
    Record,
)


class Attempts(NamedTuple):
    """The step of an implicit method, which need not be compiled where the method is explicit."""

    attempt_implicit: object


ATTEMPTS = types.NamedUniTuple(
    types.FunctionType(float64(MODEL, METHOD, int64, float64, float64, VECTOR, int64, WORK)), 1, Attempts
)


class Parts(NamedTuple):
    """Pieces of the driver that run now and then, handed to it instead of being compiled into it.

    What is linked into a kernel is optimised again with it; what comes as an argument is not, and the step of
    a Runge-Kutta method need not even be compiled where every mode has a series.
    """

    attempts: Attempts
    runge_kutta_step: object
    enter: object
    jump: object
    finish_chatter: object
    rest: object
    first_in_order: object


PARTS = types.NamedTuple(
    (
        ATTEMPTS,
        types.FunctionType(
            types.UniTuple(float64, 2)(ATTEMPTS, MODEL, METHOD, RUN, RECORD, int64, float64, WORK)
        ),
        types.FunctionType(int64(MODEL, RUN, WORK)),
        types.FunctionType(void(MODEL, METHOD, RUN, RECORD, int64, int64, boolean, WORK)),
        types.FunctionType(boolean(MODEL, METHOD, RUN, RECORD, int64, float64, int64, boolean, WORK)),
        types.FunctionType(void(MODEL, RUN, int64, int64, boolean, WORK)),
        types.FunctionType(int64(MODEL, RUN, RECORD, int64, WORK)),
    ),
    Parts,
)

# The driver itself comes as an argument to those who call it, for the same reason.
ADVANCE = types.FunctionType(
    int64(PARTS, MODEL, METHOD, RUN, RECORD, int64, boolean, int64, float64, int64, int64, WORK)
)

# How kernels are compiled. Sums may be reordered and fused, but nan and infinity keep their meaning.
_MATHEMATICS = {"error_model": "numpy", "fastmath": {"contract", "reassoc", "nsz"}}
# Called from Python, and kept on disk: these state their signatures.
ENTRY = _MATHEMATICS | {"nogil": True, "cache": True}
# Handed to the driver as a first-class function.
PART = ENTRY | {"no_cpython_wrapper": True}
# Called by other kernels only: it becomes part of them, so it is neither wrapped nor kept by itself and takes
# its types from its callers. A process that finds its callers on disk never looks at it.
KERNEL = _MATHEMATICS | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
# Small and called at every stage: passing the tuples would cost as much as the work.
INLINE = KERNEL | {"forceinline": True}
