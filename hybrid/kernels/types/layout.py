"""The structures that kernels pass around, and their numba types.

A trajectory is one flat vector ``y`` of ``n (1 + k)`` entries: the state first, then ``k`` tangent vectors
one after the other, so that each of them is contiguous. ``n`` is the dimension, ``k`` the number of tangents.
"""

from numba import boolean, float64, int64, types, void

from hybrid.kernels.types.options import Options, PartCompiler
from hybrid.kernels.types.structure import Structure

EPSILON = 2.220446049250313e-16

VECTOR = float64[::1]
MATRIX = float64[:, ::1]
CUBE = float64[:, :, ::1]
INDICES = int64[::1]
INDEX_MATRIX = int64[:, ::1]

VECTOR_ROLE = types.FunctionType(void(int64, float64, VECTOR, VECTOR, VECTOR))
SERIES_ROLE = types.FunctionType(void(int64, float64, VECTOR, VECTOR, int64, MATRIX))
MATRIX_ROLE = types.FunctionType(void(int64, float64, VECTOR, VECTOR, MATRIX))


class Programs(Structure):
    """The expressions of guards and forcings as operations (see ``operations``), with their parameters.

    ``rows[first[i]:first[i + 1]]`` is the program of transition ``i``, empty for a guard that is affine or
    that could not be traced; those of the forcings and of the residues follow. ``checked`` is 1 for the rows
    of a forcing that could hide a pulse; ``numbers`` are the constants in the programs.
    """

    rows: INDEX_MATRIX
    checked: INDICES
    numbers: VECTOR
    first: INDICES
    parameters: VECTOR


PROGRAMS = Programs.numba_type

# ``bounds.bound_guard`` and ``bounds.spread_by_rounding``.
BOUND = types.FunctionType(
    int64(PROGRAMS, int64, MATRIX, int64, int64, float64, float64, float64, float64, MATRIX)
)
SPREAD = types.FunctionType(float64(PROGRAMS, int64, float64, VECTOR, VECTOR, float64, MATRIX))


class Model(Structure):
    """The functions of a compiled system, its parameters and its graph as index arrays.

    ``guard(i, ...)`` is the guard of transition ``i`` and ``guard(i + transitions, ...)`` its condition,
    which leaves ``out`` alone if there is none. ``outgoing[first_outgoing[m]:first_outgoing[m + 1]]`` are the
    transitions that leave mode ``m``, in the order they were listed, but for those that only a start fires:
    these are in ``at_start[first_at_start[m]:first_at_start[m + 1]]``. ``target`` is -1 for one that ends the
    run. ``affine_guard`` is 1 for a guard that is affine in state and time, ``guard_in_series`` for one that
    the series of its mode hold in a column; ``bound`` and ``spread`` run the ``programs`` of the others.
    Transitions with the same ``surface`` have the same guard up to a factor, its sign the product of their
    ``orientation``; ``paired`` is 1 for a transition whose mode has others that fire the other way across its
    surface. ``accumulates_to`` is the mode after a complete chatter, or -1. ``propagator`` says how each mode
    is advanced; ``degree`` is that of its solutions in time where they are polynomials, else 0.
    ``first_forcing[m]`` is the first forcing of mode ``m``, whose program is behind those of all transitions;
    ``forcing_component`` is the component of the state whose rate a forcing is a term of, or -1. Residues are
    rates that may cancel to their rounding: ``first_residue[m]`` is the first of mode ``m``, their programs
    are behind those of all forcings, and ``residue_component`` is the component that one is the rate of. The
    residues of guards, those of their terms that may cancel so, have programs behind them.
    ``timed`` is 1 for a mode whose field or one of whose guards may depend on time.
    ``tangent_start`` is the first column of tangent vectors in series, ``tangent_columns`` how many four of
    them have in each mode. ``period`` is 0 without a forcing period.
    """

    flow: VECTOR_ROLE
    flow_jacobian: MATRIX_ROLE
    variational_flow: VECTOR_ROLE
    guard: VECTOR_ROLE
    guard_gradient: VECTOR_ROLE
    reset: VECTOR_ROLE
    reset_jacobian: MATRIX_ROLE
    series: SERIES_ROLE
    parameters: VECTOR
    dimension: int64
    first_outgoing: INDICES
    outgoing: INDICES
    first_at_start: INDICES
    at_start: INDICES
    target: INDICES
    direction: INDICES
    affine_guard: INDICES
    guard_in_series: INDICES
    programs: PROGRAMS
    bound: BOUND
    spread: SPREAD
    first_forcing: INDICES
    forcing_component: INDICES
    first_residue: INDICES
    residue_component: INDICES
    surface: INDICES
    orientation: INDICES
    paired: INDICES
    marker: INDICES
    accumulates_to: INDICES
    propagator: INDICES
    degree: INDICES
    timed: INDICES
    tangent_start: int64
    tangent_columns: INDICES
    period: float64


