"""Transitions at one instant: random systems against a slow reference, and invariances."""

from functools import cache

import attrs
import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, StatusCode, Taylor, Transition, simulate
from tests.hybrid.slow_instant import Reference, Stuck

END = 5.1
# How runs end that reach their end.
ENDED = (StatusCode.SUCCESS, StatusCode.AMBIGUOUS_ORDER, StatusCode.START_BEYOND)
NAMES = ("x", "y", "a", "b", "c", "d")
# Source, target, guard (component, parameter of its place), direction, and whether it has a condition.
STRUCTURES = {
    "loops": (
        ("A", "A", (0, "g0"), +1, True),
        ("A", "A", (1, "g1"), +1, False),
        ("A", "A", (0, "g2"), -1, False),
        ("A", "A", (1, "g3"), 0, False),
    ),
    "toggle": (
        ("A", "B", (0, "g0"), +1, True),
        ("B", "A", (0, "g0"), +1, False),
        ("A", "A", (1, "g1"), +1, False),
        ("B", "B", (1, "g1"), +1, True),
    ),
    "across": (
        ("A", "B", (0, "g0"), +1, False),
        ("B", "A", (0, "g0"), -1, False),
        ("A", "A", (1, "g1"), 0, False),
        ("B", "A", (1, "g2"), -1, True),
    ),
    "both sides": (
        ("A", "B", (0, "g0"), +1, False),
        ("B", "A", (1, "g1"), +1, False),
        ("B", "B", (1, "g1"), -1, True),
        ("A", "A", (1, "g1"), +1, False),
    ),
    "ends": (
        ("A", "A", (0, "g0"), +1, False),
        ("A", "B", (1, "g1"), +1, True),
        ("B", "B", (0, "g0"), +1, False),
        ("B", None, (1, "g3"), -1, True),
    ),
}


def shift(i, x, value):
    """The reset of transition ``i``: moves or sets both components, and increments a counter."""
    x = list(x)
    x[0] = value(f"k{i}") * x[0] + value(f"r{i}")
    x[1] = value(f"k{i}") * x[1] + value(f"s{i}")
    x[2 + i] = x[2 + i] + 1
    return x


@cache
def system(name, order=(0, 1, 2, 3)):
    structure = STRUCTURES[name]
    parameters = {f"{letter}{i}": 0.0 for letter in "grskw" for i in range(4)}
    parameters |= {f"{letter}{mode}": 1.0 for letter in "uv" for mode in "AB"}

    def field(mode):
        return lambda t, x, p: (getattr(p, f"u{mode}"), getattr(p, f"v{mode}"), 0.0, 0.0, 0.0, 0.0)

    def transition(i):
        source, target, (component, place), direction, conditional = structure[i]

        def when(t, x, p):
            return x[component - 1] <= getattr(p, f"w{i}")

        return Transition(
            source,
            target,
            Guard(
                lambda t, x, p: x[component] - getattr(p, place),
                direction,
                when=when if conditional else None,
            ),
            Reset(lambda t, x, p: shift(i, x, lambda name: getattr(p, name))) if target else None,
            name=str(i),
        )

    modes = sorted({end for each in structure for end in each[:2] if end})
    return HybridSystem(
        state=NAMES,
        parameters=parameters,
        modes=[Mode(mode, field(mode)) for mode in modes],
        transitions=[transition(i) for i in order],
    )


def drawn(rng):
    """Small integers, so that guards are often reached together and resets land on them."""
    values = {f"g{i}": int(rng.integers(-2, 3)) for i in range(4)}
    for i in range(4):
        values[f"r{i}"], values[f"s{i}"] = (int(v) for v in rng.integers(-2, 3, 2))
        values[f"k{i}"] = int(rng.integers(0, 2))
        # Thresholds between integers, so that rounding decides no condition.
        values[f"w{i}"] = rng.integers(-2, 3) + 0.3
    for mode in "AB":
        values[f"u{mode}"], values[f"v{mode}"] = (int(v) for v in rng.choice([-1, 1, 2], 2))
    start = (*(int(v) for v in rng.integers(-2, 3, 2)), 0, 0, 0, 0)
    return values, start


def reference(name, values, start):
    transitions = [
        (
            source,
            target,
            (component, values[place], place),
            direction,
            lambda x, i=i, target=target: shift(i, x, values.__getitem__) if target else x,
            (lambda x, i=i, c=component: x[c - 1] <= values[f"w{i}"]) if conditional else lambda x: True,
        )
        for i, (source, target, (component, place), direction, conditional) in enumerate(STRUCTURES[name])
    ]
    velocities = {mode: (values[f"u{mode}"], values[f"v{mode}"]) for mode in "AB"}
    return Reference(velocities, transitions, start, "A", END)


