"""Codes of the operations in an interval program; ``hybrid.compiler.bounds.program`` writes such programs.

A row of a program is ``(operation, a, b, c)``. The operands ``a``, ``b`` and ``c`` are earlier rows, counted
from the start of the program, unless the operation says otherwise.
"""

# Leaves: ``a`` is the index of a number, a parameter or a component of the state.
NUMBER = 0
PARAMETER = 1
STATE = 2
TIME = 3

# Arithmetic. The exponent of WHOLE_POWER is ``b`` itself; for FIXED_POWER it is the number with index ``b``.
SUM = 4
PRODUCT = 5
QUOTIENT = 6
WHOLE_POWER = 7
FIXED_POWER = 8

# Functions of two operands.
MAXIMUM = 9
MINIMUM = 10
ANGLE = 11
LESS = 12
LESS_EQUAL = 13
EQUAL = 14
AND = 15
OR = 16
# ``b`` if ``a`` holds, else ``c``.
SELECT = 17

# The table whose numbers begin at ``b`` behind the parameters; ``c`` is the order of its derivative.
TABLE = 18

# Functions of one operand.
EXP = 20
LOG = 21
SQRT = 22
CUBE_ROOT = 23
SIN = 24
COS = 25
TAN = 26
ASIN = 27
ACOS = 28
ATAN = 29
SINH = 30
COSH = 31
TANH = 32
ASINH = 33
ACOSH = 34
ATANH = 35
LOG1P = 36
EXPM1 = 37
ABSOLUTE = 38
FLOOR = 39
CEILING = 40
TRUNCATE = 41
ROUND = 42
SIGN = 43
STEP = 44
NOT = 45
ERF = 46
ERFC = 47
