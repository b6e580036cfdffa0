"""Compiled code kept between processes, and what is said while it is made."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hybrid.cache import announced, cache_directory, compiled_into, source_key
from hybrid.load import load_kernels

ROOT = Path(__file__).parents[2]
PROGRAM = """
import sys
import hybrid, models
arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
section = hybrid.stroboscopic_section(models.impact_oscillator(), (0.0, 0.0), periods=3)
print(round(arc.jumps[0].t, 12), arc.status.code.name, len(section))
systems = models.bouncing_ball(), models.impact_oscillator()
print(sum(role.cache_hits for system in systems for role in hybrid.compile_system(system).roles))
print(*sorted(sys.modules.keys() & {"scipy.linalg", "scipy.special", "sympy"}))
"""
LINEAR_ALGEBRA = """
import sys
from hybrid.load import load_kernels
load_kernels()
assert "scipy.linalg" not in sys.modules
import numba, numpy as np
a = np.arange(9.0).reshape(3, 3) + np.eye(3)
assert np.array_equal(numba.njit(lambda a: np.linalg.inv(a @ a) @ np.cov(a))(a).shape, (3, 3))
assert "scipy.linalg" in sys.modules
"""


def test_directory(monkeypatch, tmp_path):
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(tmp_path))
    assert cache_directory() == tmp_path
    monkeypatch.delenv("HYBRID_CACHE_DIR")
    assert cache_directory().name == "hybrid-systems"


def test_key_depends_on_every_text():
    keys = {source_key("a", "b"), source_key("b", "a"), source_key("a"), source_key()}
    assert len(keys) == 4
    assert source_key("a") == source_key("a")


def test_setting_of_numba_is_put_back(tmp_path):
    from numba import config

    before = config.CACHE_DIR
    with compiled_into(tmp_path):
        assert tmp_path == Path(config.CACHE_DIR)
    assert before == config.CACHE_DIR
    with pytest.raises(ZeroDivisionError), compiled_into(tmp_path):
        raise ZeroDivisionError
    assert before == config.CACHE_DIR


def test_long_work_is_announced_on_standard_error(capsys):
    with announced("compiling", after=0.01):
        time.sleep(0.2)
    assert capsys.readouterr().err == "compiling\n"


def test_short_work_is_not(capsys):
    with announced("compiling", after=30.0):
        pass
    with pytest.raises(ZeroDivisionError), announced("compiling", after=30.0):
        raise ZeroDivisionError
    assert capsys.readouterr().err == ""


@pytest.fixture
def shared_kernels(tmp_path):
    """A cache folder with the kernels of this process, which take long to compile, and no models."""
    load_kernels()
    load_kernels("hybrid.kernels.sections")
    for folder in cache_directory().glob("kernels-*"):
        (tmp_path / folder.name).symlink_to(folder)
    return tmp_path


def test_a_second_process_loads_what_the_first_one_compiled(shared_kernels):
    def run():
        environment = os.environ | {"HYBRID_CACHE_DIR": str(shared_kernels)}
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM], cwd=ROOT, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        answer, hits, imported = done.stdout.splitlines()
        return answer, int(hits), imported

    first, hits, _ = run()
    assert first == "0.451523640986 SUCCESS 3"
    assert hits == 0
    [models] = shared_kernels.glob("models-*")
    kept = sorted(models.rglob("*.nbi"))
    assert len(kept) == 16
    stamps = [path.stat().st_mtime_ns for path in kept]
    second, hits, imported = run()
    assert second == first
    assert imported == ""
    assert hits == 16
    assert [path.stat().st_mtime_ns for path in kept] == stamps
    assert len(list(models.glob("hybrid_model_*.py"))) == 2
    assert len(list(models.glob("emitted_*.json"))) == 2


def test_linear_algebra_is_loaded_when_a_compiled_function_needs_it(shared_kernels):
    environment = os.environ | {"HYBRID_CACHE_DIR": str(shared_kernels)}
    done = subprocess.run(
        [sys.executable, "-c", LINEAR_ALGEBRA], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
