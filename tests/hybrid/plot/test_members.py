"""Members of a repeat in pictures: one row of an arc, one row of jumps, one arrow of a graph."""

import matplotlib as mpl
import numpy as np

mpl.use("Agg")


from hybrid import Every, Guard, HybridSystem, Mode, Reset, Transition, repeat, simulate
from hybrid.plot import plot_arc, plot_graph, plot_jumps, plot_phase


def pack(count):
    cells = repeat(
        "cell",
        count,
        state=("u",),
        parameters={"rate": [1.0 + 0.1 * i for i in range(count)]},
        units={"u": "V"},
        field=lambda t, x, p, i: {"u": p.cell[i].rate},
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p, i: x.cell[i].u - 1.0, +1),
                Reset(lambda t, x, p, i: {"u": 0.0}),
                name="fire",
            ),
            Transition("run", "run", Every("rate"), name="tick"),
        ],
    )
    return HybridSystem(
        state=("q",),
        repeats=[cells],
        modes=[Mode("run", lambda t, x, p: (1.0,))],
        transitions=[Transition("run", None, Guard(lambda t, x, p: x.q - 9.0, +1), name="done")],
    )


def run(count):
    return simulate(pack(count), {"q": 0.0, "cell.u": 0.0}, (0.0, 3.05))


def listed(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_the_members_share_a_row_with_a_colour_each():
    arc = run(12)
    axes = plot_arc(arc)
    assert [ax.get_ylabel() for ax in axes] == ["q", "cell.u (V)"]
    assert listed(axes[1]) == ["cell[0]", "cell[11]"]
    curves = [line for line in axes[1].lines if line.get_linestyle() == "-"]
    assert len({line.get_color() for line in curves}) == len(curves) == 12
    for i, line in enumerate(curves):
        t, u = line.get_data()
        known = ~np.isnan(u) & (np.abs(t[:, None] - arc.jumps.t).min(axis=1) > 1e-9)
        np.testing.assert_allclose(u[known], (1.0 + 0.1 * i) * t[known] % 1.0, atol=1e-9)


def test_a_few_members_are_all_listed_and_one_is_drawn_as_any_component():
    arc = run(3)
    both, one = plot_arc(arc, ["cell.u", "cell[1].u"])
    assert listed(both) == ["cell[0]", "cell[1]", "cell[2]"]
    assert one.get_legend() is None
    assert one.get_ylabel() == "cell[1].u (V)"
    assert plot_phase(arc, "cell[0].u", "cell[1].u").get_xlabel() == "cell[0].u (V)"


def test_the_jumps_of_members_are_lines_of_one_row():
    arc = run(4)
    ax = plot_jumps(arc.jumps)
    assert [label.get_text() for label in ax.get_yticklabels()] == [
        "cell.fire",
        "cell.tick (every cell.rate)",
    ]
    heights = {float(line.get_ydata()[0]): len(line.get_xdata()) for line in ax.lines}
    assert len(heights) == 8
    counts = [len(arc.jumps[f"cell[{i}].{name}"]) for name in ("fire", "tick") for i in range(4)]
    assert [heights[y] for y in sorted(heights)] == counts
    low, high = sorted(ax.get_ylim())
    assert low < min(heights) < max(heights) < high


def test_the_transitions_of_members_share_an_arrow():
    ax = plot_graph(pack(12))
    labels = {" ".join(text.get_text().split()) for text in ax.texts}
    assert {"done ↑", "cell.fire ×12 ↑", "cell.tick ×12 (every cell.rate)"} <= labels
    assert not any("cell[" in label for label in labels)
