"""Run chosen tests on a copy of the sources in which one file is changed, each time in a fork of a process.

That process has imported the packages that the library rests on, but not the library, so that a run of a
small test takes about a second. For changes of kernels it has compiled all kernels too.
"""

from __future__ import annotations

import importlib
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from benchmarks.common import ROOT
from benchmarks.compiled_kernels import CompiledKernels, forget_all

COPIED = ("hybrid", "lyapunov", "models", "tests", "docs", "benchmarks", "pyproject.toml", "README.md")
IMPORTED = (
    *("hypothesis.extra.numpy", "hypothesis.stateful", "matplotlib.pyplot", "mpmath", "networkx", "numba"),
    *("numba.np.arraymath", "pytest", "scipy.integrate", "scipy.linalg", "scipy.optimize", "sympy", "xarray"),
)
# Packages on which no compiled model depends: models that were traced before the change serve again.
NOT_TRACING = (
    *("hybrid/accuracy", "hybrid/display", "hybrid/orbits", "hybrid/plot", "hybrid/simulation"),
    *("hybrid/solvers", "hybrid/sweep", "hybrid/testing", "lyapunov"),
)
# Kernels that only other kernels use, so that models serve again, and kernels that do not contain the change.
KERNELS = tuple(
    f"hybrid/kernels/{each}" for each in ("arithmetic/", "drive", "evaluate", "events/", "jumps/", "steps/")
)
IN_MODELS = ("hybrid/kernels/arithmetic/doubled.py", "hybrid/kernels/arithmetic/operations.py")
# What a run says that did not end in time.
ENDLESS = "did not end"
# Limit of the time of day, in limits of the processor time.
WAITING = 6


class Copy:
    """A copy of the project with its own cache of machine code, in a temporary folder."""

    def __init__(self) -> None:
        for name in IMPORTED:
            importlib.import_module(name)
        self._holder = tempfile.TemporaryDirectory(prefix="planted-")
        self.folder = Path(self._holder.name) / "project"
        self.cache = Path(self._holder.name) / "cache"
        self.folder.mkdir()
        for each in COPIED:
            source = ROOT / each
            if source.is_dir():
                ignored = shutil.ignore_patterns("__pycache__", "*.png")
                shutil.copytree(source, self.folder / each, ignore=ignored)
            else:
                shutil.copy(source, self.folder / each)
        # A new interpreter has to find the folder of the cache, since the library is not imported here.
        import platformdirs

        users = Path(platformdirs.user_cache_dir("hybrid-systems", appauthor=False))
        _link(Path(os.environ.get("HYBRID_CACHE_DIR", users)), self.cache)
        self._kernels: CompiledKernels | None = None

    def failing(self, tests: Sequence[str], seconds: int, changed: Path | None, source: str) -> str | None:
        """The first of the tests that fails if ``changed`` has this source; None if all pass.

        The string may also be ``ENDLESS`` or the way in which the process died.
        """
        if changed is None:
            return self._forked(tests, seconds, self.cache)
        kernel = str(changed).startswith(KERNELS) and str(changed) not in IN_MODELS
        if kernel:
            self._kernels = self._kernels or CompiledKernels(self.folder)
        path = self.folder / changed
        before = path.read_bytes()
        path.write_text(source, encoding="utf-8")
        try:
            if kernel:
                return self._forked(tests, seconds, self.cache, kernel=path)
            if str(changed).startswith(NOT_TRACING):
                return self._forked(tests, seconds, self.cache)
            with tempfile.TemporaryDirectory(dir=self._holder.name) as name:
                cache = Path(name) / "cache"
                _link(self.cache, cache)
                return self._forked(tests, seconds, cache, tracing=True)
        finally:
            path.write_bytes(before)

    def _forked(
        self,
        tests: Sequence[str],
        seconds: int,
        cache: Path,
        *,
        tracing: bool = False,
        kernel: Path | None = None,
    ) -> str | None:
        answer = self.folder.parent / "answer"
        answer.unlink(missing_ok=True)
        child = os.fork()
        if not child:
            status = 70
            try:
                os.setsid()
                resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
                status = self._test(tests, answer, cache, tracing, kernel)
            except BaseException:
                traceback.print_exc()
                sys.stderr.flush()
            finally:
                os._exit(status)
        # Tests may also wait for something that never happens.
        end = time.monotonic() + WAITING * seconds
        done, code = 0, 0
        while not done and time.monotonic() < end:
            time.sleep(0.02)
            done, code = os.waitpid(child, os.WNOHANG)
        # Also ends processes that the tests have started.
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        if not done:
            os.waitpid(child, 0)
            return ENDLESS
        if os.WIFSIGNALED(code) and os.WTERMSIG(code) in (signal.SIGXCPU, signal.SIGKILL):
            return ENDLESS
        if code == 0:
            return None
        return answer.read_text(encoding="utf-8") if answer.exists() else f"died ({code})"

    def _test(
        self, tests: Sequence[str], answer: Path, cache: Path, tracing: bool, kernel: Path | None
    ) -> int:
        os.chdir(self.folder)
        sys.path.insert(0, str(self.folder))
        sys.dont_write_bytecode = True
        os.environ.update(
            PYTHONPATH=str(self.folder), PYTHONDONTWRITEBYTECODE="1", HYBRID_CACHE_DIR=str(cache)
        )
        log = os.open(self.folder.parent / "log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(log, 1)
        os.dup2(log, 2)
        import pytest

        class FirstFailure:
            """Writes the first test that fails, or the file that cannot be imported."""

            def pytest_runtest_logreport(self, report: Any) -> None:
                self.note(report)

            def pytest_collectreport(self, report: Any) -> None:
                self.note(report)

            def note(self, report: Any) -> None:
                if report.failed and not answer.exists():
                    answer.write_text(report.nodeid, encoding="utf-8")

        if self._kernels and kernel:
            self._kernels.change(kernel)
        else:
            forget_all()
        if not tracing:
            from hybrid.compiler.cache import store

            vars(store)["_tracer"] = lambda: "unchanged"
        options = [
            "-x",
            "-q",
            "--assert=plain",
            "-p",
            "no:cacheprovider",
            "-p",
            "no:cov",
            "-p",
            "no:xdist",
            "--no-header",
        ]
        return int(pytest.main([*options, *tests], plugins=[FirstFailure()]))


def _link(source: Path, target: Path) -> None:
    """A copy of a folder of files that are only ever replaced as a whole."""

    def link(one: str, other: str) -> None:
        # Another process may have replaced the file.
        if Path(one).exists():
            os.link(one, other)

    if source.is_dir():
        shutil.copytree(source, target, copy_function=link, dirs_exist_ok=True)
    target.mkdir(mode=0o700, exist_ok=True, parents=True)
