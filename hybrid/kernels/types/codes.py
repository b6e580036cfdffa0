"""Integers shared by the kernels and the statuses that people read."""

DONE = 0
RECORD_FULL = 1
MAX_STEPS = 2
MAX_JUMPS = 3
STEP_TOO_SMALL = 4
NON_FINITE = 5
ACCUMULATION = 6
STUCK = 7
TERMINAL = 8
# No end yet.
GO_ON = -1
# No mode allows the start, or more than one does.
REFUSED = -2
# A part that is not compiled yet is needed.
INCOMPLETE = -3

# Steps after which a run must have got on.
MANY_STEPS = 10_000

# ``Run.stage``: what the driver has to do before it can step: nothing, evaluate the rates anew (the tangent
# vectors were changed from outside), or take its sides at every guard of a mode.
READY = 0
STALE = 1
ENTERING = 2
NO_TRANSITION = -1
# Instead of a transition: the state rests on the guard that has just fired.
RESTING = -2

# Kinds of jumps.
TRANSVERSE = 0
GRAZING = 1
LIMIT_OF_CHATTER = 2

# Rows of Run.trail, and what their last columns hold: the impulse per unit of the guard's speed, and that
# speed after the last impact; the last estimate of a limit, and the time left until it; marks of components
# that jumps move for ever; such marks at any limit that was taken.
IMPULSE, LIMIT, ENDLESS, HELD = range(4)

# What in a mode depends on a component of the state, besides its own rate and its own row of resets.
BY_NOTHING, BY_FLOW, BY_GUARD = range(3)

# Target of a transition that ends the run, and limit of a chatter that names none.
NO_MODE = -1

# Kinds of clocks, as ``hybrid.system.clocks`` numbers them; 0 for a guard. An arrival is an entry from
# another mode. Ticks that are under way count from when they were read.
EVERY, AT, AFTER, AFTER_ARRIVAL, UNDER_WAY = range(1, 6)
# Number of the next tick of a clock that has not been wound up yet.
FIRST_TICK = -(2**62)

# What a guard says of the start of a run: nothing against it, that it lies on the guard and moves beyond, or
# that it lies beyond.
NO_OBJECTION = 0
LEAVES = 1
BEYOND = 2

# Number of leading powers of a guard whose Bernstein coefficients lie in registers.
LEADING = 16

# Order of exact series, which no other exceeds: what the memory for series is laid out for.
HIGHEST_ORDER = 32
# Steps after which tangent vectors that are kept orthonormal are looked at. An exact step brings them closer
# by a factor of a few thousand at most. A stiff contact stretches all vectors along the speed and shrinks
# them again before it ends: such stretching is no sign of exponents that are far apart. One vector alone has
# no other that it could come close to: it is only kept from growing without bound.
STEPS_IN_EXACT, STEPS_IN_CONTACT, STEPS_ALONE = 2, 16, 32
# Columns of series that are worked on at once, and in the widest register.
NARROW = 4
WIDE = 2 * NARROW
# Runs that take a step together.
ABREAST = 8

# Propagators of a mode, and how people read them.
RUNGE_KUTTA = 0
TAYLOR = 1
EXACT = 2
DESINGULARISED = 3
ROOTED = 4
PROPAGATORS = (
    "Runge-Kutta pair",
    "Taylor series",
    "exact",
    "Taylor series, desingularised",
    "Taylor series, with the root of a guard",
)

# What a series may take the root of a guard from: the state; the end of the step before, which led here; or
# nothing, since the guard is zero and moves on.
FROM_STATE, FROM_LAST_STEP, FROM_ZERO = range(3)

# What is known of a row of a guard's program, in the columns of ``Work.registers``: a range, a range of the
# slope, and a range of the value in the middle of a piece.
LOW = 0
HIGH = 1
LEAST_SLOPE = 2
MOST_SLOPE = 3
LOW_MIDDLE = 4
HIGH_MIDDLE = 5
REGISTERS = 6

# What a forcing stands for: a part in time, terms in the state that may be pulses, or the arguments of the
# exponentials in these.
IN_TIME, TERMS, ARGUMENTS = range(3)
# No limit to a count.
UNLIMITED = 9223372036854775807

# Where the knots of a table begin in its numbers: behind the number of knots and the degree.
HEAD = 2
