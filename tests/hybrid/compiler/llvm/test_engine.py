"""The processor that code is made for."""

import pytest

from hybrid.compiler.llvm import engine


@pytest.mark.parametrize("name", ["x86-64", "x86-64-v2", "generic"])
def test_the_processor_can_be_named(name, monkeypatch):
    """Nothing that this machine has besides is used, and the code is kept apart from other code."""
    monkeypatch.delenv("HYBRID_CPU", raising=False)
    engine.processor.cache_clear()
    here = engine.processor()
    monkeypatch.setenv("HYBRID_CPU", name)
    engine.processor.cache_clear()
    try:
        assert engine.cpu() == (name, "")
        assert engine.processor().split()[1:] == [name]
        assert engine.processor() != here
    finally:
        engine.processor.cache_clear()
