"""Modes and guards in place of the kinks and jumps inside of model functions."""

from __future__ import annotations

from hybrid.system.graph import HybridSystem, as_system


def split(system: HybridSystem) -> HybridSystem:
    """The system in which every kink and jump inside a model function has become modes and guards."""
    as_system("system", system)
    from hybrid.transform.splitter import Splitter

    return Splitter(system).begin()
