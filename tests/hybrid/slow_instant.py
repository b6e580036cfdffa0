"""A slow reference for the transitions at one instant, with constant fields and exact fractions.

A transition is ``(source, target, guard, direction, reset, when)`` with ``guard = (component, place, name)``
for the guard ``x[component] - place``; guards with one name are the same. ``reset(x)`` and ``when(x)`` are
functions.
"""

from fractions import Fraction

MOST_AT_ONCE = 2000


class Stuck(Exception):
    """The transitions repeat endlessly."""


class Reference:
    """One run: ``fired`` lists times and indices of transitions, ``x`` and ``mode`` are the end."""

    def __init__(self, velocities, transitions, x, mode, end, most=10_000):
        self.velocities, self.transitions = velocities, transitions
        self.x, self.mode, self.t = [Fraction(v) for v in x], mode, Fraction(0)
        self.fired = []
        self.side, self.due, self.zero = {}, set(), set()
        for i in self.watched():
            now = self.now(i)
            direction = transitions[i][3]
            if self.value(i) == 0 and direction and now == direction:
                self.due.add(i)
            self.side[i] = now
            if self.value(i) == 0:
                self.zero.add(i)
        self.fire_all()
        while self.mode is not None and len(self.fired) < most:
            step = self.next_crossing(end)
            if step is None:
                break
            self.flow(step)
            self.due = {
                i
                for i in self.watched()
                if self.value(i) == 0 and self.transitions[i][3] in (0, self.speed(i) > 0 or -1)
            }
            for i in self.watched():
                self.side[i] = self.now(i)
            self.zero = {i for i in self.watched() if self.value(i) == 0}
            self.fire_all()
        if self.mode is not None and len(self.fired) < most:
            self.flow(end - self.t)

    def watched(self):
        return [i for i, each in enumerate(self.transitions) if each[0] == self.mode]

    def value(self, i):
        component, place, _ = self.transitions[i][2]
        return self.x[component] - place

    def speed(self, i):
        return self.velocities[self.mode][self.transitions[i][2][0]]

    def now(self, i):
        """Side of the guard from now on."""
        value = self.value(i) or self.speed(i)
        return 1 if value > 0 else -1

    def flow(self, step):
        self.t += step
        self.x = [a + step * v for a, v in zip(self.x, self.velocities[self.mode], strict=False)] + self.x[
            len(self.velocities[self.mode]) :
        ]

    def next_crossing(self, end):
        steps = []
        for i in self.watched():
            step = -self.value(i) / Fraction(self.speed(i))
            fires = self.transitions[i][3] in (0, 1 if self.speed(i) > 0 else -1)
            if step > 0 and fires and self.t + step <= end:
                steps.append(step)
        return min(steps, default=None)

    def fire_all(self):
        here = 0
        while self.mode is not None:
            ready = [i for i in self.watched() if i in self.due and self.transitions[i][5](self.x)]
            if not ready:
                self.due = set()
                return
            here += 1
            if here > MOST_AT_ONCE:
                raise Stuck
            self.fire(ready[0])

    def fire(self, i):
        source, target, _, _, reset, _ = self.transitions[i]
        self.fired.append((self.t, i))
        self.due.discard(i)
        self.x = [Fraction(v) for v in reset(self.x)]
        self.mode = target
        if target is None:
            return
        watched = self.watched()
        if target != source:
            known = {}
            for j in watched:
                same = [k for k, each in enumerate(self.transitions) if self.is_same(k, j, source)]
                if same:
                    alike = [k for k in same if self.transitions[k][3] == self.transitions[j][3]]
                    pending = bool(alike) and all(k in self.due for k in alike)
                    known[j] = (self.side[same[0]], pending, same[0] in self.zero)
            self.due = {j for j in known if known[j][1]}
            self.zero = {j for j in known if known[j][2]}
            for j in watched:
                self.side[j] = known[j][0] if j in known else None
        for j in watched:
            self.look(j, j == i and target == source)

    def is_same(self, k, j, source):
        return self.transitions[k][0] == source and self.transitions[k][2] == self.transitions[j][2]

    def look(self, j, own):
        """Update the guard of a transition after a reset."""
        direction = self.transitions[j][3]
        before, now, on, was_on = self.side[j], self.now(j), self.value(j) == 0, j in self.zero
        due = j in self.due
        if direction == 0:
            due = not due and not own if before is not None and now != before else due and now == before
        elif now != direction:
            due = False
        elif on and not was_on:
            due = True
        elif own:
            due = False
        elif before is None:
            others = [
                each[3]
                for each in self.transitions
                if each[0] == self.mode and each[2] == self.transitions[j][2]
            ]
            due = all(other == direction for other in others)
        elif before == -direction:
            due = True
        self.side[j] = now
        (self.due.add if due else self.due.discard)(j)
        (self.zero.add if on else self.zero.discard)(j)
