"""The structures that kernels pass around.

A trajectory is one flat vector ``y`` of ``n (1 + k)`` entries: the ``n`` of the state, then ``k`` tangent
vectors one after the other, so that each of them is contiguous.
"""

from typing import NamedTuple

from hybrid.kernels.types.entries import COUNTERS, NUMBERS
from hybrid.kernels.types.kinds import (
    CUBE,
    INDEX_MATRIX,
    INDICES,
    INTEGER,
    MATRIX,
    REAL,
    TRUTH,
    VECTOR,
    Pair,
    function,
)
from hybrid.kernels.types.structure import Structure

EPSILON = 2.220446049250313e-16
# Factor ``U`` that splits a number ``x``: ``U x - (U x - x)`` has the upper half of the digits of ``x``.
UPPER_HALF = 2.0**27 + 1.0

VECTOR_FUNCTION = function(None, INTEGER, REAL, VECTOR, VECTOR, VECTOR)
SERIES_FUNCTION = function(None, INTEGER, REAL, VECTOR, VECTOR, INTEGER, MATRIX)
MATRIX_FUNCTION = function(None, INTEGER, REAL, VECTOR, VECTOR, MATRIX)


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


class Path(NamedTuple):
    """The state and the time along a step, for values of the step's variable in ``[0, length]``.

    ``powers (>= degree + 1, columns)`` are the coefficients of the state's components in powers of the
    variable. Time is ``start`` plus ``pace`` times the variable if ``clock`` is negative; otherwise it is
    ``start`` plus the column ``clock``. An ``exact`` path has no error of a method. Guards that are columns
    behind the state may be there by their roots, of the order ``root``; 1 for the guards themselves.
    """

    powers: MATRIX
    degree: INTEGER
    clock: INTEGER
    start: REAL
    pace: REAL
    length: REAL
    exact: TRUTH
    root: INTEGER


# ``bounds.bound_guard`` and ``bounds.spread_by_rounding``.
BOUND = function(INTEGER, Programs, INTEGER, Path, REAL, REAL, MATRIX)
SPREAD = function(REAL, Programs, INTEGER, REAL, REAL, VECTOR, VECTOR, REAL, MATRIX)


