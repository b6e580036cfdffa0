"""Errors of a user's file name its line; a page whose file cannot be read any more stays as it was."""

import os

import numpy as np
import pytest

from hybrid.__main__ import main
from hybrid.errors import HybridError
from hybrid.explorer.command import model_of
from hybrid.explorer.faults import told
from hybrid.explorer.page import Page
from hybrid.explorer.source import Source
from hybrid.explorer.subject import subject

GOOD = """\
from hybrid import HybridSystem, Mode


def field(t, x, p):
    return x.v, -p.k * x.q


system = HybridSystem(state=("q", "v"), parameters={"k": 4.0}, modes=[Mode("swing", field)])
"""
FAULTS = [
    # What is replaced by what; the line that is named, and what is said.
    ("-p.k * x.q", "-p.kk * x.q", 5, "Parameter 'kk' does not exist"),
    ("-p.k * x.q", "-p.k * {}['stiff']", 5, "field fails when called with (t, x, p): KeyError: 'stiff'"),
    ('Mode("swing", field)', 'Mode("swing", 3)', 8, "field must be a function"),
    ("return x.v,", "return x.v,, ", 5, "SyntaxError"),
    ("system =", "missing\nsystem =", 8, "NameError: name 'missing' is not defined"),
    ("from hybrid", "import no_such_package\nfrom hybrid", 1, "No module named 'no_such_package'"),
]


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "pendulum.py"
    path.write_text(GOOD)
    return path


def spoil(file, old, new):
    assert old in GOOD
    file.write_text(GOOD.replace(old, new))
    # An edit within one tick of the clock of the file system, which a person does not make.
    os.utime(file, ns=(file.stat().st_atime_ns, file.stat().st_mtime_ns + 10**9))


@pytest.mark.parametrize(("old", "new", "line", "said"), FAULTS)
def test_the_command_names_the_line_and_no_frame_of_the_library(file, capsys, old, new, line, said):
    spoil(file, old, new)
    assert main(["explore", f"{file}:system", "--no-browser"]) == 1
    err = capsys.readouterr().err
    assert err.startswith(f"hybrid: {file}, line {line} (")
    assert said in err
    assert "Traceback" not in err
    assert len(err.splitlines()) == 1


def test_a_fault_inside_a_factory_is_no_lack_of_arguments(file, capsys):
    file.write_text(GOOD + "\n\ndef make():\n    return len(3)\n")
    assert main(["explore", f"{file}:make", "--no-browser"]) == 1
    err = capsys.readouterr().err
    assert f"{file}, line 12 (return len(3)): TypeError" in err
    assert "without arguments" not in err


def test_a_module_that_lacks_another_one_is_not_said_to_be_missing(file, monkeypatch, capsys):
    spoil(file, "from hybrid", "import no_such_package\nfrom hybrid")
    monkeypatch.syspath_prepend(file.parent)
    assert main(["explore", "pendulum:system", "--no-browser"]) == 1
    err = capsys.readouterr().err
    assert f"{file}, line 1 (import no_such_package)" in err
    assert "Module 'pendulum' was not found" not in err


def test_an_error_of_no_user_is_told_as_it_is():
    """The test is the user, and its line is named; without its frame nothing is."""
    with pytest.raises(np.linalg.LinAlgError) as raised:
        np.linalg.inv(np.zeros((2, 2)))
    assert told(raised.value).startswith(f"{__file__}, line ")
    assert told(raised.value.with_traceback(None)) == "LinAlgError: Singular matrix"
    assert told(HybridError("x0 must be finite.")) == "x0 must be finite."


def test_why_no_start_is_found_is_said(file, capsys):
    """The field has no value anywhere, which only a run shows."""
    spoil(file, "-p.k * x.q", "-p.k * x.q / 0")
    assert main(["explore", f"{file}:system", "--no-browser"]) == 1
    err = capsys.readouterr().err
    assert "No start was found from which the system runs. Give one with x0=. From rest: " in err
    assert "Mode 'swing': field" in err


@pytest.mark.parametrize(("old", "new", "line", "said"), FAULTS)
def test_a_reload_that_fails_keeps_the_page_and_tells_why(file, old, new, line, said):
    source = Source(file, lambda: subject(*model_of(f"{file}:system"), (1.0, 0.0)))
    before, problem = source()
    assert problem == ""
    spoil(file, old, new)
    kept, problem = source()
    assert kept is before
    assert problem.startswith(f"{file}, line {line} (")
    assert said in problem
    page = Page(kept, {"columns": "2"}, lambda act: act(), problem)
    assert page.worker.wait(60)
    assert f"{file}, line {line}" in page.widgets.messages["top"].text
    assert page.board.live.arc.status.ok
    page.close()
    # The mended file is shown when the page is loaded the next time.
    spoil(file, "4.0", "9.0")
    now, problem = source()
    assert problem == ""
    assert now.values == {"k": 9.0}


def test_a_file_that_has_not_changed_is_not_read_again(file):
    made = []

    def read():
        made.append(1)
        return subject(*model_of(f"{file}:system"), (1.0, 0.0))

    source = Source(file, read)
    assert source()[0] is source()[0]
    assert made == [1]
    file.unlink()
    kept, problem = source()
    assert "was not found" in problem
    assert kept is source()[0]
