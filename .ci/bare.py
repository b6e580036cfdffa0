"""The main calls in an environment with the library, what it asks for, and nothing else.

``python .ci/bare.py FOLDER``: the environment is made in ``FOLDER``, and its packages are links to those of
this one. So nothing is downloaded, and what only an extra or a test brings is missing.
"""

from __future__ import annotations

import subprocess
import sys
import venv
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

CALLS = """
import hybrid
import lyapunov
import models
from hybrid.testing import check_system

ball, oscillator = models.bouncing_ball(), models.impact_oscillator()
arc = hybrid.simulate(ball, (1.0, 0.0), (0.0, 1.0))
hybrid.plot(arc)
hybrid.plot(ball)
assert len(arc.to_xarray().t) > 0
orbit = hybrid.periodic_orbit(oscillator, (0.9, 1.0))
hybrid.plot(hybrid.continue_orbit(orbit, "w", (0.95, 1.05)))
assert lyapunov.lyapunov_spectrum(oscillator, (0.9, 1.0), intervals=50).status.ok
assert check_system(ball, examples=2).properties

def needs(extra, call):
    try:
        call()
    except hybrid.HybridError as error:
        assert f"'.[{extra}]'" in str(error), error
    else:
        raise SystemExit(f"A call that needs the extra {extra!r} did without.")

needs("explore", lambda: hybrid.explore(ball, block=False))
needs("grid", lambda: hybrid.continue_all(orbit, "w", (0.95, 1.05), store="unwritten"))
"""


def needed(name: str) -> list[Distribution]:
    """What is installed here of a distribution and of all that it needs, without extras of its own."""
    found: dict[tuple[str, frozenset[str]], Distribution] = {}
    left = [(name, frozenset[str]())]
    while left:
        name, extras = wanted = left.pop()
        if wanted in found:
            continue
        try:
            found[wanted] = distribution(name)
        except PackageNotFoundError:
            # A dependency of another platform.
            continue
        for each in map(Requirement, found[wanted].requires or ()):
            if each.marker is None or any(each.marker.evaluate({"extra": extra}) for extra in ("", *extras)):
                left.append((each.name, frozenset(each.extras)))
    return list(found.values())


def link(found: Distribution, into: Path) -> None:
    """Link the packages and the metadata of a distribution into a folder."""
    for top in {path.parts[0] for path in found.files or ()} - {"..", "__pycache__"}:
        place = into / top
        if not place.exists():
            place.symlink_to(Path(str(found.locate_file(top))).resolve())


def main() -> None:
    """Make the environment, and run the calls in it."""
    folder = Path(sys.argv[1])
    venv.create(folder, symlinks=True)
    [packages] = folder.glob("lib/python*/site-packages")
    for each in needed("hybrid-systems"):
        link(each, packages)
    missing = {path.name for path in packages.iterdir()} & {"panel", "zarr", "pytest"}
    if missing:
        sys.exit(f"Packages of extras or of tests count as dependencies: {', '.join(missing)}.")
    sys.exit(subprocess.run([folder / "bin" / "python", "-I", "-c", CALLS], check=False).returncode)


if __name__ == "__main__":
    main()
