"""Comparisons of linear models, whose exponents are known."""

import math
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import ArgumentError, Guard, HybridSystem, Mode, Reset, StatusCode, Transition
from lyapunov import compare, compare_models

POINTS = ({"a": 1.0}, {"a": 2.0})
SHORT = {"intervals": 20, "transient": 5}


def decay(rate, ripple=0.0):
    """Exponents ``-rate(p)`` and -3; the ripple costs steps but does not affect the exponents."""
    return HybridSystem(
        state=("x", "y"),
        parameters={"a": 1.0},
        modes=[
            Mode("only", lambda t, x, p: (ripple * np.sin(40 * np.pi * t) - rate(p) * x.x, -3.0 * x.y)),
        ],
        period=1.0,
    )


def forgetful(rate):
    """Exponents ``-rate`` and minus infinity: once per period ``y`` is set to one."""
    midway = Guard(lambda t, x, p: np.sin(2 * np.pi * (t - 0.5)), +1)
    return HybridSystem(
        state=("x", "y"),
        modes=[Mode("only", lambda t, x, p: (-rate * x.x, -x.y))],
        transitions=[Transition("only", "only", midway, Reset(lambda t, x, p: (x.x, 1.0)))],
        period=1.0,
    )


@pytest.fixture(scope="module")
def comparison():
    systems = {
        "rippled": decay(lambda p: p.a, ripple=0.1),
        "near": decay(lambda p: p.a + 0.01),
        "bent": decay(lambda p: p.a + 0.5 * (p.a - 1)),
    }
    return compare_models(systems, (1.0, 1.0), reference="rippled", points=POINTS, **SHORT)


def test_distances_are_those_of_the_exponents(comparison):
    assert comparison.status.ok
    np.testing.assert_array_equal(comparison.distance("rippled"), 0.0)
    np.testing.assert_allclose(comparison.distance("near"), 0.01, atol=1e-6)
    np.testing.assert_allclose(comparison.distance("bent"), (0.0, 0.5), atol=2e-3)
    exponents = [spectrum.exponents for spectrum in comparison.spectra["rippled"]]
    np.testing.assert_allclose(exponents, [(-1.0, -3.0), (-2.0, -3.0)], atol=1e-6)


def test_the_cheapest_within_a_tolerance_at_every_point(comparison):
    assert comparison.cost("rippled") > 2 * comparison.cost("near")
    assert comparison.within(1e-3) == ("rippled",)
    assert comparison.cheapest(1e-3) == "rippled"
    assert comparison.cheapest(0.02) == "near"
    assert set(comparison.within(0.6)) == set(comparison.spectra)
    assert comparison.names[-1] == "rippled"


def test_the_table_has_a_row_a_model_and_the_cheapest_first(comparison):
    head, *rows = str(comparison).splitlines()
    assert head.split()[:3] == ["model", "steps", "jumps"]
    assert tuple(row.split()[0] for row in rows) == comparison.names
    near = next(row.split() for row in rows if row.startswith("near"))
    assert near[1:] == [f"{comparison.cost('near'):.1f}", "0.00", "1.0e-02", "1.0e-02", "0"]
    assert repr(comparison) == f"<ModelComparison of {', '.join(comparison.names)} at 2 points>"


def test_annihilated_directions_do_not_differ():
    found = compare_models({"a": forgetful(1.0), "b": forgetful(1.25)}, (1.0, 1.0), reference="a", **SHORT)
    assert found.spectra["b"][0].exponents.min() == -math.inf
    assert found.distance("b") == pytest.approx([0.25], abs=1e-8)


def test_a_run_that_fails_is_never_within():
    wall = Guard(lambda t, x, p: x.x, direction=-1)
    chattering = HybridSystem(
        state=("x", "y"),
        modes=[Mode("flight", lambda t, x, p: (x.y, -1.0))],
        transitions=[Transition("flight", "flight", wall, Reset(lambda t, x, p: (0.0, -0.5 * x.y)))],
    )
    systems = {"sound": decay(lambda p: p.a), "chattering": chattering}
    found = compare_models(systems, (1.0, 0.0), reference="sound", interval=1.0, **SHORT)
    assert found.status.code == StatusCode.ACCUMULATION
    assert np.isnan(found.distance("chattering")).all()
    assert found.cheapest(math.inf) == "sound"
    assert str(found).splitlines()[1:][found.names.index("chattering")].split()[-3:] == ["-", "-", "1"]


def test_distances_of_spectra():
    """Exponents in any order; two of minus infinity agree, and a run that failed is at no distance."""

    def spectrum(*exponents, ok=True):
        return SimpleNamespace(exponents=np.array(exponents), status=SimpleNamespace(ok=ok))

    low = -math.inf
    assert compare._distance(spectrum(1.0, -2.0), spectrum(-1.5, 1.25)) == 0.5
    assert compare._distance(spectrum(1.0, low), spectrum(low, 0.75)) == 0.25
    assert compare._distance(spectrum(low), spectrum(low)) == 0.0
    assert compare._distance(spectrum(1.0, low), spectrum(1.0, -2.0)) == math.inf
    for ok, other in ((True, False), (False, True), (False, False)):
        assert math.isnan(compare._distance(spectrum(1.0, ok=ok), spectrum(1.0, ok=other)))


def test_arguments_that_do_not_fit(comparison):
    systems = {"a": decay(lambda p: p.a)}
    with pytest.raises(ArgumentError, match="Reference model 'b' does not exist"):
        compare_models(systems, (1.0, 1.0), reference="b")
    with pytest.raises(ArgumentError, match="points must hold at least one"):
        compare_models(systems, (1.0, 1.0), reference="a", points=())
    other = HybridSystem(state=("q",), modes=[Mode("only", lambda t, x, p: (-x.q,))])
    with pytest.raises(ArgumentError, match=r"same states; got \('x', 'y'\) in 'a', \('q',\) in 'b'"):
        compare_models({**systems, "b": other}, (1.0, 1.0), reference="a")
    with pytest.raises(ArgumentError, match="tolerance must be at least 0"):
        comparison.cheapest(-1.0)
    with pytest.raises(ArgumentError, match=r"Model 'nearer' does not exist.*Did you mean 'near'"):
        comparison.distance("nearer")


def test_the_bar_counts_the_spectra(monkeypatch):
    shown = []

    @contextmanager
    def bar(total, *_):
        shown.append(total)
        yield SimpleNamespace(update=shown.append)

    monkeypatch.setattr(compare, "progress_bar", bar)
    systems = {"one": decay(lambda p: p.a), "other": decay(lambda p: 2 * p.a)}
    compare_models(systems, (1.0, 1.0), reference="one", points=[{"a": 1.0}, {"a": 2.0}, {"a": 3.0}], **SHORT)
    assert shown == [6, *[1] * 6]
