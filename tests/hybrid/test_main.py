"""``python -m hybrid compile``."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import hybrid.__main__ as command
from hybrid import solvers
from hybrid.__main__ import ALL_KERNELS
from hybrid.compiler.cache.loader import DRIVER, IN_SECOND

SOURCES = Path(command.__file__).parents[1]
SMALL = ("hybrid.kernels.steps.step", "hybrid.kernels.evaluate")


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(tmp_path))
    return tmp_path


def test_every_module_of_kernels_that_is_loaded_is_compiled_ahead():
    methods = (getattr(solvers, name) for name in solvers.__all__)
    loaded = {DRIVER, *IN_SECOND, *(method.attempt[0] for method in methods)}
    for folder in ("hybrid", "lyapunov"):
        for path in (SOURCES / folder).rglob("*.py"):
            loaded |= set(re.findall(r'load_kernels\("([\w.]+)"\)', path.read_text(encoding="utf-8")))
    assert set(ALL_KERNELS) == loaded


@pytest.mark.parametrize("processes", ["1", "2"])
def test_kernels_are_compiled_into_the_cache_once(empty_cache, monkeypatch, capsys, processes):
    monkeypatch.setattr(command, "ALL_KERNELS", SMALL)
    assert command.main(["compile", "--processes", processes]) == 0
    assert str(empty_cache) in capsys.readouterr().out
    kept = {path.stem: path.stat().st_mtime_ns for path in empty_cache.rglob("*.o")}
    assert set(kept) == set(SMALL)
    assert command.main(["compile"]) == 0
    again = {path.stem: path.stat().st_mtime_ns for path in empty_cache.rglob("*.o")}
    assert again == kept


def test_what_was_not_compiled_is_named(empty_cache, monkeypatch, capsys):
    monkeypatch.setattr(command, "ALL_KERNELS", ("hybrid.kernels.no_such_module",))
    assert command.main(["compile"]) == 1
    assert "hybrid.kernels.no_such_module" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [[], ["comple"], ["compile", "--processes", "many"]])
def test_what_is_no_command_is_refused(arguments):
    with pytest.raises(SystemExit):
        command.main(arguments)


@pytest.mark.parametrize("processes", [0, 1, 3, 1000])
def test_each_module_that_is_missing_is_the_share_of_one_process(processes, monkeypatch):
    shares = []

    def start(arguments, **options):
        shares.append(arguments[3:])
        return SimpleNamespace(poll=lambda: 0)

    monkeypatch.setattr(command.subprocess, "Popen", start)
    there = ALL_KERNELS[1]
    missing = [module for module in ALL_KERNELS if module != there]
    assert command._compile(processes, lambda module: module == there, ["program"], {}) == missing
    assert sorted(module for share in shares for module in share) == sorted(missing)
    assert len(shares) == min(max(processes, 1), len(missing))
