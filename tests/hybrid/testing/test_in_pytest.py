"""What a user of pytest reads where a property fails."""

import re
import subprocess
import sys

import pytest

WRONG = """
from hypothesis import given
from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition
from hybrid.testing import Engine, cases, check_laws, check_system, run_settings

ball = HybridSystem(
    name="ball",
    state=("q", "v"),
    parameters={"g": 9.81, "e": 0.8},
    modes=[Mode("flight", lambda t, x, p: (x.v, -p.g))],
    transitions=[Transition("flight", "flight", Guard(lambda t, x, p: x.q, direction=-1),
                            Reset(lambda t, x, p: (0.0, -2 * p.e * x.v)), name="impact")],
    laws=Laws(dissipated={"energy": lambda t, x, p: p.g * x.q + x.v**2 / 2}))

def test_system():
    check_system(ball, examples=5)

@given(cases(ball, t_span=(0.0, 1.0)))
def test_case(case):
    check_laws(case)

@run_settings
@given(cases(ball, states={"q": (-0.5, 1.0)}, t_span=(0.0, 1.0)))
def test_own(case):
    if case.x0[1] > 1.0:
        assert case.whole.x[:, 0].max() < 0.1, "too high"
    assert case.whole.x[:, 0].max() < 0.2, "too high"

class Broken(Engine):
    def simulate(self, *arguments, **options):
        raise ZeroDivisionError("no run today")

def test_engine():
    check_system(ball, examples=5, engine=Broken())
"""
SENTENCE = "'energy' never grows by more than is put in: this does not hold for ball."


@pytest.fixture(scope="module")
def failures(tmp_path_factory):
    """The lines that pytest prints of each failing test, by its name."""
    folder = tmp_path_factory.mktemp("user")
    (folder / "test_ball.py").write_text(WRONG)
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-p", "no:xdist", "test_ball.py"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert "4 failed" in done.stdout, done.stdout + done.stderr
    _, *parts = re.split(r"^_+ (test_\w+) _+$|^=+ short test summary", done.stdout, flags=re.MULTILINE)
    return {name: text.splitlines() for name, text in zip(parts[::2], parts[1::2], strict=True) if name}


def told(lines):
    """What is told of the error, without the marks of pytest."""
    return [line[1:].strip() for line in lines if line.startswith("E ")]


@pytest.mark.parametrize("name", ["system", "case"])
def test_below_the_line_that_fails_stand_sentence_case_and_remedy(failures, name):
    lines = failures[f"test_{name}"]
    begin = next(i for i, line in enumerate(lines) if line.startswith("E "))
    assert lines[begin - 1].startswith(">       check_")
    found = told(lines)
    assert found[0] == f"hybrid.testing.PropertyError: {SENTENCE}"
    heads = [line.split(":")[0] for line in found]
    assert heads.index("case") + 1 == heads.index("likely")
    # Hypothesis says the case again, after all that.
    assert [i for i, head in enumerate(heads) if i > heads.index("likely")][:1] == (
        [heads.index("Failing test case")] if name == "case" else []
    )


@pytest.mark.parametrize("name", ["system", "case", "own"])
def test_only_lines_of_the_user_are_shown(failures, name):
    places = [re.match(r"(\S+\.py):\d+: ", line) for line in failures[f"test_{name}"]]
    assert {place[1] for place in places if place} == {"test_ball.py"}


def test_of_several_failures_one_is_told_and_a_start_without_a_run_is_none(failures):
    """Starts below the floor have no run: they are discarded."""
    found = told(failures["test_own"])
    assert found[0] == "AssertionError: too high"
    assert sum("too high" in line for line in found) == 1


def test_a_fault_that_is_no_failure_shows_the_way_to_it(failures):
    lines = failures["test_engine"]
    assert "ZeroDivisionError: no run today" in told(lines)
    assert any("check.py:" in line for line in lines)
