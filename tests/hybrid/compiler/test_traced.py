"""Results of tracing are kept on disk: a model gets its own result, never that of another model."""

import importlib.util
import json
from itertools import pairwise

import attrs
import numpy as np
import pytest

import models
from hybrid import Guard, HybridSystem, Mode, ModelError, Reset, Transition
from hybrid.compiler.cache import store
from hybrid.compiler.cache.seal import sealed, unsealed
from hybrid.compiler.cache.store import models_folder
from hybrid.compiler.emission import emitted_of
from hybrid.compiler.emit import emit
from hybrid.compiler.traced import key_of

MODELS = [
    models.ball_chain,
    models.bouncing_table,
    models.buck_converter,
    models.chua_circuit,
    models.simplest_walker,
    models.slip_hopper,
    models.vibroimpact,
]


@pytest.fixture(autouse=True)
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(tmp_path))


@pytest.fixture
def emissions(monkeypatch):
    """The systems that were traced, in order."""
    found = []

    def counted(system, traces):
        found.append(system)
        return emit(system, traces)

    monkeypatch.setattr("hybrid.compiler.emit.emit", counted)
    return found


def oscillator(field, *, jacobian=None, state=("q", "v"), parameters=("k", "c"), guard=None, **options):
    """A system with one mode and one guard."""
    return HybridSystem(
        state=state,
        parameters=dict.fromkeys(parameters, 2.0),
        modes=[Mode("swing", field, jacobian=jacobian)],
        transitions=[
            Transition(
                "swing",
                "swing",
                guard or Guard(lambda t, x, p: x[0], -1),
                options.pop("reset", Reset(lambda t, x, p: (0.0, -x[1]))),
                name="stop",
                **options,
            )
        ],
    )


def linear(t, x, p):
    return x.v, -p.k * x.q


def assert_all_differ(systems):
    keys = [key_of(system, {}) for system in systems]
    assert None not in keys
    assert len(set(keys)) == len(keys)
    for one, other in pairwise(systems):
        emitted_of(one)
        assert emitted_of(other) == emit(other)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_what_is_kept_is_what_was_emitted(model, emissions):
    first = emitted_of(model())
    assert len(emissions) == 1
    again = emitted_of(model())
    assert len(emissions) == 1
    assert again == first == emit(model())
    assert [type(each) for each in attrs.astuple(again, recurse=False)] == [
        type(each) for each in attrs.astuple(first, recurse=False)
    ]
    assert all(type(row) is tuple for row in again.programs.rows)


def test_closures():
    def field(stiffness):
        return lambda t, x, p: (x.v, -stiffness * x.q)

    assert_all_differ([oscillator(field(value)) for value in (1.0, np.nextafter(1.0, 2.0), -1.0)])


STIFFNESS = 1.0
TABLE = np.array([1.0, 2.0])


def helper(q):
    return STIFFNESS * q


def test_globals_of_a_helper(monkeypatch):
    def field(t, x, p):
        return x.v, -helper(x.q)

    one = key_of(oscillator(field), {})
    monkeypatch.setitem(globals(), "STIFFNESS", 3.0)
    other = key_of(oscillator(field), {})
    monkeypatch.setitem(globals(), "helper", lambda q: 3.0 * q * q)
    assert len({one, other, key_of(oscillator(field), {})}) == 3


def test_a_global_array_that_is_written_to(monkeypatch, emissions):
    def field(t, x, p):
        return x.v, -(TABLE * x.q).sum() - TABLE @ np.array([x.q, x.v])

    monkeypatch.setitem(globals(), "TABLE", TABLE.copy())
    system = oscillator(field)
    before = emitted_of(system)
    TABLE[1] = 5.0
    after = emitted_of(system)
    assert len(emissions) == 2
    assert after == emit(system) != before


def test_defaults():
    def field(t, x, p, k=1.0):
        return x.v, -k * x.q

    one = key_of(oscillator(field), {})
    field.__defaults__ = (2.0,)
    assert key_of(oscillator(field), {}) != one


def test_nested_functions_and_attributes():
    class Spring:
        def __init__(self, force):
            self.force = force

        def field(self, t, x, p):
            return x.v, *[(lambda q: self.force(q))(q) for q in (x.q,)]

    assert_all_differ(
        [oscillator(Spring(force).field) for force in (lambda q: -q, lambda q: -(q**3), np.sin, np.arctan)]
    )


