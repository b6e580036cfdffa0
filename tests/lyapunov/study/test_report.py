"""Tables of the study for made-up results, compared letter by letter."""

import math

import numpy as np
import pytest

from lyapunov.study import report
from lyapunov.study.column import PaperColumn
from lyapunov.study.tangents import Explanation, Trap
from tests.lyapunov.study.made import STOPPED, regime

ON_THE_ORBIT = (
    "Start I   (on the periodic orbit of 7.40): 0.500 impacts per period, first exponent 1.000000 +- 0.001"
)


@pytest.fixture(autouse=True)
def exponents_of_a_second(monkeypatch):
    monkeypatch.setattr(report, "floquet_exponents", lambda orbit: np.log(np.abs(orbit.multipliers)))


def test_a_frequency_of_the_paper():
    assert report.regime_text(regime(7.40, 700)).splitlines() == [
        "omega = 7.40 rad/s: periodic; the paper: periodic, Floquet -0.056",
        "-----------------------------------------------------------------",
        "M       (7)    paper      (8)    paper  (9)   paper  (10) I    paper  (10) II  two-orbit  tapered",
        "100   50.00  -0.0580  -0.1000  -0.0580        -2.35  100.00  -0.0380   200.00    -0.2500     1.00",
        "500  250.00  -0.0310  -0.5000  -0.0430       -13.00  500.00  -0.0610  1000.00    -0.2500     5.00",
        "",
        ON_THE_ORBIT,
        "Start II  (at rest): 0.500 impacts per period, first exponent 2.000000 +- 0.002",
        "Start III (both bodies moving): 0.500 impacts per period, first exponent 3.000000 +- 0.003",
        "Spectrum from start I:   1.00000000  -2.00000000  -3.50000000",
        "Sum -4.50000000, by the sum rule -4.50000000",
        "Floquet exponents:       -0.69314718  -1.38629436  (stable orbit of one period)",
    ]


def test_other_attractors_other_orbits_and_trouble():
    given = regime(7.5, 20, impacts=(0.5, 0.44, 0.56), multipliers=(0.5, -1.25), kind="chaotic")
    given.section.status = STOPPED
    assert report.regime_text(given).splitlines() == [
        "omega = 7.50 rad/s: chaotic",
        "---------------------------",
        "M     (7)      (8)  (9)  (10) I  (10) II  two-orbit  tapered",
        "20  10.00  -0.0200        20.00    40.00    -0.2500   0.2000",
        "",
        ON_THE_ORBIT,
        "Start II  (at rest): 0.440 impacts per period, first exponent 2.000000 +- 0.002",
        "Start III (both bodies moving): 0.560 impacts per period, first exponent 3.000000 +- 0.003",
        "Start II and III leads to another attractor than start I: they coexist.",
        "Spectrum from start I:   1.00000000  -2.00000000  -3.50000000",
        "Sum -4.50000000, by the sum rule -4.50000000",
        "Floquet exponents:       -0.69314718  0.22314355  (unstable orbit of one period)",
        f"! section: {STOPPED}",
    ]
    given.orbit.status = STOPPED
    assert "Orbit of one period: none found, residual 2.0e-03." in report.regime_text(given).splitlines()


@pytest.mark.parametrize(
    ("intervals", "rows"), [(0, [1]), (1, [1]), (99, [99]), (100, [100]), (1200, [100, 500, 1000])]
)
def test_rows_are_those_of_the_paper_that_the_study_reaches(intervals, rows):
    assert report.rows_up_to(regime(7.40, intervals)) == rows


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, ""),
        (math.nan, ""),
        (0.0, "0.0000"),
        (9.99e-4, "9.99e-04"),
        (-2e-5, "-2.00e-05"),
        (1e-3, "0.0010"),
        (-0.99994, "-0.9999"),
        (1.0, "1.00"),
        (-17.444, "-17.44"),
    ],
)
def test_numbers(value, text):
    assert report.number(value) == text


