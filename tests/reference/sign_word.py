"""The sign word of a guard on a path: which signs it certainly has, and where errors hide them.

A path gives each component of the state as a polynomial in ``s`` on ``[0, length]``, with one error radius.
On a path a guard reads as a word over ``-1, 0, 1``: a certain sign, or 0 where errors hide it. ``-1 0 1`` is
a crossing, ``-1 0 -1`` a touch, and a word that ends with 0 belongs to a guard that is at rest.

This is the plain definition, in floating-point intervals: the kernels, which ask much less of each piece,
are compared with it. A *jet* is what is known of a subexpression of the guard on a piece: its value and its
slope in the middle; its slope, its second derivative and its range on the piece.
"""

import math

import attrs

EPSILON = 2.0**-52
SAFE = 4.0 * EPSILON
# The shortest piece, as a share of the path, and how much wider than its rounding a hidden guard may range.
FINEST = 2.0**-40
WITHIN_ROUNDING = 4.0


def rounded(low, high):
    return low - 2.0 * EPSILON * abs(low), high + 2.0 * EPSILON * abs(high)


def add(a, b):
    return rounded(a[0] + b[0], a[1] + b[1])


def multiply(a, b):
    products = [x * y if x and y else 0.0 for x in a for y in b]
    return rounded(min(products), max(products))


def negative(a):
    return -a[1], -a[0]


def common(a, b):
    """The intersection of two enclosures of one number; rounding may leave none."""
    low, high = max(a[0], b[0]), min(a[1], b[1])
    return (low, high) if low <= high else a


def cosine(a):
    if a[1] - a[0] >= 2.0 * math.pi:
        return -1.0, 1.0
    low, high = sorted((math.cos(a[0]), math.cos(a[1])))
    turn = math.ceil(a[0] / math.pi)
    while turn * math.pi <= a[1]:
        low, high = (low, 1.0) if turn % 2 == 0 else (-1.0, high)
        turn += 1
    return max(low - SAFE, -1.0), min(high + SAFE, 1.0)


def sine(a):
    return cosine((a[0] - 0.5 * math.pi, a[1] - 0.5 * math.pi))


def exponential(a):
    return rounded(math.exp(max(a[0], -700.0)), math.exp(min(a[1], 700.0)))


@attrs.frozen
class Jet:
    """What is known of a subexpression on a piece of ``half`` its length."""

    value: tuple
    rate: tuple
    slope: tuple
    bend: tuple
    half: float

    @property
    def slopes(self):
        around = add(self.rate, multiply(self.bend, (-self.half, self.half)))
        return common(self.slope, around)

    @property
    def range(self):
        half = self.half
        first = add(self.value, multiply(self.slopes, (-half, half)))
        second = add(self.value, multiply(self.rate, (-half, half)))
        return common(first, add(second, multiply(self.bend, (0.0, 0.5 * half * half))))

    def _of(self, other):
        if isinstance(other, Jet):
            return other
        return Jet((other, other), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), self.half)

    def __add__(self, other):
        o = self._of(other)
        return Jet(
            add(self.value, o.value),
            add(self.rate, o.rate),
            add(self.slopes, o.slopes),
            add(self.bend, o.bend),
            self.half,
        )

    def __neg__(self):
        return self * -1.0

    def __sub__(self, other):
        return self + -self._of(other)

    def __rsub__(self, other):
        return -self + other

    def __mul__(self, other):
        o = self._of(other)
        bend = add(multiply(self.bend, o.range), multiply(self.range, o.bend))
        return Jet(
            multiply(self.value, o.value),
            add(multiply(self.rate, o.value), multiply(self.value, o.rate)),
            add(multiply(self.slopes, o.range), multiply(self.range, o.slopes)),
            add(bend, multiply((2.0, 2.0), multiply(self.slopes, o.slopes))),
            self.half,
        )

    __radd__, __rmul__ = __add__, __mul__

    def through(self, function, first, second):
        """A function of a jet, by its range and those of its first two derivatives."""
        bend = multiply(second(self.range), multiply(self.slopes, self.slopes))
        return Jet(
            function(self.value),
            multiply(first(self.value), self.rate),
            multiply(first(self.range), self.slopes),
            add(bend, multiply(first(self.range), self.bend)),
            self.half,
        )

    def sin(self):
        return self.through(sine, cosine, lambda a: negative(sine(a)))

    def exp(self):
        return self.through(exponential, exponential, exponential)

    def __abs__(self):
        low, high = self.range
        if low >= 0.0:
            return self
        if high <= 0.0:
            return -self
        least, most = self.value
        value = (0.0, max(-least, most)) if least < 0.0 < most else tuple(sorted((abs(least), abs(most))))
        steepest = max(map(abs, self.slopes))
        return Jet(value, (-steepest, steepest), (-steepest, steepest), (-math.inf, math.inf), self.half)


