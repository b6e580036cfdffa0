"""The mode that a run starts in: the only one, the one that the system names, or that of the guards."""

import pickle

import attrs
import numpy as np
import pytest

import hybrid
import lyapunov
from hybrid import Guard, HybridSystem, Mode, ModelError, Transition, simulate, split


def two_springs(**options):
    """Two linear modes; a guard at q = 5 in each, so that both allow no start at q = 1."""
    return HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("soft", lambda t, x, p: (x.v, -x.q)),
            Mode("stiff", lambda t, x, p: (x.v, -4.0 * x.q)),
        ],
        transitions=[
            Transition("soft", "stiff", Guard(lambda t, x, p: x.q - 5, direction=+1), name="touch"),
            Transition("stiff", "soft", Guard(lambda t, x, p: x.v - 50, direction=+1), name="leave"),
        ],
        **options,
    )


def test_a_run_without_a_name_starts_where_the_system_says():
    with pytest.raises(ModelError, match=r"more than one mode: soft, stiff. .*HybridSystem\(start="):
        simulate(two_springs(), (1.0, 0.0), (0.0, 1.0))
    for start, frequency in (("soft", 1.0), ("stiff", 2.0)):
        arc = simulate(two_springs(start=start), (1.0, 0.0), (0.0, 1.0))
        assert arc.mode[0] == start
        assert arc["q"][-1] == pytest.approx(np.cos(frequency))
    named = simulate(two_springs(start="stiff"), (1.0, 0.0), (0.0, 1.0), mode="soft")
    assert named.mode[0] == "soft"


def test_an_unknown_start_is_refused():
    with pytest.raises(
        ModelError, match=r"start mode 'stif' does not exist. Modes: soft, stiff. Did you mean"
    ):
        two_springs(start="stif")


def test_the_start_survives_changes_copies_and_pickling():
    system = two_springs(start="stiff")
    assert "start: 'stiff'" in repr(system)
    assert attrs.evolve(system, name="springs").start == "stiff"
    # The functions of this system cannot be pickled, so it is made of some that can.
    plain = HybridSystem(
        state=1,
        modes=[Mode("a", identity), Mode("b", identity)],
        start="b",
        transitions=[Transition("a", "b", Guard(first, +1)), Transition("b", "a", Guard(first, -1))],
    )
    assert pickle.loads(pickle.dumps(plain)).start == "b"


def identity(t, x, p):
    return x


def first(t, x, p):
    return x[0]


def test_every_analysis_begins_there():
    system, x0 = two_springs(start="stiff", period=2 * np.pi), (1.0, 0.0)
    assert hybrid.simulate_many(system, [x0], (0.0, 1.0)).mode_end.values.tolist() == ["stiff"]
    assert set(hybrid.stroboscopic_section(system, x0, periods=2).mode) == {"stiff"}
    assert hybrid.periodic_orbit(system, x0).mode == "stiff"
    assert lyapunov.lyapunov_spectrum(system, x0, intervals=2, transient=0).mode == "stiff"
    chart = lyapunov.chart(system, {"q": [1.0, 2.0]}, x0, intervals=2, transient=0, executor=1)
    assert chart.mode_end.values.tolist() == ["stiff", "stiff"]
    crossings = hybrid.poincare_section(system, x0, Guard(lambda t, x, p: x.q, direction=-1), points=1)
    assert crossings.t == pytest.approx([np.pi / 4])


def test_the_start_of_a_split_system_is_the_part_that_the_state_lies_in():
    system = HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("free", lambda t, x, p: (x.v, 0.0)),
            Mode("rough", lambda t, x, p: (x.v, -np.sign(x.v))),
        ],
        transitions=[
            Transition("free", "rough", Guard(lambda t, x, p: x.q - 5, direction=+1)),
            Transition("rough", "free", Guard(lambda t, x, p: x.q + 5, direction=-1)),
        ],
        start="rough",
    )
    parts = split(system)
    assert parts.start == "rough"
    assert [simulate(parts, (0.0, v), (0.0, 0.1)).mode[0] for v in (1.0, -1.0, 0.0)] == [
        "rough: v>0", "rough: v<0", "rough: v=0",
    ]  # fmt: skip


def test_a_filippov_system_may_name_its_start():
    fields = {"below": lambda t, x, p: (-1.0,), "above": lambda t, x, p: (1.0,)}
    apart = hybrid.filippov(("q",), {}, **fields, switching=lambda t, x, p: x.q, start="above")
    assert simulate(apart, (0.0,), (0.0, 1.0)).x[-1] == pytest.approx([1.0])


def test_a_start_beyond_a_guard_is_told_wherever_a_run_is_looked_at():
    ball = two_springs(start="soft")
    arc = simulate(ball, (6.0, 0.0), (0.0, 0.1))
    assert repr(arc).startswith(
        "<HybridArc t = 0 to 0.1, 0 jumps, START_BEYOND: The start lies beyond the guard of 'touch'"
    )
    assert "lies beyond the guard of 'touch'" in str(arc.status)
    spectrum = lyapunov.lyapunov_spectrum(ball, (6.0, 0.0), intervals=1, transient=0, interval=0.1)
    assert "START_BEYOND" in repr(spectrum)
    chart = lyapunov.chart(ball, {"q": [1.0, 6.0]}, (0.0, 0.0), intervals=1, transient=0, interval=0.1)
    assert ["lies beyond" in message for message in chart.message.values] == [False, True]


def test_the_only_mode_is_the_start_even_beyond_its_guard():
    only = HybridSystem(
        state=("q",),
        modes=[Mode("m", lambda t, x, p: (1.0,))],
        transitions=[Transition("m", None, Guard(lambda t, x, p: x.q - 1, direction=+1), name="end")],
    )
    arc = simulate(only, (2.0,), (0.0, 1.0))
    assert arc.status.code.name == "START_BEYOND"
    assert arc.x[-1, 0] == pytest.approx(3.0, rel=1e-14)
    assert "The start lies beyond the guard of 'end'" in arc.status.message
