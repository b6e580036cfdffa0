"""Facts about a task change with everything that decides its results, and with nothing else."""

import functools
import importlib
import sys

import attrs
import numpy as np
import pytest

import hybrid
import models
from hybrid.simulation.identity import attributes_of, facts_of, model_of

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


class Owner:
    def __init__(self, value):
        self.value = value

    def task(self, p):
        return {"y": self.value}

    def other(self, p):
        return {"y": -self.value}


class Slotted:
    __slots__ = ("value",)


def circular(value):
    found = [value]
    found.append(found)
    return found


def nested(value):
    return lambda p: (lambda q: {"y": value + q["x"]})(p)


# Makers of a value from a number: the facts differ if the number does, and only then.
VALUES = {
    "number": lambda n: n,
    "text": str,
    "bytes": lambda n: bytes([n]),
    "complex number": lambda n: complex(0, n),
    "NumPy's number": np.float64,
    "short array": lambda n: np.array([0.0, n]),
    "long array": lambda n: np.append(np.zeros(50), n),
    "array of objects": lambda n: np.array([None, {"a": n}], dtype=object),
    "list": lambda n: [0, n],
    "tuple": lambda n: (0, (n,)),
    "set": lambda n: {0, n, 77, "a"},
    "frozen set": lambda n: frozenset((5, n, "b")),
    "mapping": lambda n: {"a": {"b": n}},
    "key of a mapping": lambda n: {n: 0},
    "circle": circular,
    "partial": lambda n: functools.partial(helper, a=n),
    "partial by place": lambda n: functools.partial(helper, n),
    "bound method": lambda n: Owner(n).task,
    "function": made,
    "inner function": nested,
    "default": lambda n: made(text=f"lambda p, a={n}: a"),
    "default by name": lambda n: made(text=f"lambda p, *, a={n}: a"),
    "constant in code": lambda n: made(text=f"lambda p: p['x'] + {n}"),
    "class": lambda n: (Owner, Slotted)[n - 1],
    "ufunc": lambda n: (np.sin, np.cos)[n - 1],
    "builtin": lambda n: (len, sum)[n - 1],
    "method": lambda n: (Owner(1).task, Owner(1).other)[n - 1],
    "solver": lambda n: hybrid.DOP853(rtol=10.0**-n),
    "object": Owner,
    "code": lambda n: compile(f"x + {n}", "", "eval"),
    "parameter of a model": lambda n: attrs.evolve(models.bouncing_ball(), parameters={"g": n, "e": 0.8}),
}


@pytest.mark.parametrize("name", VALUES)
def test_values_that_a_task_takes_tell_it_apart(name):
    one, again, other = (facts_of(made(VALUES[name](n))) for n in (1, 1, 2))
    assert one == again
    assert one.keys() == other.keys()
    assert {name for name in one if one[name] != other[name]} == {"'value'"}


@pytest.mark.parametrize(
    "task",
    [
        lambda n: functools.partial(helper, n),
        lambda n: functools.partial(functools.partial(helper, 0), a=n),
        lambda n: Owner(n).task,
        lambda n: made(text=f"lambda p, a={n}: a"),
        lambda n: made(text=f"lambda p, *, a={n}: a"),
        nested,
    ],
)
def test_tasks_of_all_kinds_are_told_apart(task):
    assert facts_of(task(1)) == facts_of(task(1))
    assert facts_of(task(1)) != facts_of(task(2))


def test_methods_differ_by_their_code():
    one, other = facts_of(Owner(1).task), facts_of(Owner(1).other)
    assert one["owner of the task"] == other["owner of the task"]
    assert one["code of the task"] != other["code of the task"]
    assert one["task"].endswith("Owner.task")


def test_docstrings_and_line_numbers_decide_nothing():
    texts = [
        "def f(p):\n    return {'y': 'a' + str(p)}",
        "def f(p):\n    'Words.'\n    return {'y': 'a' + str(p)}",
        "\n\ndef f(p):\n    'Other words.'\n\n    return {'y': 'a' + str(p)}",
    ]
    spaces = [{"__name__": "m"} for _ in texts]
    for text, space in zip(texts, spaces, strict=True):
        exec(text, space)
    codes = [facts_of(space["f"])["code of the task"] for space in spaces]
    assert codes[0] == codes[1] == codes[2]
    first = {"__name__": "m"}
    exec("def f(p):\n    return 'a', p", first)
    second = {"__name__": "m"}
    exec("def f(p):\n    return 'b', p", second)
    assert facts_of(first["f"]) != facts_of(second["f"])


def test_a_name_that_is_not_yet_assigned_is_left_out():
    def maker():
        def task(p):
            return later

        facts = facts_of(task)
        later = 1
        return facts, facts_of(task), later

    before, after, _ = maker()
    assert "'later'" not in before
    assert after["'later'"] == "1"


def test_a_task_may_give_its_facts():
    class Task:
        def __init__(self, n):
            self.facts = {"n": n, 3: "three"}

        def __call__(self, p):
            return {}

    assert facts_of(Task(1))["n"] == "1"
    assert facts_of(Task(1))["3"] == "'three'"
    assert "code of the task" not in facts_of(Task(1))


def test_a_dataset_says_the_facts_that_are_no_models():
    """Numbers and texts as they are, other values as JSON."""

    def task(p):
        return {}

    system = models.bouncing_ball()
    task.system = system
    task.facts = {"model": system, "steps": 3, "solver": "Taylor", "left out": None, "span": (0.0, 1.5)}
    found = attributes_of(task)
    assert {name: found.get(name) for name in task.facts} == {
        "model": system.name,
        "steps": 3,
        "solver": "Taylor",
        "left out": None,
        "span": "[0.0, 1.5]",
    }
    assert found["model_parameters"] == '{"g": 9.81, "e": 0.8}'


HELPERS = """
FACTOR = 2.0
def scaled(v):
    return FACTOR * v
class Law:
    LEVEL = 1.0
    def __call__(self, v):
        return 3.0 * v
    @property
    def half(self):
        return 0.5
"""


@pytest.mark.parametrize("used", ["helpers.scaled(p)", "helpers.Law()(p)", "law(p)", "inside"])
@pytest.mark.parametrize(
    ("edit", "counts"),
    [
        (("2.0", "2.5"), ("helpers.scaled(p)", "inside")),
        (("FACTOR * v", "-FACTOR * v"), ("helpers.scaled(p)", "inside")),
        (("3.0 * v", "4.0 * v"), ("helpers.Law()(p)", "law(p)", "inside")),
        (("0.5", "0.25"), ("helpers.Law()(p)", "law(p)", "inside")),
        (("LEVEL = 1.0", "LEVEL = 1.5"), ("helpers.Law()(p)", "law(p)", "inside")),
    ],
    ids=["a number", "a function", "a method", "a property", "a value of a class"],
)
def test_an_edit_of_a_module_that_a_task_uses_counts(tmp_path, monkeypatch, used, edit, counts):
    """A store gave back the results of the code before the edit."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def facts(text):
        (tmp_path / "helpers.py").write_text(text)
        monkeypatch.delitem(sys.modules, "helpers", raising=False)
        importlib.invalidate_caches()
        space = {"__name__": "__main__"}
        if used == "inside":
            exec("def task(p):\n    import helpers\n    return helpers.scaled(p)", space)
        else:
            exec(f"import helpers\nlaw = helpers.Law()\ndef task(p): return {used}", space)
        return facts_of(space["task"])

    before = facts(HELPERS)
    assert facts(HELPERS) == before
    assert (facts(HELPERS.replace(*edit)) != before) == (used in counts)