MODEL = Model.numba_type


class Method(Structure):
    """A Runge-Kutta method with its interpolant and its tolerances.

    ``a (S, S)``, ``b (s,)``, ``c (S,)`` with ``s`` stages for the step; row ``s`` is the derivative at the
    new point and rows up to ``S`` serve the interpolant alone. ``error`` and ``second_error`` ``(s + 1,)``
    weigh the stages into the error estimate, ``quadrature (s + 1,)`` into an integral over the step.
    ``interpolant (d + 1, S)`` gives the Bernstein coefficients of the step's interpolant: ``y0 + h *
    interpolant @ stages``, ``powers (d + 1, S)`` those of its powers but for ``y0``. With ``implicit`` 1, row
    0 is the derivative at the start, rows 1 to ``s`` are coupled and have the weights ``b``, and ``error[0]``
    is also the coefficient of the estimate's filter.
    ``order`` is that of Taylor series. ``nodes`` are the places of a step, 0 and 1 among them, at which the
    method looks at a function of time; at ``series_nodes``, with ``series_weights`` for an integral, a series
    is compared with the field.
    """

    a: MATRIX
    b: VECTOR
    c: VECTOR
    error: VECTOR
    second_error: VECTOR
    quadrature: VECTOR
    interpolant: MATRIX
    powers: MATRIX
    nodes: VECTOR
    series_nodes: VECTOR
    series_weights: VECTOR
    implicit: int64
    order: int64
    exponent: float64
    rtol: float64
    atol: float64
    max_step: float64


METHOD = Method.numba_type


class Run(Structure):
    """The mutable state of one trajectory: all that a run needs to be taken up again.

    ``count`` and ``clock`` have the slots named in ``codes``; ``y (n (1 + k),)``; ``side (transitions,)`` is
    the sign each guard of the mode was last known to have; ``on_guard (transitions,)`` is 1 where the guard
    vanishes at the last event or entry and has not been left since, 2 where its speed does too, 3 where its
    acceleration does as well; ``due (transitions,)`` is 1 where the guard has been crossed at this instant
    and its transition has not fired; ``recent`` are the last transitions that fired, jump ``j`` at ``j``
    modulo its length, and ``visits (64, n + 2)`` the states right after them, the phases and the cycles;
    ``rehearsal (3, transitions)`` is scratch for jumps that are only tried;
    ``first_step (modes,)`` remembers the step a mode began with and ``stay (modes,)`` how long the last stay
    in it was; ``scale (n,)`` the size of the components over the last step,
    against which rounding is judged; ``growth (k,)`` sums the logarithms of the lengths taken out of the
    tangent vectors by orthonormalisation. ``trail (3, n + 1)`` follows the jumps of one transition to their
    limit. The last three serve the jumps that one jump sets off at once: ``before (n k,)`` and
    ``growth_before (k,)`` are the tangent vectors and their growth before it, ``instant (n (1 + n),)`` what
    it and they make of a tangent vector since, first the derivative of their instant and then the columns of
    the tangent map; or, where ``MAP_IS_KNOWN`` is 0, the state before it, from which these follow.
    """

    count: INDICES
    clock: VECTOR
    y: VECTOR
    side: INDICES
    on_guard: INDICES
    due: INDICES
    recent: INDICES
    rehearsal: INDEX_MATRIX
    visits: MATRIX
    first_step: VECTOR
    stay: VECTOR
    scale: VECTOR
    growth: VECTOR
    trail: MATRIX
    before: VECTOR
    growth_before: VECTOR
    instant: VECTOR


RUN = Run.numba_type


class Work(Structure):
    """Scratch memory, allocated once a run.

    ``stages (S, N + 1)`` of the current step, the divergence last in each row, and ``speeds (S,)`` of a guard
    along them; ``trial, new, error, second_error (N,)``; ``jacobian, reset_jacobian (n, n + 1)``; ``gradient
    (n + 1,)``; ``scalar (1,)``; ``field, field_after, state, settled (n,)``; ``saltation (n, n)``;
    ``path (d + 1, n)``, the powers of the step's interpolant; ``polynomial (q + 1,)`` of a guard, ``stack``
    and ``intervals`` for its isolation; ``registers (r, 6)``, what is known of each row of a program, and
    ``samples (nodes + 1, 2 r)`` the ranges of these rows at the nodes of a step and what they have in common.

    For implicit methods, else empty: ``systems ((s + 1) n + s + 4, s n)``, ``pivots ((s + 1) n,)``. The rows
    are the factored matrix of the stages, that of the estimate's filter ``(n, n)``, a right-hand side, and
    the polynomial of the last step: its stages, its start, its end, its length and its mode, -1 for none.

    For Taylor series, else empty: ``series (order + 3, columns)``, the last two rows scratch,
    and ``weights (1, columns)`` of its columns in the control of the step.
    """

    stages: MATRIX
    speeds: VECTOR
    trial: VECTOR
    new: VECTOR
    error: VECTOR
    second_error: VECTOR
    jacobian: MATRIX
    reset_jacobian: MATRIX
    gradient: VECTOR
    scalar: VECTOR
    field: VECTOR
    field_after: VECTOR
    state: VECTOR
    settled: VECTOR
    saltation: MATRIX
    path: MATRIX
    polynomial: VECTOR
    stack: MATRIX
    intervals: MATRIX
    registers: MATRIX
    samples: MATRIX
    systems: MATRIX
    pivots: INDICES
    series: MATRIX
    weights: MATRIX


