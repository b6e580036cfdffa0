"""Public names: what `import *` brings, and what it must leave alone."""

import builtins
import importlib

import pytest

import hybrid
import hybrid.plot
import models

PACKAGES = ("hybrid", "lyapunov", "models", "hybrid.measures", "hybrid.testing", "hybrid.plot")


@pytest.mark.parametrize("package", PACKAGES)
def test_no_public_name_shadows_a_builtin(package):
    names = {}
    exec(f"from {package} import *", names)
    shadowed = {name for name in names if hasattr(builtins, name) and not name.startswith("__")}
    assert not shadowed
    assert set(names) - {"__builtins__"} == set(importlib.import_module(package).__all__)


def test_all_packages_together_keep_the_function_plot():
    names = {}
    for package in ("hybrid", "hybrid.plot", "lyapunov", "models"):
        exec(f"from {package} import *", names)
    assert names["plot"] is hybrid.plot.plot
    assert names["open_store"] is hybrid.open_store


def test_the_module_plot_draws_what_it_is_called_with():
    from hybrid.plot import plot, plot_phase

    arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
    assert [ax.get_ylabel() for ax in hybrid.plot(arc)] == [ax.get_ylabel() for ax in plot(arc)]
    assert callable(plot_phase)
    with pytest.raises(hybrid.ArgumentError, match="result must be a system, an arc"):
        hybrid.plot(3)