class Model(Structure):
    """The functions of a compiled system, its parameters and its graph as index arrays.

    Of the ``dimension`` components of the state the first ``controlled`` have tangent vectors and tolerances;
    the others are counters, and exact. Component ``age`` is the time since the mode was entered; -1 for none.
    ``guard(i, ...)`` is the guard of transition ``i`` and ``guard(i + transitions, ...)`` its condition,
    which leaves ``out`` alone if there is none. Behind all conditions come the numbers of clocks that resets
    may change: they are ``run.ticks[moving]``, and belong to the transitions ``mover``.
    ``outgoing[first_outgoing[m]:first_outgoing[m + 1]]`` are the
    transitions that leave mode ``m``, in the order they were listed, but for those that only a start fires:
    these are in ``at_start[first_at_start[m]:first_at_start[m + 1]]``. ``target`` is -1 for one that ends the
    run. ``affine_guard`` is 1 for a guard that is affine in state and time, ``guard_in_series`` for one that
    the series of its mode hold in a column; ``bound`` and ``spread`` run the ``programs`` of the others.
    Transitions with the same ``surface`` have the same guard up to a factor, its sign the product of their
    ``orientation``; ``paired`` is 1 for a transition whose mode has others that fire the other way across its
    surface. ``clock`` is the kind of a transition's clock, 0 for one with a guard; clocks are not among
    ``outgoing`` but in ``clocks[first_clock[m]:first_clock[m + 1]]``. Copies of one transition in a system
    that has been split count the ticks of ``tick_of``, and transitions with the same clock have the same
    ``clock_of``. ``whole_mode`` is the mode that one is a part of, and ``enters`` 1 for a transition that
    enters its target anew. ``accumulates_to`` is the mode after a complete chatter, or -1. ``propagator``
    says how each mode is advanced; ``degree`` is that of its solutions in time where they are polynomials,
    else 0. ``fragile`` is 1 for a mode whose series may be undefined where its field is not, ``abrupt`` for
    one whose field may change abruptly, ``bounded`` for one whose forcing can be bounded, so that no pulse in
    it is stepped over.
    ``first_forcing[m]`` is the first forcing of mode ``m``, whose program is behind those of
    all transitions; ``forcing_component`` is the component of the state whose rate a forcing is a term of, or
    -1; ``forcing_kind`` is one of those in ``codes``. Residues are rates that may cancel to their rounding:
    ``first_residue[m]`` is the first of mode ``m``, their programs are behind those of all forcings, and
    ``residue_component`` is the component that one is the rate of. The residues of guards, those of their
    terms that may cancel so, have programs behind them.
    ``field_jacobian`` writes its last column, and in row ``i`` of mode ``m`` the columns
    ``slope_column[first_slope[m, i]:first_slope[m, i + 1]]``: all others are zero.
    ``steep`` is 1 for a mode whose field has powers of its guards that may have an infinite slope at the
    guard; ``root`` is the order of the root that the series of a mode hold for its guards. ``field_before``
    and ``field_behind`` are the numbers of the fields at the crossing of a guard, on its two sides.
    ``timed`` is 1 for a mode whose field or one of whose guards may depend on time, ``timed_jump`` for a
    transition whose guard or reset may. ``keeps_state`` is 1 for a transition whose reset is the identity,
    ``jumping_reset`` for one whose reset may jump,
    ``read_by (modes, n)`` says what depends on a component besides itself,
    ``conditional`` for a mode that is left under conditions.
    ``tangent_start`` is the first column of tangent vectors in series, ``tangent_columns`` how many four of
    them have in each mode. ``period`` is 0 without a forcing period.
    The times at which tables in mode ``m`` have their points, which end steps, come in the groups
    ``first_group[m]`` to ``first_group[m + 1]``: ``knots[first_knot[g]:first_knot[g + 1]]``, which come again
    after ``repeat[g]`` unless that is 0. ``before_knots`` are the last times certainly before them.
    ``parameters`` go on behind the parameters themselves: there the numbers of the tables are. Before them,
    at ``row``, functions read which row of a schedule fires; -1 if none asks.
    """

    field: VECTOR_FUNCTION
    field_jacobian: MATRIX_FUNCTION
    variational_field: VECTOR_FUNCTION
    guard: VECTOR_FUNCTION
    guard_gradient: VECTOR_FUNCTION
    guard_curvature: VECTOR_FUNCTION
    reset: VECTOR_FUNCTION
    reset_jacobian: MATRIX_FUNCTION
    series: SERIES_FUNCTION
    parameters: VECTOR
    dimension: INTEGER
    controlled: INTEGER
    age: INTEGER
    first_outgoing: INDICES
    outgoing: INDICES
    first_at_start: INDICES
    at_start: INDICES
    target: INDICES
    direction: INDICES
    affine_guard: INDICES
    guard_in_series: INDICES
    programs: Programs
    bound: BOUND
    spread: SPREAD
    first_forcing: INDICES
    forcing_component: INDICES
    forcing_kind: INDICES
    first_residue: INDICES
    residue_component: INDICES
    first_slope: INDEX_MATRIX
    slope_column: INDICES
    surface: INDICES
    orientation: INDICES
    paired: INDICES
    marker: INDICES
    clock: INDICES
    row: INTEGER
    moving: INDICES
    mover: INDICES
    first_clock: INDICES
    clocks: INDICES
    first_tick: INDICES
    tick_of: INDICES
    clock_of: INDICES
    whole_mode: INDICES
    enters: INDICES
    accumulates_to: INDICES
    propagator: INDICES
    degree: INDICES
    fragile: INDICES
    abrupt: INDICES
    bounded: INDICES
    steep: INDICES
    root: INDICES
    field_before: INDICES
    field_behind: INDICES
    timed: INDICES
    timed_jump: INDICES
    read_by: INDEX_MATRIX
    keeps_state: INDICES
    jumping_reset: INDICES
    conditional: INDICES
    tangent_start: INTEGER
    tangent_columns: INDICES
    period: REAL
    first_group: INDICES
    repeat: VECTOR
    first_knot: INDICES
    knots: VECTOR
    before_knots: VECTOR


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
    implicit: INTEGER
    order: INTEGER
    exponent: REAL
    rtol: REAL
    atol: REAL
    max_step: REAL


