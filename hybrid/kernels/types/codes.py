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

# What the next call of the driver has to do before it can step: nothing, evaluate the rates anew
# (the tangent vectors were changed from outside), or take its sides at every guard of a mode.
READY = 0
STALE = 1
ENTERING = 2
NO_TRANSITION = -1
# Instead of a transition: the state rests on the guard that has just fired.
RESTING = -2

# Slots of Run.count.
MODE = 0
CYCLE = 1
JUMPS = 2
STEPS = 3
REJECTED = 4
PHASE_OF_RUN = 5
LAST_FIRED = 6
JUMPS_HERE = 7
SINGULAR_JUMPS = 8
PENDING = 9
PREVIOUS_MODE = 10
CHATTERING = 11
CHATTER_JUMPS = 12
GRAZINGS = 13
ILL_CONDITIONED = 14
SIMULTANEOUS = 15
ORDER_MATTERED = 16
GRAZING_GUARD = 17
LAST_KIND = 18
LOCKED = 19
MAP_IS_KNOWN = 20
UNPROVED = 21
AT_REST = 22
ROUND = 23
CRAWLING = 24
INDISTINCT = 25
UNCHECKED = 26
UNRESOLVED = 27
COARSE = 28
CALM_MODE = 29
CALM_CYCLE = 30
CALM_WAIT = 31
COUNTERS = 32

# Slots of Run.clock.
PHASE = 0
NEXT_STEP = 1
LAST_JUMP_CYCLE = 2
LAST_JUMP_PHASE = 3
DIVERGENCE = 4
LOG_DETERMINANT = 5
LARGEST_SALTATION = 6
LAST_STEP = 7
LAST_RATIO = 8
ILL_CONDITIONED_GROWTH = 9
GRAZING_PLACE = 10
GRAZING_VALUE = 11
RESTITUTION = 12
LAST_TRANSVERSALITY = 13
LOG_DETERMINANT_BEFORE = 14
ILL_CONDITIONED_GROWTH_BEFORE = 15
STRAIN = 16
SINCE_ENTRY = 17
PHASE_LOW = 18
CALM_UNTIL = 19
CLOCKS = 20

# Kinds of jumps.
TRANSVERSE = 0
GRAZING = 1
LIMIT_OF_CHATTER = 2

# Target of a transition that ends the run, and limit of a chatter that names none.
NO_MODE = -1

# What a guard says of the start of a run: nothing against it, that it lies on the guard and moves beyond, or
# that it lies beyond.
NO_OBJECTION = 0
LEAVES = 1
BEYOND = 2

# Order of exact series, which no other exceeds: what the memory for series is laid out for.
HIGHEST_ORDER = 32

# Columns of series that are worked on at once, and in the widest register.
NARROW = 4
WIDE = 2 * NARROW

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

# What is known of a row of a guard's program, in the columns of ``Work.registers``: a range, a range of the
# slope, and a range of the value in the middle of a piece.
LOW = 0
HIGH = 1
LEAST_SLOPE = 2
MOST_SLOPE = 3
LOW_MIDDLE = 4
HIGH_MIDDLE = 5
REGISTERS = 6
