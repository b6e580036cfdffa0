"""``python -m hybrid compile``: compile the kernels in advance, so that the first run does not wait."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence

from hybrid.compiler.cache import second_process
from hybrid.compiler.cache.folder import cache_directory
from hybrid.compiler.cache.loader import ALL_KERNELS, is_kept
from hybrid.display.progress import progress_bar

# Seconds between two checks of the progress.
LOOK = 0.3


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
    return options


def compile_kernels(processes: int) -> list[str]:
    """Compile every kernel that is not on disk yet, in several processes; returns those that failed."""
    missing = [module for module in ALL_KERNELS if not is_kept(module)]
    # Modules share functions, which each process compiles only once: hence one process per share.
    shares = [missing[i :: max(1, processes)] for i in range(max(1, processes))]
    running = [_compiling(share) for share in shares if share]
    done: set[str] = set()
    with progress_bar(len(missing), "hybrid: compiling the kernels", bool(missing), "module") as bar:
        while any(process.poll() is None for process in running):
            time.sleep(LOOK)
            for module in filter(is_kept, set(missing) - done):
                done.add(module)
                bar.update()
    return [module for module in missing if not is_kept(module)]


def _compiling(modules: Sequence[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-c", second_process.PROGRAM, *modules],
        env=second_process.environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status."""
    given = parser().parse_args(arguments)
    begin = time.perf_counter()
    failed = compile_kernels(given.processes)
    if failed:
        print(f"hybrid: these kernels were not compiled: {', '.join(failed)}.", file=sys.stderr)
    else:
        seconds = time.perf_counter() - begin
        print(f"hybrid: all kernels are compiled, in {cache_directory()} ({seconds:.0f} s).")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
