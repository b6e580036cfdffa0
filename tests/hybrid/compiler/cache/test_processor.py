"""Kernels are compiled for the processor under whose name they are kept, also if numba was there before."""

import os
import subprocess
import sys

import pytest

CHOOSE = "from hybrid.compiler.cache.loader import import_numba; import_numba()"


def run(program, **others):
    return subprocess.run(
        [sys.executable, "-c", program],
        env={
            **os.environ,
            "HYBRID_CPU": "x86-64",
            **others,
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        },
        capture_output=True,
        text=True,
        timeout=300,
    )


@pytest.mark.parametrize("before", ["", "import numba; "])
def test_the_chosen_processor_counts_for_numba_imported_before(before):
    made = "t.target_context.codegen().magic_tuple()[1:]"
    tell = f"from numba.core.registry import cpu_target as t; print({made})"
    result = run(f"{before}{CHOOSE}; {tell}")
    assert result.stdout.split() == ["('x86-64',", "'')"], result.stderr


def test_numba_that_has_compiled_for_this_machine_is_refused(tmp_path):
    compile_one = (
        "from hybrid.compiler.cache.loader import load_kernels; load_kernels('hybrid.kernels.evaluate')"
    )
    result = run(
        f"import numba; numba.njit('f8(f8)')(lambda x: x + 1.0); {compile_one}",
        HYBRID_CACHE_DIR=str(tmp_path),
    )
    assert result.returncode != 0
    assert "python -m hybrid compile" in result.stderr
