"""Commands: ``python -m hybrid compile`` and ``python -m hybrid explore MODULE:MODEL``.

``compile`` compiles the kernels in advance, so that the first run does not wait; with ``--portable FOLDER``
for all processors like this one, as a wheel contains them, and with ``--family`` for older ones, too.
``explore`` opens a page to play with a model.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from hybrid.compiler.cache import second_process, shipped
from hybrid.compiler.cache.folder import cache_directory
from hybrid.compiler.cache.loader import ALL_KERNELS as OF_HYBRID
from hybrid.compiler.cache.loader import IN_ANOTHER_PROCESS, is_kept, is_shipped, portable
from hybrid.display.progress import progress_bar
from hybrid.explorer.command import add_options, explore_model

ALL_KERNELS = (*OF_HYBRID, "lyapunov.kernels", "lyapunov.study.kernels")
# Seconds between two checks of the progress.
LOOK = 0.3
PORTABLE = """\
import sys
from pathlib import Path
from hybrid.compiler.cache.folder import keep
from hybrid.compiler.cache.loader import compiled, portable
for module in sys.argv[2:]:
    keep(portable(module, Path(sys.argv[1])), compiled(module))
"""


def parser() -> argparse.ArgumentParser:
    """Parser of the command line."""
    options = argparse.ArgumentParser(prog="python -m hybrid", description=__doc__)
    commands = options.add_subparsers(dest="command", required=True)
    compiling = commands.add_parser("compile", help="compile the kernels that all models share")
    compiling.add_argument(
        "--processes",
        type=int,
        default=second_process.processors(),
        help="how many compile at once (default: %(default)s, all processors)",
    )
    compiling.add_argument(
        "--portable",
        type=Path,
        metavar="FOLDER",
        help="compile for all processors that have the usual instructions of this one, into this folder",
    )
    compiling.add_argument(
        "--family",
        action="store_true",
        help="with --portable, compile for older processors of this machine's family, too",
    )
    add_options(commands.add_parser("explore", help="open a page to play with a model in the browser"))
    return options


def compile_kernels(processes: int) -> list[str]:
    """Compile every kernel that is not on disk yet, in several processes; returns those that failed."""
    return _compile(processes, is_kept, [IN_ANOTHER_PROCESS], {})


def compile_portable(processes: int, folder: Path, family: bool = False) -> list[str]:
    """Compile every kernel for many processors, and write what the files are for; returns those that failed.

    Raises
    ------
    ValueError
        If no base is known for this machine.
    """
    here = shipped.base()
    bases = shipped.bases() if family else (here,) if here else ()
    if not bases:
        raise ValueError(
            f"Portable kernels are compiled for {', '.join(shipped.BASES)}; this is {platform.machine()}, "
            f"and HYBRID_CPU is {os.environ.get('HYBRID_CPU', '')!r}."
        )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "README.txt").write_text(shipped.description(bases), encoding="utf-8")
    failed = [_compile_for(base, processes, folder) for base in bases]
    return sorted({module for each in failed for module in each})


def _compile_for(base: shipped.Base, processes: int, folder: Path) -> list[str]:
    def is_done(module: str) -> bool:
        return portable(module, folder, base).exists()

    return _compile(processes, is_done, [PORTABLE, str(folder.absolute())], base.environment())


def _compile(
    processes: int, is_done: Callable[[str], bool], program: Sequence[str], variables: Mapping[str, str]
) -> list[str]:
    missing = [module for module in ALL_KERNELS if not is_done(module)]
    # Modules share functions, which each process compiles only once: hence one process per share.
    shares = [missing[i :: max(1, processes)] for i in range(max(1, processes))]
    running = [
        subprocess.Popen(
            [sys.executable, "-c", *program, *share],
            env={**second_process.environment(), **variables},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        for share in shares
        if share
    ]
    done: set[str] = set()
    with progress_bar(len(missing), "hybrid: compiling the kernels", bool(missing), "module") as bar:
        while any(process.poll() is None for process in running):
            time.sleep(LOOK)
            for module in filter(is_done, set(missing) - done):
                done.add(module)
                bar.update()
    return [module for module in missing if not is_done(module)]


def _folder(chosen: Path | None) -> Path:
    if chosen is not None:
        return chosen
    return shipped.FOLDER if all(map(is_shipped, ALL_KERNELS)) else cache_directory()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status."""
    given = parser().parse_args(arguments)
    if given.command == "explore":
        return explore_model(given)
    begin = time.perf_counter()
    if given.portable is None:
        failed = compile_kernels(given.processes)
    else:
        try:
            failed = compile_portable(given.processes, given.portable, given.family)
        except ValueError as error:
            print(f"hybrid: {error}", file=sys.stderr)
            return 1
    if failed:
        print(f"hybrid: these kernels were not compiled: {', '.join(failed)}.", file=sys.stderr)
    else:
        seconds = time.perf_counter() - begin
        print(f"hybrid: all kernels are compiled, in {_folder(given.portable)} ({seconds:.0f} s).")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