def test_a_module_of_the_same_name_with_other_contents(tmp_path):
    def field_of(text):
        path = tmp_path / "spring.py"
        path.write_text(f"def field(t, x, p):\n    return x.v, {text}\n")
        spec = importlib.util.spec_from_file_location("spring", path)
        module = importlib.util.module_from_spec(spec)
        exec(compile(path.read_text(), str(path), "exec"), vars(module))
        return module.field

    assert_all_differ([oscillator(field_of(text)) for text in ("-x.q", "-x.v", "-p.k * x.q", "-p.c * x.q")])


def test_order_of_names():
    def field(t, x, p):
        return x.v, -p.k * x.q - p.c * x.v

    assert_all_differ([oscillator(field), oscillator(field, parameters=("c", "k"))])
    assert_all_differ(
        [
            oscillator(lambda t, x, p: (x.q, x.v), state=names, reset=None)
            for names in (("q", "v"), ("v", "q"))
        ]
    )


def test_order_of_operands():
    assert_all_differ(
        [
            oscillator(lambda t, x, p: (x.v, (x.q + x.v) + t)),
            oscillator(lambda t, x, p: (x.v, x.q - x.v)),
            oscillator(lambda t, x, p: (x.v, x.v - x.q)),
            oscillator(lambda t, x, p: (x.v, np.where(x.q > 0, x.v, x.q))),
            oscillator(lambda t, x, p: (x.v, np.where(x.q >= 0, x.v, x.q))),
            oscillator(lambda t, x, p: (x.v, np.where(x.q >= 0, x.q, x.v))),
            oscillator(lambda t, x, p: (x.v, np.maximum(x.q, 0.0))),
            oscillator(lambda t, x, p: (x.v, np.minimum(x.q, 0.0))),
        ]
    )


def test_graph():
    def position(t, x, p):
        return x.q

    plain = oscillator(linear)
    with_limit = attrs.evolve(
        plain,
        modes=[*plain.modes, Mode("rest", lambda t, x, p: (0.0, 0.0))],
        transitions=[attrs.evolve(plain.transitions[0], accumulates_to="rest")],
    )
    assert_all_differ(
        [
            plain,
            oscillator(linear, guard=Guard(position, -1)),
            oscillator(linear, guard=Guard(position, +1)),
            oscillator(linear, guard=Guard(position, +1, when=lambda t, x, p: x.v)),
            oscillator(linear, guard=Guard(position, +1, when=lambda t, x, p: -x.v)),
            oscillator(linear, reset=None),
            oscillator(linear, reset=Reset(lambda t, x, p: (x.q, x.v))),
            with_limit,
        ][1:]
    )


def test_given_derivatives():
    def jacobian(t, x, p):
        return ((0.0, 1.0), (-p.k, 0.0))

    assert_all_differ([oscillator(linear), oscillator(linear, jacobian=jacobian)])


def opaque(t, x, p):
    return (x.v, -x.q) if x.q.real > 0 else (x.v, -2.0 * x.q)


def caught(t, x, p):
    try:
        square = x.q.square(x.v)  # one argument too many for the rule
    except TypeError:
        square = STIFFNESS * x.q
    except AttributeError:
        square = x.q
    return x.v, square


def test_a_function_that_catches_what_stops_tracing_is_refused(emissions):
    with pytest.raises(ModelError, match=r"Mode 'swing': field cannot be traced, and what catches errors"):
        emitted_of(oscillator(caught))


def test_functions_that_cannot_be_traced_are_tried_each_time(emissions):
    for count in (1, 2):
        emitted_of(oscillator(opaque))
        assert len(emissions) == count


def test_a_damaged_file_is_written_anew(emissions):
    system = models.bouncing_ball()
    first = emitted_of(system)
    [path] = models_folder().glob("emitted_*.json")
    whole = path.read_bytes()
    unlike = json.loads(unsealed(path.name, whole))
    del unlike["propagators"][0]["kind"]
    others = [sealed(path.name, text.encode()) for text in ("[]", "{}", json.dumps(unlike))]
    for damaged in (b"", whole[:-20], *others):
        path.write_bytes(damaged)
        assert emitted_of(system) == first
        assert path.read_bytes() == whole
    assert len(emissions) == 6


def test_another_tracer_starts_anew(monkeypatch, emissions):
    for tracer in ("this version", "the next"):
        monkeypatch.setattr(store, "_tracer", lambda tracer=tracer: tracer)
        emitted_of(models.bouncing_ball())
    assert len(emissions) == 2
