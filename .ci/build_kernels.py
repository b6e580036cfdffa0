"""What building a wheel does besides packing files: it compiles the kernels, so that the first run need not.

By default for processors like this one, since most wheels are installed where they are built; with the
environment variable ``HYBRID_WHEEL=family`` for the older processors of its family, too. The file
``hybrid/machine_code/README.txt`` of a wheel says what its code is for.

An editable installation is left as it is: its kernels are compiled when a run first needs them. The same
holds for a wheel whose kernels could not be compiled, or are for a family of processors without a base.
"""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# Linux with a C library of 2014 or newer; wheels of the dependencies ask for a newer one.
GLIBC = "manylinux_2_17"
# What the compilation imports.
NEEDED = {"attrs", "cattrs", "llvmlite", "numba", "numpy", "platformdirs", "scipy", "tqdm"}


def _platform() -> str:
    """The platform in the name of a wheel: of the C library the code calls nothing but old functions."""
    name = re.sub(r"\W", "_", sysconfig.get_platform())
    return name.replace("linux", GLIBC, 1) if platform.libc_ver()[0] == "glibc" else name


class Kernels(BuildHookInterface):
    """Puts the machine code of the kernels into the wheel."""

    def dependencies(self) -> list[str]:
        """What the compilation needs of the package's own dependencies."""
        if self.target_name != "wheel":
            return []
        required = self.metadata.core.dependencies
        return [each for each in required if re.match(r"[\w-]+", each).group() in NEEDED]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the kernels; the files belong to this platform, and to any version of Python."""
        if version == "editable":
            return
        self._folder = tempfile.TemporaryDirectory()
        into = Path(self._folder.name) / "machine_code"
        wanted = ["--family"] if os.environ.get("HYBRID_WHEEL") == "family" else []
        done = subprocess.run(
            [sys.executable, "-m", "hybrid", "compile", "--portable", str(into), *wanted],
            cwd=self.root,
            env=os.environ | {"HYBRID_CACHE_DIR": str(into.parent / "cache")},
            check=False,
        )
        if done.returncode:
            self.app.display_warning("The wheel contains no compiled kernels: the first run compiles them.")
            return
        for path in sorted(into.iterdir()):
            build_data["force_include"][str(path)] = f"hybrid/{into.name}/{path.name}"
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{_platform()}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the compiled files, which the wheel contains now."""
        if version != "editable":
            self._folder.cleanup()
