"""The main calls in an environment with a wheel of the library, what it asks for, and nothing else.

``python .ci/bare.py FOLDER WHEEL ...``: each wheel gets an environment in ``FOLDER``, in which other packages
are links to those of this one. So nothing is downloaded, and what only an extra or a test brings is missing.
The calls run with an empty cache, as on this machine and as on older ones that the wheel has kernels for.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import venv
from contextlib import suppress
from importlib.metadata import Distribution, PackageNotFoundError, distribution, distributions
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


# The first run from a wheel needs no compiler of kernels.
FIRST = """
import sys
import hybrid
import models

assert hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0)).status.ok
if "numba" in sys.modules:
    raise SystemExit("The first run from the wheel compiled kernels that the wheel should contain.")
"""


def needed(wanted: Distribution) -> list[Distribution]:
    """What is installed here of all that a distribution needs, without extras of its own."""
    found: dict[tuple[str, frozenset[str]], Distribution] = {}
    left = [(wanted, frozenset[str]())]
    while left:
        current, extras = left.pop()
        for each in map(Requirement, current.requires or ()):
            if each.marker is None or any(each.marker.evaluate({"extra": extra}) for extra in ("", *extras)):
                key = (each.name, frozenset(each.extras))
                # A dependency of another platform is not installed.
                with suppress(PackageNotFoundError):
                    if key not in found:
                        found[key] = distribution(each.name)
                        left.append((found[key], key[1]))
    return list(found.values())


def link(found: Distribution, into: Path) -> None:
    """Link the packages and the metadata of a distribution into a folder."""
    for top in {path.parts[0] for path in found.files or ()} - {"..", "__pycache__"}:
        place = into / top
        if not place.exists():
            place.symlink_to(Path(str(found.locate_file(top))).resolve())


def environment(folder: Path, wheel: Path) -> Path:
    """Make an environment with a wheel; returns its folder of packages."""
    venv.create(folder, symlinks=True)
    [packages] = folder.glob("lib/python*/site-packages")
    options = ["--quiet", "--no-deps", "--target", str(packages)]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, str(wheel)], check=True)
    [installed] = distributions(name="hybrid-systems", path=[str(packages)])
    for each in needed(installed):
        link(each, packages)
    missing = {path.name for path in packages.iterdir()} & {"panel", "zarr", "pytest"}
    if missing:
        sys.exit(f"Packages of extras or of tests count as dependencies: {', '.join(missing)}.")
    return packages


def run(folder: Path, calls: str, **variables: str) -> None:
    """Run calls in an environment; an error ends this process."""
    done = subprocess.run(
        [folder / "bin" / "python", "-I", "-c", calls], env=os.environ | variables, check=False
    )
    if done.returncode:
        sys.exit(done.returncode)


def try_out(wheel: Path, folder: Path) -> None:
    """Run the calls from a wheel, as this machine does and as older processors that it has kernels for."""
    shutil.rmtree(folder, ignore_errors=True)
    packages = environment(folder, wheel)
    readme = packages / "hybrid" / "machine_code" / "README.txt"
    if not readme.exists():
        sys.exit(f"{wheel.name} contains no compiled kernels.")
    names = re.findall(r"^(\S+): ", readme.read_text(encoding="utf-8"), re.MULTILINE)
    # This machine takes the first kernels, unless it is older itself.
    for name in ("", *names[1:]):
        cache = str(folder / f"cache-{name}")
        run(folder, FIRST, HYBRID_CPU=name, HYBRID_CACHE_DIR=cache)
        run(folder, CALLS, HYBRID_CPU=name, HYBRID_CACHE_DIR=cache)
        if any(Path(cache).glob("kernels-*")):
            sys.exit(f"{wheel.name} has compiled kernels for {name or 'this processor'}.")
    print(f"{wheel.name} runs, with kernels for {', '.join(names)}.")


def main() -> None:
    """Try out each wheel."""
    folder, *wheels = map(Path, sys.argv[1:])
    for wheel in wheels:
        try_out(wheel, folder / wheel.stem)


if __name__ == "__main__":
    main()
