"""A short run of the study from its command line."""

import csv
from contextlib import redirect_stdout
from io import StringIO

import pytest

from lyapunov.__main__ import main
from lyapunov.study import report
from lyapunov.study.tangents import Explanation


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Folder of a short study of all three regimes, and what it prints."""
    folder = tmp_path_factory.mktemp("study") / "new"
    options = ["--intervals", "50", "--transient", "60", "--solver", "DOP853", "--rtol", "1e-8"]
    with redirect_stdout(StringIO()) as printed:
        assert main([*options, "--output", str(folder)]) == 0
    return folder, printed.getvalue()


@pytest.fixture
def short(study):
    return study[0]


def test_it_writes_what_it_says(short):
    expected = {"regimes.png", "diagram.png", "tolerances.png", "tolerances.csv", "explanations.csv"}
    for omega in ("7.40", "7.46", "7.92"):
        expected |= {f"exponents_{omega}.csv", f"portrait_{omega}.png", f"convergence_{omega}.png"}
    assert {path.name for path in short.iterdir()} == expected
    assert all(path.stat().st_size > 0 for path in short.iterdir())


def test_histories_have_a_row_a_period(short):
    with (short / "exponents_7.40.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["M"]) for row in rows] == list(range(1, 51))
    assert float(rows[-1]["(8)"]) == pytest.approx(float(rows[-1]["(7)"]))


def test_the_trap_is_in_the_table(short):
    with (short / "tolerances.csv").open(encoding="utf-8") as file:
        rows = {row["tolerance"]: row for row in csv.DictReader(file)}
    loose = rows["1e-08"]
    assert float(loose["inside 1"]) == pytest.approx(-0.0548936, abs=1e-3)
    assert abs(float(loose["outside 1"]) + 0.0548936) > 0.01
    total = sum(float(loose[f"outside {i}"]) for i in range(1, 5))
    assert total == pytest.approx(-0.8995392, abs=1e-6)


def test_it_prints_tables_and_names_the_folder(study):
    folder, printed = study
    assert "50 periods after 60, DOP853 at rtol = 1e-08" in printed
    for omega in ("7.40", "7.46", "7.92"):
        assert f"omega = {omega} rad/s" in printed
    assert "impacts per period" in printed
    assert str(folder) in printed


def test_bad_values_end_with_a_message(tmp_path, capsys):
    assert main(["--intervals", "0", "--output", str(tmp_path)]) == 2
    assert "intervals must be a whole number of at least 1" in capsys.readouterr().err
    assert main(["--rtol", "-1", "--output", str(tmp_path)]) == 2
    assert "rtol must be positive" in capsys.readouterr().err


def test_help_explains(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    printed = capsys.readouterr().out
    for word in ("--omega", "--intervals", "--rtol", "--solver", "--output", "Floquet", "Benettin"):
        assert word in printed


def test_the_verdict_may_be_that_the_question_is_open():
    as_it_is = Explanation("as it is", {7.40: -0.055, 7.46: 0.0})
    poor = Explanation("poor", {7.40: -0.055, 7.46: -0.009})
    good = Explanation("good", {7.40: -0.066, 7.46: -0.010})
    assert report.verdict([as_it_is, poor]).startswith("Open: the closest candidate, poor")
    assert report.verdict([as_it_is, poor, good]).startswith("Closest: good")
    elsewhere = Explanation("as it is", {7.50: 0.03})
    assert report.verdict([elsewhere]) == "A verdict needs both 7.40 and 7.46 among the frequencies."


def test_the_verdict_says_whether_the_method_is_the_paper_s():
    as_it_is = Explanation("as it is", {7.40: -0.055, 7.46: 0.0})
    same = Explanation("(e) ode23s", {7.40: -0.066, 7.46: -0.008}, papers_method=True)
    other = Explanation("(b) loose", {7.40: -0.066, 7.46: -0.013})
    assert "It is the paper's method" in report.verdict([as_it_is, same, other])
    assert "replace the paper's ode23s" in report.verdict([as_it_is, other])


def test_the_paper_s_method_is_among_the_candidates(short):
    with (short / "explanations.csv").open(encoding="utf-8") as file:
        rows = {row["candidate"]: row for row in csv.DictReader(file)}
    assert sum(name.startswith("(e) ode23s") for name in rows) == 5
    defaults, tight = rows["(e) ode23s, 1e-03, 1e-06"], rows["(e) ode23s, 1e-06, 1e-08"]
    assert float(defaults["7.4"]) < -0.15
    assert float(tight["7.4"]) == pytest.approx(-0.066, abs=0.01)


def test_its_defaults_are_those_of_the_study(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    told = " ".join(capsys.readouterr().out.split())
    for words in (
        "forcing periods to average over (default: 10000)",
        "forcing periods to discard at the start (default: 1000)",
        "method (default: Taylor)",
        "relative tolerance per step (default: 1e-09)",
        "absolute tolerance per step (default: 1e-11)",
    ):
        assert words in told