WORK = Work.numba_type


class Record(Structure):
    """Room for what a run is asked to remember; arrays of length zero remember nothing.

    ``used (4,)`` counts the steps, jumps, grazings and saltation matrices in it. A step: ``(phase, length,
    what the phase lost in rounding)`` of its start, ``(cycle, mode, jump count)`` and polynomials ``(d + 1, n
    + 1)`` of a place on [0, 1], the state and the time since. A jump: its phase and transversality, ``(cycle,
    transition, kind, known)`` and the states ``(2, n)`` before and after. The saltation matrices ``(n, n)``
    are those of the jumps where they are known, in order. A grazing: ``(phase, value, acceleration)`` of the
    guard, ``(cycle, transition, jump count)`` and the state.
    """

    used: INDICES
    step_time: MATRIX
    step_place: INDEX_MATRIX
    step_coefficients: CUBE
    jump_time: MATRIX
    jump_place: INDEX_MATRIX
    jump_states: CUBE
    jump_saltation: CUBE
    grazing_time: MATRIX
    grazing_place: INDEX_MATRIX
    grazing_state: MATRIX


RECORD = Record.numba_type


class Attempts(Structure):
    """What a step may need: parts that are not compiled where they are not called.

    ``attempt_implicit`` is the step of an implicit method; ``explained_step`` and ``explained_series``
    shorten a step so that no pulse of the forcing is hidden from it.
    """

    attempt_implicit: types.FunctionType(float64(MODEL, METHOD, int64, float64, float64, VECTOR, int64, WORK))
    explained_step: types.FunctionType(float64(MODEL, METHOD, RUN, float64, WORK))
    explained_series: types.FunctionType(float64(MODEL, METHOD, RUN, int64, int64, int64, float64, WORK))


ATTEMPTS = Attempts.numba_type


class Parts(Structure):
    """Pieces of the driver that run now and then, handed to it instead of being compiled into it.

    What is linked into a kernel is optimised again with it; what comes as an argument is not, and the step of
    a Runge-Kutta method need not even be compiled where every mode has a series.
    """

    attempts: ATTEMPTS
    runge_kutta_step: types.FunctionType(
        types.UniTuple(float64, 2)(ATTEMPTS, MODEL, METHOD, RUN, RECORD, int64, boolean, float64, WORK)
    )
    enter: types.FunctionType(int64(MODEL, RUN, WORK))
    jump: types.FunctionType(void(MODEL, METHOD, RUN, RECORD, int64, int64, boolean, WORK))
    finish_chatter: types.FunctionType(
        boolean(MODEL, METHOD, RUN, RECORD, int64, float64, int64, boolean, WORK)
    )
    rest: types.FunctionType(void(MODEL, RUN, int64, int64, boolean, WORK))
    first_in_order: types.FunctionType(int64(MODEL, RUN, RECORD, int64, WORK))


PARTS = Parts.numba_type

# The driver itself comes as an argument to those who call it, for the same reason.
ADVANCE = types.FunctionType(
    int64(PARTS, MODEL, METHOD, RUN, RECORD, int64, boolean, int64, float64, int64, int64, WORK)
)

# How kernels are compiled. Sums may be reordered and fused, but nan and infinity keep their meaning in
# comparisons (``math.isfinite`` takes the difference of a number and itself, which may be taken for zero).
# Kernels allocate nothing and own nothing, so no references are counted.
_MATHEMATICS = Options({"error_model": "numpy", "fastmath": {"contract", "reassoc", "nsz"}, "_nrt": False})
# Called from Python, and kept on disk: these state their signatures.
ENTRY = _MATHEMATICS | {"nogil": True, "cache": True}
# Handed to the driver as a first-class function.
PART = ENTRY | {"no_cpython_wrapper": True}
# Called by other kernels only: it becomes part of them, so by itself it is neither wrapped nor kept nor made
# machine code, and it takes its types from its callers. A process that finds these on disk never looks at it.
KERNEL = _MATHEMATICS | {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": PartCompiler,
}
# Small and called at every stage: the call would cost as much as the work.
INLINE = KERNEL | {"forceinline": True}
