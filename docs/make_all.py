"""Draw every picture of the README, the documentation and the benchmarks anew: ``python docs/make_all.py``.

``--output docs`` replaces the pictures of the pages. All benchmarks together take hours; ``--only`` names
those that are wanted.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
# What draws each picture or group of pictures.
COMMANDS = {
    "pictures": [str(HERE / "make_pictures.py")],
    "basins": [str(HERE / "make_basins.py")],
    "theory": [str(HERE / "make_theory.py")],
    "explore": [str(HERE / "make_explore.py")],
    "gallery": [str(HERE / "make_gallery.py")],
    "resonance": [str(HERE / "make_resonance.py")],
    "architecture": [str(HERE / "make_architecture.py")],
    "founding_chart": [str(HERE / "make_founding_chart.py")],
    "order": ["-m", "benchmarks.order"],
    "work_precision": ["-m", "benchmarks.work_precision"],
    "contact_laws": ["-m", "benchmarks.contact_laws"],
    "exponents": ["-m", "benchmarks.exponents"],
    "grazing_diagram": ["-m", "benchmarks.grazing_diagram"],
    "plain_equations": ["-m", "benchmarks.plain_equations"],
    "papers_table": ["-m", "benchmarks.papers_table", "figure"],
    "stability": ["-m", "benchmarks.stability"],
}
# These take the file of their picture, and draw it only if they are asked to.
FILES = {
    "abreast": "benchmarks.abreast",
    "compile_time": "benchmarks.compile_time",
    "adversarial": "benchmarks.adversarial",
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the pictures")
    parser.add_argument("--only", nargs="+", choices=[*COMMANDS, *FILES], help="by default all")
    arguments = parser.parse_args()
    folder = arguments.output.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    commands = {name: [*command, "--output", str(folder)] for name, command in COMMANDS.items()}
    commands |= {
        name: ["-m", module, "--picture", str(folder / f"{name}.png")] for name, module in FILES.items()
    }
    failed = [
        name
        for name in arguments.only or commands
        if subprocess.run([sys.executable, *commands[name]], cwd=HERE.parent, check=False).returncode
    ]
    if failed:
        sys.exit(f"These were not drawn: {', '.join(failed)}.")


if __name__ == "__main__":
    main()