@attrs.frozen
class Path:
    """Coefficients of each component by power, the error of each, and the length."""

    powers: tuple
    errors: tuple
    length: float

    def jets(self, low, high):
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return [self._jet(c, e, middle, half) for c, e in zip(self.powers, self.errors, strict=True)]

    @staticmethod
    def _jet(coefficients, error, middle, half):
        high, value, slope, bend, third, size = middle + half, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(len(coefficients) - 1, -1, -1):
            c = coefficients[k]
            third = third * high + abs(c) * k * (k - 1) * (k - 2) if k > 2 else third
            bend, slope, value = bend * middle + 2.0 * slope, slope * middle + value, value * middle + c
            size = size * high + abs(c)
        off = SAFE * size + error
        steep = abs(bend) * half + 0.5 * third * half * half + off
        return Jet(
            (value - off, value + off),
            (slope - off, slope + off),
            (slope - steep, slope + steep),
            (bend - third * half - off, bend + third * half + off),
            half,
        )


def sign(interval):
    """The sign of all numbers of an interval, 0 if it has none."""
    return 1 if interval[0] > 0.0 else -1 if interval[1] < 0.0 else 0


def sign_at(guard, path, place):
    return sign(guard(*path.jets(place, place)).value)


def _place_of(guard, path, low, high, still):
    """The last place of a piece at which ``still`` holds of the sign there; it does at ``low``."""
    while high - low > SAFE * high:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if still(sign_at(guard, path, middle)):
            low = middle
        else:
            high = middle
    return high


def _turn(guard, path, low, high):
    """Where the slope is zero on a piece on which it is monotone; an end of the piece if it is nowhere."""
    while high - low > SAFE * high:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        at = guard(*path.jets(middle, middle))
        if sum(at.rate) * sum(at.bend) < 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _monotone(guard, path, low, high):
    """The letters of a piece on which the guard is monotone: the signs at its ends tell all."""
    first, last = sign_at(guard, path, low), sign_at(guard, path, high)
    yield low, first
    if first != 0 and last != first:
        yield _place_of(guard, path, low, high, lambda s: s == first), 0
    if last != 0 and last != first:
        yield _place_of(guard, path, low, high, lambda s: s != last), last


def _letters(guard, path):
    stack = [(0.0, path.length)]
    while stack:
        low, high = stack.pop()
        jet = guard(*path.jets(low, high))
        if sign(jet.range) != 0:
            yield low, sign(jet.range)
        elif sign(jet.slopes) != 0:
            yield from _monotone(guard, path, low, high)
        elif sign(jet.bend) != 0:
            turn = _turn(guard, path, low, high)
            for a, b in ((low, turn), (turn, high)):
                if a < b:
                    yield from _monotone(guard, path, a, b)
        else:
            width, hidden = jet.range[1] - jet.range[0], jet.value[1] - jet.value[0]
            if high - low <= FINEST * path.length or width <= WITHIN_ROUNDING * hidden:
                yield low, 0
            else:
                middle = 0.5 * (low + high)
                stack += [(middle, high), (low, middle)]


def sign_word(guard, path):
    """The letters ``[(start, sign)]`` of a guard, a function of jets, on a path. No sign is lost."""
    word = []
    for place, letter in _letters(guard, path):
        if not word or word[-1][1] != letter:
            word.append((place, letter))
    return word


@attrs.frozen
class Event:
    """A guard that is hidden between two places, and has certain signs before and behind."""

    begin: float
    end: float
    before: int
    behind: int

    @property
    def crosses(self):
        return self.before != self.behind


def events(word):
    """The crossings and touches in a word."""
    return [
        Event(begin, end, before, behind)
        for (_, before), (begin, letter), (end, behind) in zip(word, word[1:], word[2:], strict=False)
        if letter == 0 and before != 0 and behind != 0
    ]
