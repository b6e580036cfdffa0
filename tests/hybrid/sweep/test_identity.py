"""Facts about a task change with everything that decides its results, and with nothing else."""

import functools

import numpy as np

import models
from hybrid.sweep.identity import facts_of, model_of

FACTOR = 2.0


def made(value=1.0, system=None, text="lambda p: {'y': p['x'] * value}"):
    return eval(text, {"value": value, "system": system})


def helped(p):
    return helper(p)


def helper(p):
    return {"y": FACTOR * p["x"]}


def test_equal_tasks_have_equal_facts():
    assert facts_of(made()) == facts_of(made())
    assert facts_of(made(np.arange(100.0))) == facts_of(made(np.arange(100.0)))
    assert facts_of(made(models.bouncing_ball())) == facts_of(made(models.bouncing_ball()))


def test_differences_are_named():
    def differing(one, other):
        one, other = facts_of(one), facts_of(other)
        return {name for name in one.keys() | other.keys() if one.get(name) != other.get(name)}

    assert differing(made(1.0), made(2.0)) == {"'value'"}
    assert differing(made(np.arange(100.0)), made(np.arange(100.0) + 1e-12)) == {"'value'"}
    assert differing(made(models.bouncing_ball()), made(models.impact_oscillator())) == {"'value'"}
    assert differing(made(), made(text="lambda p: {'y': p['x'] + value}")) == {"code of the task"}
    one, other = functools.partial(helper, a=1), functools.partial(helper, a=2)
    assert differing(one, other) == {"'a'"}


def test_functions_that_a_task_calls_count(monkeypatch):
    before = facts_of(helped)
    monkeypatch.setitem(globals(), "FACTOR", 3.0)
    assert facts_of(helped) != before


def test_the_model_of_a_task():
    ball = models.bouncing_ball()
    assert model_of(lambda p: ball) is ball
    assert model_of(helper) is None