class Run(Structure, counters=COUNTERS, numbers=NUMBERS):
    """The mutable state of one trajectory: all that a run needs to be taken up again.

    - ``y (n (1 + k),)``: the state, then the tangent vectors one after another.
    - ``side (transitions,)``: the sign that each guard of the mode last had.
    - ``on_guard (transitions,)``: 1 if the guard vanishes at the last event or entry and has not been left
      since; 2 if its speed vanishes too, 3 if its acceleration does as well, 4 if it jumps across zero there.
    - ``due (transitions,)``: 1 if the guard has been crossed at this instant and has not fired yet.
    - ``recent``: the last to fire; jump ``j`` is at ``j`` modulo the length. ``fires``: how often each has.
      ``visits (64, n + 2)``: the states right after those jumps, with their phases and cycles.
    - ``side_before, order_before, unproved_before (transitions,)``: ``side, on_guard, unproved`` at the start
      of the last step. ``tried_side, tried_due, tried_order``: the same as ``side, due, on_guard`` behind a
      jump that is tried.
    - ``changes (transitions,)``: the share of the last step from which on each guard counts as on the other
      side than before, at a crossing or on the way to it; ``NO_ROOT`` if it does not. ``unproved
      (transitions,)``: on how many steps the crossings of each guard are not proved.
    - ``tick (transitions,)``: the number of the next tick of each transition; ``ticked (transitions,)``: that
      of the first tick of a clock that has not fired anything yet. ``ticks`` are the numbers of all
      clocks, those of a transition from ``model.first_tick`` on: period and offset, or times in order, or a
      duration, or the times left of what is under way and how far a tick of these may be behind. ``rows`` are
      the places of the times before they were put in order, ``row`` that of the last to fire.
      The mode was entered in the period ``entry_cycle`` at ``entry_phase``, and ``entry_low`` of rounding;
      the same three numbers of the ``arrival`` tell when it was entered from another mode, and those of the
      ``reading`` when the numbers of clocks that resets may change were last read.
      ``turned``: jumps at ticks that changed which transition of their clock may fire, last to ``turned_to``.
    - ``clear``: 1 if the last jump has left the state clear of all guards but its own, whose sides are in
      ``tried_side``. ``distant``: 1 if the last step has proved that all guards are far from zero at its end;
      ``crossings``: 1 if it has found one crossing, which is certain.
    - ``horizon``: how long the run takes, 0 if that is not known at its start; ``longest_step`` in time so
      far; ``lateness``: the largest change that the rounding of the time made, in tolerances;
      ``unknown_time``: the largest error that the time of a jump may have where a guard came to rest, and the
      transition ``ran_dry`` there; 0 if the tolerances cover it.
    - ``first_step, stay (modes,)``: the first step of the last stay in each mode, and how long it lasted.
    - ``scale (n,)``: the size of the components over the last step; rounding is judged against it. From
      ``stretch (n,)``, the state after ``stretch_steps`` steps, with the time ``stretch_left`` left, the run
      has to get on; ``stretch_moved`` is 1 if the state has moved since.
    - ``growth (k,)``: sums of the logarithms of the lengths that orthonormalisation took out of tangents;
      ``trail (4, n + 1)`` follows jumps to their limit; its rows have names (``codes``).
    - ``before (n k,)``, ``growth_before (k,)``: the tangent vectors and their growth before a jump that sets
      off others at the same instant. ``instant (n (1 + n),)``: the derivative of that instant, then the
      columns of the tangent map of its jumps so far. If ``map_is_known`` is 0, the first ``n`` numbers are
      the state before the jump instead, and the map is computed when it is needed.
    """

    counters: INDICES
    numbers: VECTOR
    y: VECTOR
    side: INDICES
    on_guard: INDICES
    due: INDICES
    recent: INDICES
    fires: INDICES
    side_before: INDICES
    order_before: INDICES
    unproved_before: INDICES
    tried_side: INDICES
    tried_due: INDICES
    tried_order: INDICES
    changes: VECTOR
    unproved: INDICES
    visits: MATRIX
    tick: INDICES
    ticked: INDICES
    ticks: VECTOR
    rows: INDICES
    first_step: VECTOR
    stay: VECTOR
    scale: VECTOR
    stretch: VECTOR
    growth: VECTOR
    trail: MATRIX
    before: VECTOR
    growth_before: VECTOR
    instant: VECTOR


class Work(Structure):
    """Scratch memory, allocated once a run.

    ``stages (S, N + 1)`` of the current step, the divergence last in each row, and ``speeds (2, S)`` of a
    guard along them, with the sizes of their terms; ``trial, new, error, second_error (N,)``; ``jacobian,
    reset_jacobian (n, n + 1)``; ``gradient (n + 1,)``; ``scalar (1,)``; ``field, field_after, state, settled
    (n,)``; ``departure (n,)``, the state before the step; ``path_error (n,)``, how far a step may be off at
    its end; ``scale_before (n,)``, sizes of the state that the run goes back to; ``saltation, sizes (n, n)``;
    ``rounding (4, n)``, how far the rates move, and the place where a guard's derivatives are asked for;
    ``path (d + 3, n + guards)``, the powers of the step's interpolant and of guards on it, their values at
    its end and what these are sums of; ``polynomial`` and ``stack`` hold the leading powers of a guard,
    ``intervals`` the pieces of its isolation; ``registers (r, 6)``, what is known of each row of a program,
    and ``samples (nodes + 1, 2 r)`` the ranges of these rows at the nodes of a step and what they have in
    common; ``rates (2, N)``, the field along a step.

    For implicit methods, else empty: ``systems ((s + 1) n + s + 4, s n)``, ``pivots ((s + 1) n,)``. The rows
    are the factored matrix of the stages, that of the estimate's filter ``(n, n)``, a right-hand side, and
    the polynomial of the last step: its stages, its start, its end, its length and its mode, -1 for none.

    For Taylor series, else empty: ``series (order + 3, columns)``, the last two rows scratch,
    and ``weights (1, columns)`` of its columns in the control of the step.
    """

    stages: MATRIX
    speeds: MATRIX
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
    departure: VECTOR
    path_error: VECTOR
    scale_before: VECTOR
    saltation: MATRIX
    sizes: MATRIX
    rounding: MATRIX
    path: MATRIX
    polynomial: VECTOR
    stack: MATRIX
    intervals: MATRIX
    registers: MATRIX
    samples: MATRIX
    rates: MATRIX
    systems: MATRIX
    pivots: INDICES
    series: MATRIX
    weights: MATRIX


