"""A part of the adversarial benchmark: random guards and random instants against exact answers."""

from fractions import Fraction

import numpy as np
import pytest

from benchmarks.adversarial.compare import Found, compare
from benchmarks.adversarial.flows import FLOWS, draw
from benchmarks.adversarial.guards import FAMILIES, random_guard
from benchmarks.adversarial.instants import compared
from benchmarks.adversarial.rules import Affine, Edge, Rules, simulate_exactly
from benchmarks.adversarial.trial import trial
from benchmarks.adversarial.truth import Composed, Scalar, all_roots

SAMPLES = 12


@pytest.mark.parametrize("index", [3, 5, 6, 13, 14, 19])
def test_random_guards_fire_once_at_every_change_of_sign(index):
    for part in trial(0, index, SAMPLES, ("Taylor", "DOP853", "RadauIIA")):
        for family, outcome in zip(part.families, part.outcomes, strict=True):
            wrong = {
                name: getattr(outcome, name)
                for name in ("missed", "invented", "doubled", "mistimed", "off_zero", "stopped")
            }
            assert not any(wrong.values()), (part.method, family, wrong, outcome.examples[:3])


@pytest.mark.parametrize("index", [0, 1, 4, 5, 8, 14])
def test_random_instants_fire_what_the_exact_rules_fire(index):
    for part in compared(0, index, 30, ("Taylor", "DOP853")):
        assert part.cases > 0
        assert part.differences == [], part.method


def composed(index, family, runs):
    rng = np.random.default_rng(index)
    flow = FLOWS[index % len(FLOWS)]
    guard = random_guard(rng, flow, "a", family)
    ranges = {**flow.parameters, **guard.parameters}
    values = {name: draw(rng, how, runs) for name, how in ranges.items()}
    return flow, Composed(Scalar(guard.text), flow.state, [Scalar(text) for text in flow.motion], values)


@pytest.mark.parametrize(("index", "family"), list(enumerate(FAMILIES)))
def test_the_truth_has_every_change_of_sign_that_dense_samples_see(index, family):
    runs = 10
    flow, guard = composed(index, family, runs)
    roots = all_roots(guard, 0.0, flow.end, runs)
    times = np.linspace(0.0, flow.end, 4001)
    for k in range(runs):
        signs = np.sign(guard.value(np.full(len(times), k), times))
        seen = times[1:][signs[1:] * signs[:-1] < 0]
        mine = roots.run == k
        assert mine.sum() >= len(seen)
        if len(seen):
            nearest = np.abs(roots.time[mine][:, None] - seen[None]).min(axis=0)
            assert nearest.max() <= times[1]
        if k not in roots.touch_run:
            assert np.all(np.diff(roots.direction[mine]) != 0)


def found_from(flow, guard, times):
    """Results of a method that is exact except for its events."""
    found = Found.empty(1, len(flow.state))
    every = guard.states(np.zeros(len(times), dtype=int), times)
    states = np.column_stack([every[name] for name in flow.state])
    last = guard.states(np.zeros(1, dtype=int), np.array([flow.end]))
    found.add(0, times, states)
    found.see(0, times, states)
    found.end(0, flow.end, np.array([last[name][0] for name in flow.state]), True)
    return found


def outcome_of(change):
    flow, guard = composed(0, "affine", 1)
    roots = all_roots(guard, 0.0, flow.end, 1)
    assert len(roots.time) >= 2
    found = found_from(flow, guard, change(roots.time))
    outcome = compare(guard, roots, found, 0, np.array([np.nan]))
    return {
        name: getattr(outcome, name)
        for name in ("missed", "invented", "doubled", "mistimed", "off_zero")
        if getattr(outcome, name)
    }


def test_planted_faults_are_counted():
    assert outcome_of(lambda times: times) == {}
    assert outcome_of(lambda times: times[1:]) == {"missed": 1}
    assert outcome_of(lambda times: np.sort(np.append(times, times[0]))) == {"doubled": 1}
    between = outcome_of(lambda times: np.sort(np.append(times, 0.5 * (times[0] + times[1]))))
    assert between == {"invented": 1, "mistimed": 1, "off_zero": 1}
    assert outcome_of(lambda times: times + 1e-6) == {
        "mistimed": len(composed_times()),
        "off_zero": len(composed_times()),
    }


def composed_times():
    flow, guard = composed(0, "affine", 1)
    return all_roots(guard, 0.0, flow.end, 1).time


def affine(constant, *coefficients, rate=0):
    return Affine(tuple(map(Fraction, coefficients)), Fraction(rate), Fraction(constant))


def test_the_exact_rules_on_a_landing_beyond_two_guards():
    # y' = 1; "raise" at y = 1 sets n = m = 1, beyond the guards of the other two.
    still = affine(0, 0, 0, 0)
    n, m = affine(0, 0, 1, 0), affine(0, 0, 0, 1)
    y = affine(0, 1, 0, 0)
    one, low = affine(1, 0, 0, 0), affine(-9, 0, 0, 0)
    rules = Rules(
        ((affine(1, 0, 0, 0), still, still),),
        (
            Edge(0, 0, affine(-1, 1, 0, 0), 1, (low, one, one), None),
            Edge(0, 0, affine(Fraction(-1, 2), 0, 1, 0), 1, (y, still, m), None),
            Edge(0, 0, affine(Fraction(-1, 2), 0, 0, 1), 1, (y, n, still), None),
        ),
    )
    run = simulate_exactly(rules, (Fraction(0), Fraction(0), Fraction(0)), 0, Fraction(2), 100)
    assert run.fired == [(1, 0), (1, 1), (1, 2)]
    assert run.x == (-8, 0, 0)
    assert run.ending == "end"


def test_the_exact_rules_on_a_loop_without_end():
    # Each reset takes y beyond the guard of the other.
    rules = Rules(
        ((affine(1, 0),),),
        (
            Edge(0, 0, affine(0, 1), 1, (affine(-1, 0),), None),
            Edge(0, 0, affine(Fraction(1, 2), 1), -1, (affine(1, 0),), None),
        ),
    )
    run = simulate_exactly(rules, (Fraction(-1, 4),), 0, Fraction(2), 100)
    assert run.ending == "stuck"
    assert [i for _, i in run.fired[:4]] == [0, 1, 0, 1]
