"""Systems with many modes are made in stages: which modes there are, and what a run needs of them."""

import numpy as np
import pytest

from hybrid import HybridSystem, Mode, ModelError, from_equations, simulate, split
from hybrid.transform import splitter


def kinks(most, monkeypatch):
    """Four modes, between which nothing jumps."""
    monkeypatch.setattr(splitter, "MOST_WHOLE", most)
    return from_equations(
        lambda t, x, p: (x.v, -2.0 * x.q - np.abs(x.q) - 0.5 * np.abs(x.v)), state=("q", "v")
    )


ALL = {"q<0, v<0", "q<0, v>0", "q>0, v<0", "q>0, v>0"}


@pytest.mark.parametrize(("most", "count"), [(12, 4), (4, 4), (3, 1), (1, 1)])
def test_a_small_system_is_made_as_a_whole(most, count, monkeypatch):
    system = kinks(most, monkeypatch)
    assert len(system.modes) == count
    assert (system.growth is None) == (count == 4)
    if count == 4:
        assert set(system.mode_names) == ALL
        assert all(each.target is not None for each in system.transitions)


def test_modes_are_made_where_a_run_needs_them(monkeypatch):
    whole, staged = kinks(4, monkeypatch), kinks(3, monkeypatch)
    growth = staged.growth
    [first] = staged.mode_names
    onward = [each.name for each in staged.transitions]
    assert [each.target for each in staged.transitions] == [None, None]
    assert [growth.leads_on(name) for name in onward] == [True, True]
    assert not growth.leads_on("no such")
    assert set(growth.frontier) == set(onward)
    # A mode and its neighbours, not the one across.
    growth.extend(onward[0], (0.0, np.zeros(2), np.empty(0)), onward)
    assert len(growth.current.modes) == 2
    arc = simulate(staged, (1.0, 0.0), (0.0, 6.0))
    expected = simulate(whole, (1.0, 0.0), (0.0, 6.0))
    assert arc.status.ok
    np.testing.assert_array_equal(arc.jumps.t, expected.jumps.t)
    np.testing.assert_array_equal(arc.x[-1], expected.x[-1])
    assert set(growth.current.mode_names) == ALL
    assert growth.current.mode_names[0] == first
    assert growth.current is growth.current


def test_a_start_makes_its_own_mode(monkeypatch):
    staged = kinks(1, monkeypatch)
    growth = staged.growth
    signs = {name: np.array([0.5 if part == ">" else -0.5 for part in (name[1], name[6])]) for name in ALL}
    # Points on a surface count as above it.
    signs["q>0, v>0"][:] = 0.0
    made = set(staged.mode_names)
    for name, x in signs.items():
        assert growth.place(0.0, x, np.zeros(0), None) == (name not in made)
        made.add(name)
        assert set(growth.current.mode_names) == made
        assert not growth.place(0.0, x, np.zeros(0), None)


def test_a_part_with_other_values_than_the_field_is_refused(monkeypatch):
    true = splitter.evaluate

    def off(variables, function, t, x, parameters):
        values = true(variables, function, t, x, parameters)
        return values * (1.0 + share) if not hasattr(function, "__name__") else values

    def system():
        return split(HybridSystem(state=("q",), modes=[Mode("m", lambda t, x, p: (1.0 - np.sign(x.q),))]))

    monkeypatch.setattr(splitter, "evaluate", off)
    share = 5e-10
    system()
    share = 2e-9
    with pytest.raises(ModelError, match="of mode 'm' has other values than its field"):
        system()
