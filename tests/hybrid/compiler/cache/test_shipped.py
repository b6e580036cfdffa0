"""Kernels that come with the package."""

import pytest
from llvmlite import binding

import hybrid.__main__ as command
from hybrid.compiler.cache import loader, shipped
from hybrid.compiler.llvm import engine

MODULE = "hybrid.kernels.steps.step"
NAMES = ["field_at", "jacobian_at", "no_step"]


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A folder with the kernels of one module, for all processors of this family."""
    folder = tmp_path_factory.mktemp("machine_code")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("HYBRID_CPU", raising=False)
        shipped.base.cache_clear()
        patch.setattr(command, "ALL_KERNELS", (MODULE,))
        assert command.main(["compile", "--portable", str(folder)]) == 0
    shipped.base.cache_clear()
    return folder


@pytest.fixture
def package(compiled, tmp_path, monkeypatch):
    """The package as a wheel with these kernels installs it, and an empty cache."""
    folder = tmp_path / "machine_code"
    folder.mkdir()
    for path in compiled.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr(shipped, "FOLDER", folder)
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("HYBRID_CPU", raising=False)
    decide_anew()
    yield folder
    decide_anew()


def decide_anew():
    """What was decided for another processor or another folder is not used."""
    for each in (shipped.base, engine.processor, loader.kernels_key):
        each.cache_clear()


def kept_in(folder):
    return [path.name for path in folder.rglob("*.o")]


def load():
    return loader.loaded(MODULE)


def refuse(module):
    raise AssertionError(f"{module} was compiled")


def test_a_run_loads_them_and_compiles_nothing(package, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(loader, "compiled", refuse)
    assert loader.is_kept(MODULE)
    assert loader.is_shipped(MODULE)
    kernels = load()
    assert set(NAMES) <= set(vars(kernels))
    assert kernels.no_step.address != 0
    assert kept_in(tmp_path / "cache") == []
    monkeypatch.setattr(command, "ALL_KERNELS", (MODULE,))
    assert command.main(["compile"]) == 0
    assert str(package) in capsys.readouterr().out


def test_they_do_not_depend_on_the_compiler_that_is_installed(package, monkeypatch):
    monkeypatch.setattr("importlib.metadata.version", lambda name: "0.0")
    loader.kernels_key.cache_clear()
    assert loader.is_shipped(MODULE)
    loader.kernels_key.cache_clear()


def stored(monkeypatch):
    """Let the kernels be compiled; returns the list of modules that were."""
    asked = []

    def compile_now(module):
        asked.append(module)
        return loader.file_of({}, b"")

    monkeypatch.setattr(loader, "compiled", compile_now)
    return asked


def test_kernels_of_other_sources_are_not_loaded(package, monkeypatch):
    asked = stored(monkeypatch)
    [path] = package.glob(f"{MODULE}.*")
    key = loader.sources_key(MODULE)
    path.rename(package / path.name.replace(key, key[::-1]))
    assert not loader.is_kept(MODULE)
    load()
    assert asked == [MODULE]


@pytest.fixture
def lacking(monkeypatch):
    """Take an instruction from the processor that the best base of its family needs."""
    best = shipped.bases()[0]
    if not best.needs:
        pytest.skip("every processor of this family has all instructions of the base")
    has = dict(binding.get_host_cpu_features()) | {sorted(best.needs)[0]: False}
    monkeypatch.setattr(shipped.binding, "get_host_cpu_features", lambda: binding.FeatureMap(has))
    shipped.base.cache_clear()
    return best


def test_a_processor_without_the_instructions_compiles_its_own(package, lacking, monkeypatch):
    asked = stored(monkeypatch)
    assert not loader.is_kept(MODULE)
    load()
    assert asked == [MODULE]


def test_a_processor_without_the_instructions_loads_code_for_all_of_its_family(package, lacking, monkeypatch):
    [path] = package.glob(f"{MODULE}.*")
    content = loader.kept(path)
    path.unlink()
    older = loader.portable(MODULE, package)
    assert lacking.name not in older.name
    loader.keep(older, content)
    monkeypatch.setattr(loader, "compiled", refuse)
    assert loader.is_shipped(MODULE)
    assert load().no_step.address != 0


def test_a_wheel_for_a_family_has_code_for_each_base_and_says_so(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(command, "_compile", lambda *given: asked.append(given[3]["HYBRID_CPU"]) or [])
    assert command.main(["compile", "--portable", str(tmp_path), "--family"]) == 0
    assert asked == [each.name for each in shipped.bases()]
    text = (tmp_path / "README.txt").read_text(encoding="utf-8")
    assert [name for name in asked if f"\n{name}: " not in text] == []
    assert command.main(["compile", "--portable", str(tmp_path)]) == 0
    assert asked[len(shipped.bases()) :] == [shipped.base().name]


def test_every_machine_of_a_family_runs_its_last_base():
    assert [machine for machine, bases in shipped.BASES.items() if bases[-1].needs] == []


@pytest.mark.parametrize("machine", ["riscv64", ""])
def test_a_family_without_a_base_ships_nothing(package, monkeypatch, capsys, machine):
    monkeypatch.setattr(shipped.platform, "machine", lambda: machine)
    shipped.base.cache_clear()
    assert not loader.is_shipped(MODULE)
    assert command.main(["compile", "--portable", str(package)]) == 1
    said = capsys.readouterr().err
    assert "x86_64" in said
    assert machine in said


def test_damaged_files_are_compiled_again_and_a_line_says_so(package, monkeypatch, capsys):
    asked = stored(monkeypatch)
    [path] = package.glob(f"{MODULE}.*")
    path.write_bytes(path.read_bytes()[:-1])
    load()
    assert asked == [MODULE]
    assert "damaged" in capsys.readouterr().err


def test_both_names_of_a_family_have_one_base():
    assert shipped.BASES["x86_64"] is shipped.BASES["AMD64"]
    assert shipped.BASES["arm64"] is shipped.BASES["aarch64"]


def test_they_are_compiled_for_the_oldest_processor_that_runs_them(tmp_path, monkeypatch):
    tell = "import os, sys\nopen(sys.argv[1] + '/name', 'w').write(os.environ['HYBRID_CPU'])"
    monkeypatch.setattr(command, "PORTABLE", tell)
    command.compile_portable(1, tmp_path)
    assert (tmp_path / "name").read_text() == shipped.base().name


def test_they_are_not_loaded_where_code_for_another_processor_is_wanted(package, monkeypatch):
    asked = stored(monkeypatch)
    monkeypatch.setenv("HYBRID_CPU", "x86-64" if shipped.base().name != "x86-64" else "generic")
    shipped.base.cache_clear()
    assert not loader.is_shipped(MODULE)
    load()
    assert asked == [MODULE]
