"""Many starts in threads, a block of them at a time."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait

from hybrid.compiler.interrupts import CTRL_C, stopped_by
from hybrid.display.progress import Progress, silent
from hybrid.simulation.crew import TOGETHER
from hybrid.sweep.local import LOOK

# Blocks that a thread takes one after another: enough of them that threads end at about the same time.
BLOCKS_PER_THREAD = 8


def run_in_blocks(run: Callable[[range], object], count: int, threads: int, bar: Progress) -> None:
    """Call ``run`` with ranges that make up ``range(count)``; an interrupt stops the threads."""
    # A single thread needs blocks only to show how far it is.
    parts = 1 if threads == 1 and bar is silent() else BLOCKS_PER_THREAD * threads
    # A block has enough runs that they take their steps together, if each thread has some.
    size = max(min(TOGETHER, -(-count // threads)), -(-count // parts), 1)
    blocks = [range(i, min(i + size, count)) for i in range(0, count, size)]
    if threads > 1 and len(blocks) > 1:
        _in_threads(run, blocks, threads, bar)
        return
    for block in blocks:
        run(block)
        bar.update(len(block))


def _in_threads(run: Callable[[range], object], blocks: list[range], threads: int, bar: Progress) -> None:
    """Run all blocks; an interrupt in the main thread stops the others."""
    stop = threading.Event()

    def work(block: range) -> None:
        with stopped_by(stop):
            run(block)

    with ThreadPoolExecutor(threads) as pool:
        counts: dict[Future[None], int] = {pool.submit(work, block): len(block) for block in blocks}
        waiting = set(counts)
        try:
            while waiting:
                done, waiting = wait(waiting, timeout=LOOK)
                if CTRL_C.is_set():
                    stop.set()
                for future in done:
                    future.result()
                    bar.update(counts[future])
        finally:
            stop.set()