@pytest.mark.as_given
@pytest.mark.parametrize("name", STRUCTURES)
def test_random_systems_beside_a_slow_reference(name):
    rng = np.random.default_rng(20)
    stuck, together = 0, 0
    for trial in range(200):
        values, start = drawn(rng)
        arc = simulate(
            system(name),
            start,
            (0.0, END),
            mode="A",
            parameters=values,
            solver=(Taylor(), DOP853())[trial % 2],
        )
        told = (trial, values, start, arc.status)
        try:
            expected = reference(name, values, start)
        except Stuck:
            stuck += 1
            assert arc.status.code == StatusCode.STUCK, told
            continue
        fired = [(jump.t, int(jump.transition)) for jump in arc.jumps]
        assert [i for _, i in fired] == [i for _, i in expected.fired], told
        np.testing.assert_allclose([t for t, _ in fired], [float(t) for t, _ in expected.fired], atol=1e-12)
        np.testing.assert_allclose(arc.x[-1], [float(v) for v in expected.x], atol=1e-12)
        together += len({t for t, _ in fired}) < len(fired)
        if expected.mode is None:
            assert arc.status.code == StatusCode.TERMINAL
        else:
            assert arc.status.code in ENDED, told
            assert arc.mode[-1] == expected.mode
    # Check that many of the drawn transitions fire together.
    assert together + stuck > 12


@pytest.mark.as_given
@pytest.mark.parametrize("name", STRUCTURES)
def test_splitting_a_run_between_events_changes_nothing(name):
    """Runs with refused crossings and with guards that the state has passed are included."""
    rng = np.random.default_rng(21)
    for _ in range(40):
        values, start = drawn(rng)
        whole = simulate(system(name), start, (0.0, END), mode="A", parameters=values)
        if whole.status.code not in ENDED:
            continue
        middle = 0.3 + rng.integers(0, 5)
        if np.any(np.abs(whole.jumps.t - middle) < 1e-6):
            continue
        first = simulate(system(name), start, (0.0, middle), mode="A", parameters=values)
        second = simulate(
            system(name), first.x[-1], (middle, END), mode=str(first.mode[-1]), parameters=values
        )
        fired = [jump.transition for arc in (first, second) for jump in arc.jumps]
        assert fired == [jump.transition for jump in whole.jumps], (values, start)
        np.testing.assert_allclose(second.x[-1], whole.x[-1], atol=1e-12)


def up(source, target, guard, reset, name, direction=+1, when=None):
    return Transition(source, target, Guard(guard, direction, when=when), Reset(reset), name=name)


def fired(arc):
    return [jump.transition for jump in arc.jumps]


def test_a_flow_cut_by_identities_changes_nothing():
    """Passed, refused and pending guards, in copies of one mode joined by identity transitions."""

    def counting(mode):
        return [
            up(
                mode,
                mode,
                lambda t, x, p: x.q - 0.3,
                lambda t, x, p: (x.q, x.v, x.n + 1),
                f"n {mode}",
                when=lambda t, x, p: x.v < 0.8,
            ),
            up(
                mode,
                mode,
                lambda t, x, p: x.q + 0.2,
                lambda t, x, p: (x.q, 0.97 * x.v, x.n),
                f"kick {mode}",
                -1,
            ),
        ]

    field = Mode("a", lambda t, x, p: (x.v, -x.q, 0.0))
    whole = HybridSystem(state=("q", "v", "n"), modes=[field], transitions=counting("a"))
    cut = HybridSystem(
        state=("q", "v", "n"),
        modes=[field, attrs.evolve(field, name="b")],
        transitions=[
            *counting("a"),
            *counting("b"),
            Transition("a", "b", Guard(lambda t, x, p: x.v + 0.1 * x.q, -1), name="cut"),
            Transition("b", "a", Guard(lambda t, x, p: x.v + 0.1 * x.q, -1), name="back"),
        ],
    )
    for v0 in (0.9, 1.3, 1.7):
        arcs = [simulate(each, (0.0, v0, 0.0), (0.0, 40.0), mode="a") for each in (whole, cut)]
        smooth = [[jump.t for jump in arc.jumps if jump.transition not in ("cut", "back")] for arc in arcs]
        assert len(arcs[1].jumps) > len(arcs[0].jumps) > 5
        np.testing.assert_allclose(smooth[0], smooth[1], atol=1e-8)
        np.testing.assert_allclose(arcs[0].x[-1], arcs[1].x[-1], atol=1e-8)


def test_the_order_of_transitions_that_do_not_meet_does_not_matter():
    rng = np.random.default_rng(5)
    for _ in range(20):
        values, start = drawn(rng)
        # Places without other guards, which no reset reaches.
        values |= {f"g{i}": 0.37 + 0.11 * i for i in range(4)}
        arcs = [
            simulate(system("loops", order), start, (0.0, END), mode="A", parameters=values)
            for order in ((0, 1, 2, 3), (3, 2, 1, 0))
        ]
        if len(set(arcs[0].jumps.t)) < len(arcs[0].jumps):
            continue
        assert fired(arcs[0]) == fired(arcs[1])
        np.testing.assert_allclose(arcs[0].x[-1], arcs[1].x[-1], atol=1e-12)
