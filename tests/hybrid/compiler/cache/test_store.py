"""Results of tracing, read back from the folder of stored models."""

import attrs
import pytest

from hybrid.compiler.cache import store
from hybrid.compiler.cache.folder import keep
from hybrid.compiler.emit import emit
from tests.hybrid.systems import BALL_SYSTEM, OSCILLATOR_SYSTEM


def stored(emitted):
    """What of the results is stored: the statements of series only serve to write their text."""
    series = (attrs.evolve(each.series, statements=(), tangent_statements=()) for each in emitted.propagators)
    pairs = zip(emitted.propagators, series, strict=True)
    return attrs.evolve(emitted, propagators=tuple(attrs.evolve(each, series=kept) for each, kept in pairs))


@pytest.mark.parametrize("system", [BALL_SYSTEM, OSCILLATOR_SYSTEM], ids=["ball", "oscillator"])
def test_what_was_traced_is_read_back(system, monkeypatch, tmp_path):
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(tmp_path))
    emitted = emit(system)
    assert store.read("operations") is None
    store.write("operations", emitted)
    assert store.read("operations") == stored(emitted)
    assert store.read("other operations") is None


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"{}", b'{"programs": 1}'])
def test_what_does_not_describe_a_model_is_traced_again(content, monkeypatch, tmp_path):
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(tmp_path))
    keep(store.models_folder() / store._file("operations"), content)
    assert store.read("operations") is None
