"""Time of a first use: the program of docs/newcomer.md, from start to its Lyapunov spectrum."""

from __future__ import annotations

import re
from tempfile import TemporaryDirectory

from benchmarks.common import ROOT, Process, fastest_process, fresh_process, heading, table

PAGE = ROOT / "docs" / "newcomer.md"
# The same program with another friction law, and thus a new model.
LINE, OTHER_LINE = "link - direction * p.F", "link - direction * p.F - 0.01 * x.v2"


def program() -> str:
    """The first two Python blocks of the page: the model and its spectrum."""
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    return "\n".join(blocks[:2])


def main() -> None:
    heading("Seconds of whole processes, from the start of the interpreter to the spectrum of 1000 periods.")
    rows = []

    def report(what: str, process: Process) -> None:
        rows.append([what, f"{process.wall:.1f}", f"{process.processor:.1f}"])

    with TemporaryDirectory() as folder:
        cache, model = {"HYBRID_CACHE_DIR": folder}, program()
        report("the first run ever", fresh_process(model, cache))
        report("the second run", fastest_process(model, cache))
        report("the first run of another model", fresh_process(model.replace(LINE, OTHER_LINE), cache))
    table(["", "wall clock", "processor"], rows)


if __name__ == "__main__":
    main()
