"""What is found of a system and written for it: stored by an earlier process, or made now."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybrid.compiler.cache import store
from hybrid.compiler.traced import key_of

if TYPE_CHECKING:
    from hybrid.compiler.emitted import Emitted
    from hybrid.system.graph import HybridSystem


def emitted_of(system: HybridSystem) -> Emitted:
    """The result of `emit` for a system, computed now or stored by an earlier process."""
    traces = {} if system.growth is None else system.growth.written
    key = key_of(system, traces)
    found = None if key is None else store.read(key)
    if found is not None:
        return found
    # What derives and writes is imported only now.
    from hybrid.compiler.emit import emit

    emitted = emit(system, traces)
    if key is not None and not emitted.opaque:
        store.write(key, emitted)
    return emitted


def text_of(system: HybridSystem, part: str) -> str:
    """The text of a part that was left out, written now or stored by an earlier process."""
    assert system.growth is not None
    key = key_of(system, system.growth.written)
    assert key is not None, "what is not traced leaves nothing out"
    found = store.read_text(key, part)
    if found is None:
        from hybrid.compiler import emit

        found = emit.text_of(system, part)
        store.write_text(key, part, found)
    return found