def test_tangents_outside_the_error_control(tmp_path):
    truth = np.array([0.5, -1.0, -2.0, -3.0])
    trap = Trap(truth, np.array([1e-4, 1e-8]), np.stack([truth + 1e-3, truth]), np.stack([2 * truth, truth]))
    assert report.tolerance_text(trap).splitlines()[:6] == [
        "Tangent vectors outside the error control, omega = 7.40",
        "-------------------------------------------------------",
        "rtol = atol  inside: first       last  outside: first       last  their sum off by",
        "1e-04             0.501000  -2.999000        1.000000  -6.000000            -6e+00",
        "1e-08             0.500000  -3.000000        0.500000  -3.000000             0e+00",
        "exact             0.500000  -3.000000        0.500000  -3.000000",
    ]
    report.write_tolerances(tmp_path, trap)
    rows = (tmp_path / "tolerances.csv").read_text(encoding="utf-8").splitlines()
    names = [f"{side} {i}" for side in ("inside", "outside") for i in (1, 2, 3, 4)]
    assert rows[0] == ",".join(["tolerance", *names])
    np.testing.assert_allclose(
        np.loadtxt(rows[1:], delimiter=","), np.column_stack([trap.tolerances, trap.inside, trap.outside])
    )


def test_candidates_beside_the_paper(tmp_path):
    found = [
        Explanation("as it is", {7.40: -0.057, 7.46: 0.0009}),
        Explanation("best", {7.40: -0.067, 7.46: 0.0}),
    ]
    assert report.explanation_text(found).splitlines()[:6] == [
        "Last values of the paper's Benettin column, and candidate explanations",
        "----------------------------------------------------------------------",
        "                                7.40      7.46  off by",
        "the paper's Benettin column  -0.0670   -0.0091",
        "as it is                     -0.0570  9.00e-04  0.0100",
        "best                         -0.0670    0.0000  0.0091",
    ]
    report.write_explanations(tmp_path, found)
    assert (tmp_path / "explanations.csv").read_text(encoding="utf-8").splitlines() == [
        "candidate,7.4,7.46,misfit",
        f"as it is,-0.057,0.0009,{found[0].misfit}",
        f"best,-0.067,0.0,{found[1].misfit}",
    ]


@pytest.mark.parametrize(("left", "text"), [(0.0049, "Closest: best"), (0.0051, "Open: the closest")])
def test_a_candidate_that_leaves_half_of_the_disagreement_is_no_explanation(left, text):
    as_it_is = Explanation("as it is", {7.40: -0.067, 7.46: 0.0009})
    assert as_it_is.misfit == pytest.approx(0.01)
    best = Explanation("best", {7.40: -0.067, 7.46: -0.0091 + left})
    worse = Explanation("worse", {7.40: -0.067, 7.46: 0.0})
    assert report.verdict([as_it_is, worse, best]).startswith(text)
    unknown = Explanation("as it is", {7.40: -0.067})
    assert report.verdict([unknown, best]) == "A verdict needs both 7.40 and 7.46 among the frequencies."


def test_the_paper_s_column_beside_its_method():
    """Growth 1 in the first 100 periods and 2 afterwards: means 1, 1.8 and 1.9, and 2 in between."""
    growths = np.append(np.ones(100), np.full(900, 2.0))
    lines = report.column_text([PaperColumn(7.46, {"I": growths, "II": growths[:500]})]).splitlines()
    assert lines[5:11] == [
        "omega            M  paper I  ode23s I  paper II  ode23s II",
        "7.46           100   0.0220      1.00    0.0190       1.00",
        "7.46           500  -0.0050      1.80   -0.0037       1.80",
        "7.46          1000  -0.0069      1.90   -0.0067",
        "7.46    100 to 500  -0.0117      2.00   -0.0094       2.00",
        "7.46   500 to 1000  -0.0088      2.00   -0.0097",
    ]
    assert report.column_text([PaperColumn(7.46, {"I": growths[:99]})]) == (
        "The paper's Benettin column by the paper's method: needs at least 100 periods."
    )


def test_histories_are_written_up_to_the_shortest(tmp_path):
    given = regime(7.40, 3)
    given.two_orbit.telescoped = given.two_orbit.telescoped[:2]
    report.write_histories(tmp_path, given)
    rows = (tmp_path / "exponents_7.40.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0] == "M,(7),(8),(9),(10) I,(10) II,two-orbit,tapered"
    expected = [[M, M / 2, -M / 1000, math.nan, M, 2 * M, -0.25, 0.01 * M] for M in (1, 2)]
    np.testing.assert_allclose(np.loadtxt(rows[1:], delimiter=","), expected, rtol=1e-14)