class Record(
    Structure,
    used=("steps", "jumps", "grazings", "matrices"),
    step_time=("step_phase", "step_low", "step_length"),
    step_place=("step_cycle", "step_mode", "step_jumps"),
    jump_time=("jump_phase", "jump_low", "jump_transversality"),
    jump_place=("jump_cycle", "jump_transition", "jump_kind", "jump_has_matrix", "jump_row"),
    grazing_time=("grazing_phase", "grazing_value", "grazing_acceleration"),
    grazing_place=("grazing_cycle", "grazing_transition", "grazing_jumps"),
):
    """Room for what a run is asked to remember; arrays of length zero remember nothing.

    ``steps, jumps, grazings, matrices`` count the entries in use.

    - A step: the phase of its start and what that has lost in rounding, its length, cycle, mode and the
      number of jumps before it; polynomials ``(d + 1, n + 1)`` in a variable on [0, 1], of the state and of
      the time since the start.
    - A jump: its phase and cycle, the transition, its transversality and kind, the states ``(2, n)`` before
      and after, whether its saltation matrix ``(n, n)`` is recorded, and the row of a schedule that fired
      last. The matrices follow in order.
    - A grazing: its phase and cycle, the transition, the number of jumps before it, the guard's value and
      acceleration, and the state.
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


class Attempts(Structure):
    """What a step may need: parts that are not compiled where they are not called.

    ``attempt_implicit`` is the step of an implicit method; ``explained_step``, ``explained_attempt`` and
    ``explained_series`` shorten a step so that no pulse of the field is hidden from it; ``follows_attempt``
    compares the interpolant of a step with the field;
    ``crossing_on_path`` finds the crossing of a guard that may not keep to its side.
    """

    attempt_implicit: function(REAL, Model, Method, INTEGER, REAL, REAL, VECTOR, INTEGER, Work)
    explained_step: function(REAL, Model, Method, Run, REAL, Work)
    explained_attempt: function(REAL, Model, Method, Run, REAL, Work)
    follows_attempt: function(TRUTH, Model, Method, Run, REAL, Work)
    explained_series: function(REAL, Model, Method, Run, INTEGER, Path, Work)
    crossing_on_path: function(Pair(REAL), Model, Method, Run, INTEGER, INTEGER, Path, Work)


class Task(Structure):
    """All that belongs to one run: the model and the method, its state, its memory and its record.

    ``tangents`` is how many tangent vectors are carried; with ``orthonormal`` not zero they are
    orthonormalised whenever they come too close to each other.
    """

    attempts: Attempts
    model: Model
    method: Method
    run: Run
    record: Record
    work: Work
    tangents: INTEGER
    orthonormal: INTEGER


class Parts(Structure):
    """Pieces of the driver that run now and then, handed to it instead of being compiled into it.

    What is linked into a kernel is optimised again with it; what comes as an argument is not. What a run
    never calls need not even be compiled: the step of a Runge-Kutta method where every mode has a series,
    ``keep_apart`` without tangent vectors, ``look_back`` where no field changes abruptly, ``late_step`` and
    ``late_jump`` where nothing depends on time. Whether ``finish_chatter`` will be called is not known
    beforehand: with ``complete`` 0 it is absent.
    """

    runge_kutta_step: function(Pair(REAL), Task, REAL)
    enter: function(INTEGER, Model, Method, Run, Work)
    rests_on_guard: function(TRUTH, Task)
    arrived: function(INTEGER, Task)
    keep_apart: function(None, Model, Run, INTEGER, INTEGER, MATRIX)
    look_back: function(None, Model, Method, Run, REAL, Work)
    late_step: function(None, Model, Method, Run, REAL, Work)
    late_jump: function(None, Model, Method, Run, INTEGER, Work)
    jump: function(None, Task, INTEGER)
    jump_plainly: function(TRUTH, Task, INTEGER)
    finish_chatter: function(TRUTH, Task, INTEGER, REAL)
    complete: INTEGER
    rest: function(None, Task)
    first_in_order: function(INTEGER, Task, INTEGER, INTEGER, REAL)


# The driver itself comes as an argument to those who call it, for the same reason.
ADVANCE = function(INTEGER, Parts, Task, INTEGER, REAL, INTEGER, INTEGER)
