"""Compiled code kept between processes, and the messages during compilation."""

import errno
import os
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

import hybrid
from hybrid.compiler.cache import folder, loader, store
from hybrid.compiler.cache.folder import (
    announced,
    cache_directory,
    cache_folder,
    keep,
    kept,
    source_key,
)
from hybrid.compiler.cache.loader import kernels_key, load_kernels, sources_key
from hybrid.compiler.cache.seal import sealed
from hybrid.compiler.llvm.functions import shared_functions

ROOT = Path(__file__).parents[4]
PROGRAM = """
import sys
import hybrid, models
arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
section = hybrid.stroboscopic_section(models.impact_oscillator(), (0.0, 0.0), periods=3)
print(round(arc.jumps[0].t, 12), arc.status.code.name, len(section))
print(*sorted(sys.modules.keys() & {"numba", "scipy.linalg", "scipy.special"}))
"""
LINEAR_ALGEBRA = """
import sys
from hybrid.compiler.cache.loader import import_numba
import_numba()
assert "scipy.linalg" not in sys.modules
import numba, numpy as np
a = np.arange(9.0).reshape(3, 3) + np.eye(3)
assert numba.njit(lambda a: np.cov(a))(a).shape == (3, 3)
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
    """A cache folder with the compiled kernels of this process and without models."""
    load_kernels()
    load_kernels("hybrid.kernels.runs.sections")
    for kernels in cache_directory().glob("kernels-*"):
        (tmp_path / kernels.name).symlink_to(kernels)
    return tmp_path


def test_a_second_process_loads_what_the_first_one_compiled(shared_kernels):
    def run():
        environment = os.environ | {"HYBRID_CACHE_DIR": str(shared_kernels)}
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM], cwd=ROOT, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    first, imported = run()
    assert first == "0.451523640986 SUCCESS 3"
    # Numba is needed for the kernels alone, not for a new model.
    assert imported == ""
    [models] = shared_kernels.glob("models-*")
    kept = sorted(models.iterdir())
    # Two models, each with its fields, its events, the slopes of these, and its series.
    assert [path.suffix for path in kept] == [".json"] * 2 + [".o"] * 8
    stamps = [path.stat().st_mtime_ns for path in kept]
    assert run() == [first, ""]
    assert sorted(models.iterdir()) == kept
    assert [path.stat().st_mtime_ns for path in kept] == stamps


def test_linear_algebra_is_loaded_when_a_compiled_function_needs_it():
    done = subprocess.run([sys.executable, "-c", LINEAR_ALGEBRA], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.fixture
def new_process(monkeypatch, tmp_path):
    """The state of a new process, with the private cache in a folder of this test."""
    monkeypatch.setattr(folder, "_SAID", set())
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    known = (folder._usable, folder._private_folder, shared_functions)
    for each in known:
        each.cache_clear()
    yield tmp_path
    for each in known:
        each.cache_clear()


def not_a_folder(path):
    path.write_text("")


def below_a_file(path):
    path.parent.joinpath("file").write_text("")
    path.symlink_to(path.parent / "file" / "below")


def open_to_all(path):
    path.mkdir()
    path.chmod(0o777)


def open_to_the_group(path):
    path.mkdir()
    path.chmod(0o770)


OBJECTIONS = {
    not_a_folder: "File exists",
    below_a_file: "",
    open_to_all: "others can write to it",
    open_to_the_group: "others can write to it",
}


@pytest.mark.parametrize("made", OBJECTIONS)
def test_a_folder_that_cannot_be_trusted_or_used_is_replaced(new_process, monkeypatch, capsys, made):
    chosen = new_process / "chosen"
    made(chosen)
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(chosen))
    private = cache_directory()
    assert private.parent == new_process / "temporary"
    assert private.stat().st_mode & 0o077 == 0
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith(f"hybrid: compiled code is stored in {private}, not in {chosen}: ")
    assert OBJECTIONS[made] in line
    assert cache_directory() == private
    assert capsys.readouterr().err == ""


def test_so_is_one_of_another_user(new_process, monkeypatch, capsys):
    chosen = new_process / "chosen"
    chosen.mkdir()
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(chosen))
    owner = os.geteuid()
    monkeypatch.setattr("os.geteuid", lambda: owner + 1)
    assert cache_directory().parent == new_process / "temporary"
    assert "it belongs to another user" in capsys.readouterr().err


def test_so_is_a_part_of_it(new_process, monkeypatch, capsys):
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(new_process))
    open_to_all(new_process / "models-1")
    assert cache_folder("models-1").parent.parent == new_process / "temporary"
    assert cache_folder("models-2") == new_process / "models-2"
    assert "models-1: others can write to it" in capsys.readouterr().err


def test_a_private_folder_that_another_user_has_made_is_not_used(new_process, monkeypatch):
    lasting = new_process / "temporary" / f"hybrid-systems-{os.geteuid()}"
    open_to_all(lasting)
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(lasting))
    assert cache_directory() != lasting
    assert cache_directory().stat().st_mode & 0o077 == 0


def test_folders_are_made_for_the_user_alone(new_process, monkeypatch):
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(new_process / "not" / "yet"))
    assert cache_directory() == new_process / "not" / "yet"
    assert cache_directory().stat().st_mode & 0o077 == 0


def decay(rate):
    return hybrid.HybridSystem(state=("x",), modes=[hybrid.Mode("a", lambda t, x, p: (-rate * x.x,))])


def ends_well(system):
    arc = hybrid.simulate(system, (1.0,), (0.0, 1.0), samples=[1.0])
    return arc.status.ok and 0.0 < arc.x[-1, 0] < 1.0


def truncate(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def empty(path):
    path.write_bytes(b"")


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)


def replace(path):
    """The whole and undamaged file of another model in its place."""
    others = [each for each in sorted(path.parent.glob(f"*{path.suffix}")) if each != path]
    if others:
        shutil.copy(others[0], path)
    else:
        path.write_bytes(sealed("another" + path.suffix, b"{}"))


@pytest.mark.parametrize("damage", [truncate, empty, flip, replace])
@pytest.mark.parametrize("pattern", ["model_*.o", "emitted_*.json"])
def test_what_is_damaged_is_made_again(new_process, monkeypatch, capsys, damage, pattern):
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(new_process))
    assert ends_well(decay(0.7))
    files = sorted(store.models_folder().rglob(pattern))
    assert files
    before = {path: path.read_bytes() for path in files}
    for path in files:
        damage(path)
    shared_functions.cache_clear()
    capsys.readouterr()
    assert ends_well(decay(0.7))
    said = [line for line in capsys.readouterr().err.splitlines() if "compiling" not in line]
    assert len(said) <= 1
    assert all(path.read_bytes() == before[path] for path in files)
    shared_functions.cache_clear()
    assert ends_well(decay(0.7))
    assert capsys.readouterr().err == ""


def test_a_full_disk_stops_nothing(new_process, monkeypatch, capsys):
    def full(*arguments, **options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setenv("HYBRID_CACHE_DIR", str(new_process))
    store.models_folder()
    monkeypatch.setattr(Path, "write_bytes", full)
    assert ends_well(decay(0.5))
    lines = [line for line in capsys.readouterr().err.splitlines() if "compiling" not in line]
    assert lines == ["hybrid: compiled code cannot be saved: No space left on device."]
    assert [path for path in store.models_folder().iterdir() if path.name.startswith(".")] == []


def test_a_cache_that_cannot_be_written_to_is_read(new_process, monkeypatch, capsys):
    """All that is needed is there, so nothing is compiled, and nobody is told."""
    assert ends_well(decay(0.45))
    shared_functions.cache_clear()
    folder._usable.cache_clear()

    def refused(*arguments, **options):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(folder.tempfile, "TemporaryFile", refused)
    assert ends_well(decay(0.45))
    assert loader.is_kept(loader.DRIVER)
    assert capsys.readouterr().err == ""


def test_a_folder_that_is_made_for_a_file_is_its_users_alone(tmp_path):
    path = tmp_path / "new" / "deeper" / "a.txt"
    for content in (b"a", b"b"):
        assert keep(path, content)
        assert kept(path) == content
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


def test_a_draft_that_was_not_finished_is_removed(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(folder, "_SAID", set())
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError(errno.EIO, "broken")))
    assert not keep(tmp_path / "a.txt", b"a")
    assert list(tmp_path.iterdir()) == []
    assert "broken" in capsys.readouterr().err


def test_kernels_of_another_package_depend_on_what_they_are_made_of(tmp_path, monkeypatch):
    package = tmp_path / "otherpackage"
    package.mkdir()
    for name in ("__init__", "aside", "parts"):
        (package / f"{name}.py").write_text("")
    (package / "kernels.py").write_text("from otherpackage import parts\n")
    monkeypatch.syspath_prepend(tmp_path)
    keys = []
    for changed in (None, "aside", "parts", "kernels"):
        if changed:
            path = package / f"{changed}.py"
            path.write_text(path.read_text() + "# changed\n")
        keys.append(sources_key.__wrapped__("otherpackage.kernels"))
    assert keys[0] == keys[1]
    assert len(set(keys[1:])) == 3
    assert kernels_key("lyapunov.kernels") != kernels_key()


def test_damaged_kernels_are_compiled_again(tmp_path):
    load_kernels("hybrid.kernels.steps.dense")
    for kernels in cache_directory().glob("kernels-*"):
        shutil.copytree(kernels, tmp_path / kernels.name)
    for path in tmp_path.rglob("*.dense.o"):
        truncate(path)
    program = "import hybrid, models; print(hybrid.simulate(models.bouncing_ball(), (1, 0), (0, 1))(0.25)[0])"
    environment = os.environ | {"HYBRID_CACHE_DIR": str(tmp_path)}
    for lines in (1, 0):
        done = subprocess.run(
            [sys.executable, "-c", program], cwd=ROOT, env=environment, capture_output=True, text=True
        )
        assert float(done.stdout) == pytest.approx(1 - 9.81 / 32, rel=1e-14), done.stderr
        said = [line for line in done.stderr.splitlines() if "compiling" not in line]
        assert len(said) == lines
        assert all("is damaged; it is compiled again" in line for line in said)


KEYS = """
from hybrid.compiler.cache.store import _compiler, _tracer
from hybrid.compiler.cache.loader import kernels_key
print(kernels_key(), kernels_key("lyapunov.kernels"), _compiler(), _tracer().split()[0])
"""
KERNELS, SPECTRUM, COMPILER, TRACER = range(4)


@pytest.mark.parametrize(
    ("edited", "changed"),
    [
        ("hybrid/kernels/deeper/new.py", {KERNELS, SPECTRUM, COMPILER}),
        ("hybrid/compiler/cache/seal.py", {KERNELS, SPECTRUM, COMPILER, TRACER}),
        ("hybrid/compiler/llvm/lowering.py", {COMPILER, TRACER}),
        ("hybrid/solvers/deeper/new.py", {TRACER}),
        ("lyapunov/batches.py", {SPECTRUM}),
        ("models/bouncing_ball.py", set()),
    ],
)
def test_an_edit_changes_the_keys_of_what_it_goes_into(sources, before, edited, changed):
    path = sources / edited
    content = path.read_text() if path.exists() else None
    path.parent.mkdir(exist_ok=True)
    path.write_text((content or "") + "# Another version.\n")
    after = keys(sources)
    path.unlink() if content is None else path.write_text(content)
    assert {i for i, (one, other) in enumerate(zip(before, after, strict=True)) if one != other} == changed


def keys(sources):
    done = subprocess.run(
        [sys.executable, "-c", KEYS], cwd=sources, capture_output=True, text=True, check=True
    )
    return done.stdout.split()


@pytest.fixture(scope="module")
def before(sources):
    """The keys of the copy, which each test leaves as it was."""
    return keys(sources)


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """A copy of the packages."""
    folder = tmp_path_factory.mktemp("sources")
    for package in ("hybrid", "lyapunov", "models"):
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder
