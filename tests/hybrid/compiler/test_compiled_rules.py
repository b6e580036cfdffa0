"""What a compiled system tells of its graph, its propagators and its parameters, without compilation."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.compiler import compiled as module
from hybrid.compiler.compiled import CompiledSystem
from hybrid.compiler.emitted import Propagator, Series
from hybrid.compiler.parts import SERIES, TANGENT_SERIES, VARIATIONAL
from hybrid.errors import ArgumentError
from hybrid.kernels.types.codes import DESINGULARISED, EXACT, NO_MODE, ROOTED, RUNGE_KUTTA, TAYLOR
from hybrid.system.elements import Guard, Mode, Transition
from hybrid.system.graph import HybridSystem


def line(t, x, p):
    return x.q - p.k


def graph():
    """Three modes; the second has no transition, the third a guard of the start between two others."""

    def transition(name, source, target, **options):
        return Transition(source, target, Guard(line, +1, **options), name=name)

    return HybridSystem(
        state=("q",),
        parameters={"k": 1.0},
        modes=[Mode(name, lambda t, x, p: (-x.q,)) for name in ("a", "b", "c")],
        transitions=[
            transition("0", "a", "b"),
            transition("1", "c", "a"),
            transition("2", "c", "b", at_start=True),
            transition("3", "a", None),
            transition("4", "c", "c"),
        ],
    )


def test_transitions_that_leave_each_mode():
    first, indices = module._leaving(graph(), at_start=False)
    assert (first.tolist(), indices.tolist()) == ([0, 2, 2, 4], [0, 3, 1, 4])
    first, indices = module._leaving(graph(), at_start=True)
    assert (first.tolist(), indices.tolist()) == ([0, 0, 0, 1], [2])


def test_indices_of_modes():
    assert [module._index_or_none(graph(), name) for name in ("c", "a", None)] == [2, 0, NO_MODE]
    found = module._indices(each > 1 for each in (1, 2))
    assert (found.tolist(), found.dtype) == ([0, 1], np.dtype(np.int64))


def test_entries_of_jacobians():
    """Two modes of two states: rows with two entries, one, none and one."""
    found = module._slopes((((0, 1), (1,)), ((), (0,))))
    assert found["first_slope"].tolist() == [[0, 2, 3], [3, 3, 4]]
    assert found["slope_column"].tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize(
    ("autonomous", "guards", "resets", "timed"),
    [
        ((True, True), (False, False), (False, False), False),
        ((True, False), (False, False), (False, False), True),
        ((True, True), (False, True), (False, False), True),
        ((True, True), (False, False), (True, False), True),
    ],
)
def test_what_depends_on_time(autonomous, guards, resets, timed):
    emitted = SimpleNamespace(autonomous=autonomous, timed_guard=guards, timed_reset=resets)
    assert CompiledSystem.is_timed.fget(SimpleNamespace(emitted=emitted)) is timed


def test_modes_that_depend_on_time():
    """By their field, or by a guard that leaves them."""
    emitted = SimpleNamespace(autonomous=(True, False, True), timed_guard=(False, True, False, False, False))
    own = SimpleNamespace(emitted=emitted, system=graph())
    assert [CompiledSystem._is_timed(own, mode) for mode in range(3)] == [False, True, True]


def stub(kinds, fragile=(), steep=None):
    names = {SERIES: "series", TANGENT_SERIES: "tangent_series", VARIATIONAL: "variational_field"}
    own = SimpleNamespace(
        emitted=SimpleNamespace(
            propagators=[
                Propagator(kind, 0, "", Series(tangent_columns=8 * (1 + i))) for i, kind in enumerate(kinds)
            ],
            is_fragile=lambda mode: mode in fragile,
            steep=steep or [""] * len(kinds),
            tangent_start=100,
        ),
        functions=lambda part: {names[part]: part},
    )
    own.takes_steps = lambda kinds: CompiledSystem.takes_steps(own, kinds)
    return own


def test_which_modes_need_their_series_for_tangent_vectors():
    kinds = (DESINGULARISED, ROOTED, TAYLOR, RUNGE_KUTTA, DESINGULARISED)
    own = stub(kinds, steep=["sqrt(q)"] * 4 + [""])
    assert [CompiledSystem.needs_series(own, i) for i in range(5)] == [True, True, False, False, False]


@pytest.mark.parametrize(
    ("kinds", "fragile", "steps"),
    [
        ((TAYLOR, EXACT), (), False),
        ((TAYLOR, RUNGE_KUTTA), (), True),
        ((TAYLOR, EXACT), (1,), True),
        ((RUNGE_KUTTA, RUNGE_KUTTA), (), True),
    ],
)
def test_which_propagators_may_need_steps(kinds, fragile, steps):
    own = stub(kinds, fragile)
    assert CompiledSystem.takes_steps(own, kinds) is steps
    moving = CompiledSystem.moving(own, kinds, 0)
    series = {*kinds} != {RUNGE_KUTTA}
    assert moving == ({"series": SERIES} if series else {})
    moving = CompiledSystem.moving(own, kinds, 2)
    expected = {"series": TANGENT_SERIES} if series else {}
    assert moving == expected | ({"variational_field": VARIATIONAL} if steps else {})


@pytest.mark.parametrize(("tangents", "columns"), [(0, 100), (1, 116), (4, 116), (5, 132)])
def test_columns_of_series(tangents, columns):
    """Tangent vectors come in fours; the widest mode here needs 16 columns for four."""
    assert CompiledSystem.series_columns(stub((TAYLOR, TAYLOR)), tangents) == columns


class FakeModel:
    def __init__(self, **values):
        self.values = values

    def replace(self, **changes):
        return FakeModel(**{**self.values, **changes})

    def __getattr__(self, name):
        return self.values[name]


def with_period(period, *, proved=True, rows=()):
    """A compiled system with this period, and the values at which its period was examined."""
    system = HybridSystem(
        state=("q",),
        parameters={"k": 2.0},
        modes=[Mode("a", lambda t, x, p: (-x.q,))],
        period=period,
    )
    examined = []
    emitted = SimpleNamespace(proved_period=proved, programs=SimpleNamespace(rows=rows))
    own = SimpleNamespace(
        system=system,
        emitted=emitted,
        _model=FakeModel(period=0.0, programs=None),
        _programs=FakeModel(),
        _check_period=lambda values, period: examined.append((values.tolist(), period)),
    )
    own.at = lambda parameters, model: CompiledSystem.at(own, parameters, model)
    return own, examined


def test_a_model_at_parameters():
    own, examined = with_period(lambda p: 6.0 / p.k)
    model = CompiledSystem.model(own)
    assert (model.period, model.parameters.tolist(), model.programs) == (3.0, [2.0], None)
    assert not model.parameters.flags.writeable
    assert CompiledSystem.model(own, {"k": 4.0}).period == 1.5
    assert examined == []
    assert CompiledSystem.model(with_period(None)[0]).period == 0.0


def test_a_period_that_is_not_proved_is_examined_at_other_parameters():
    own, examined = with_period(lambda p: 6.0 / p.k, proved=False)
    CompiledSystem.model(own)
    CompiledSystem.model(own, {})
    assert examined == []
    CompiledSystem.model(own, {"k": 4.0})
    assert examined == [([4.0], 1.5)]


def test_programs_have_the_parameters_too():
    own, _ = with_period(None, rows=((0, 0, 0, 0),))
    assert CompiledSystem.model(own, {"k": 4.0}).programs.parameters.tolist() == [4.0]


def test_a_period_that_the_default_parameters_lack():
    """Runs at other parameters may have one."""
    own, _ = with_period(lambda p: 6.0 / p.k)
    moved = CompiledSystem.moved_by(own, {"series": "s"}, "kinds")
    assert (moved.period, moved.series, moved.propagator) == (3.0, "s", "kinds")

    def fails(parameters, model):
        raise ArgumentError("none")

    own.at = fails
    moved = CompiledSystem.moved_by(own, {"series": "s"}, "kinds")
    assert math.isnan(moved.period)
    assert moved.series == "s"


def test_a_model_is_taken_as_it_is_at_its_default_parameters():
    own, _ = with_period(lambda p: 6.0 / p.k)
    for period, parameters, same in ((0.0, None, True), (3.0, None, True), (math.nan, None, False)):
        model = FakeModel(period=period)
        found = CompiledSystem.given(own, parameters, model)
        assert (found is model) == same
        assert same or found.period == 3.0
    assert CompiledSystem.given(own, {"k": 3.0}, FakeModel(period=3.0)).period == 2.0


def test_how_crossings_are_found():
    emitted = SimpleNamespace(
        affine_guard=(True, False, False), is_sampled=lambda transition: transition == 1
    )
    told = [CompiledSystem._crossings_of(SimpleNamespace(emitted=emitted), i) for i in range(3)]
    assert told == [
        "affine guard, its crossings are isolated on each step",
        "guard sampled on each step: its crossings are not proved",
        "guard bounded on each step, its crossings are proved",
    ]


def test_values_at_which_the_period_was_examined_are_remembered(monkeypatch):
    monkeypatch.setattr(module, "REMEMBERED", 2)
    faults = []

    def fault(variables, functions, values, period):
        faults.append(values.tolist())
        return "no period" if values[0] < 0.0 else None

    monkeypatch.setattr(module, "period_fault", fault)
    own, _ = with_period(lambda p: 6.0 / p.k)
    own.periodic_at = set()
    for value in (1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 1.0):
        CompiledSystem._check_period(own, np.array([value]), 6.0)
    # The third value has taken the places of the first two.
    assert faults == [[1.0], [2.0], [3.0], [1.0]]
    for _ in range(2):
        with pytest.raises(ArgumentError, match="no period"):
            CompiledSystem._check_period(own, np.array([-1.0]), 6.0)
    assert faults[4:] == [[-1.0], [-1.0]]
