"""Settings of all tests: the same examples each time, no deadlines, no display."""

import gc
import os
from contextlib import suppress

from hypothesis import HealthCheck, settings

from hybrid.compiler.cache.loader import import_numba

os.environ.setdefault("MPLBACKEND", "Agg")

# Tracing makes many small objects. Fewer searches for garbage among them save processor time.
gc.set_threshold(20_000, 20, 20)

pytest_plugins = ["tests.alone", "tests.nudge"]

if os.environ.get("HYBRID_CPU"):
    # Numba compiles for one processor in a process: for the chosen one, before a test calls it.
    import_numba()


def pytest_addoption(parser):
    parser.addoption(
        "--browser",
        action="store_true",
        help="tests in a browser fail where there is none, instead of being skipped",
    )


# A first example may compile a kernel, so deadlines and slowness checks are switched off.
settings.register_profile(
    "ci",
    derandomize=True,
    deadline=None,
    max_examples=50,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("ci")

# Hypothesis also draws numbers that it finds in the modules which a process has imported so far. So the
# examples of a test would depend on which tests ran in its process before.
with suppress(ImportError, AttributeError):
    from hypothesis.internal.conjecture import providers

    providers.is_local_module_file = lambda path: False
