"""One jump of the arc in words and numbers."""

from __future__ import annotations

from html import escape

from hybrid.display.tables import html_table
from hybrid.simulation.jumps import Jump
from hybrid.system.graph import HybridSystem


def described_jump(jump: Jump, system: HybridSystem, count: int) -> str:
    """HTML about a jump: which guard fired, how fast it was crossed, and what it does to tangent vectors."""
    names = system.state_names
    target = jump.target or "the end"
    head = (
        f"<p><b>Jump {jump.j + 1} of {count}: {escape(jump.transition)}</b>, {escape(jump.source)} to "
        f"{escape(target)}, at t = {jump.t:.8g}. Transversality {jump.transversality:.6g} ({jump.kind}).</p>"
    )
    states = [
        ["before", *(f"{value:.6g}" for value in jump.x_minus)],
        ["after", *(f"{value:.6g}" for value in jump.x_plus)],
    ]
    matrix = [
        [name, *(f"{value:.6g}" for value in row)] for name, row in zip(names, jump.saltation, strict=True)
    ]
    return (
        head
        + html_table(("state", *names), states)
        + "<p>Saltation matrix</p>"
        + html_table(("", *names), matrix)
    )
