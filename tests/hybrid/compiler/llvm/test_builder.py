"""Writing instructions keeps nothing of a module that nobody holds any more."""

import gc

from llvmlite import ir

from hybrid import HybridSystem, Mode, simulate
from hybrid.compiler.llvm import functions


def types_alive():
    gc.collect()
    # A weak proxy among the objects would ask for the class of what is gone.
    return sum(issubclass(type(each), ir.Type) for each in gc.get_objects())


def test_types_of_dropped_modules_are_freed(monkeypatch):
    # Nothing comes from an earlier process.
    monkeypatch.setattr(functions, "kept_of_model", lambda *given: None)

    def run(rates):
        for rate in rates:
            decay = HybridSystem(state=("q",), modes=[Mode("a", lambda t, x, p, r=rate: (-r * x.q**3,))])
            simulate(decay, (1.0,), (0.0, 0.1))

    run([0.7253])
    before = types_alive()
    run([0.7254, 0.7255])
    assert types_alive() == before
