"""Geometry of the graph of a system: arrows, loops, labels and the frame around them."""

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

import models
from hybrid import After, At, Every, Guard, HybridSystem, Mode, Reset, Transition, simulate
from hybrid.plot import plot_graph, plot_jumps
from hybrid.plot.apart import CurveLabel, keep_apart, lay_out, point_on
from hybrid.plot.graph import FAN, SIZES
from hybrid.plot.styles import COLOURS
from tests.hybrid.plot.legible import illegible


def system(names, pairs, *, direction=1, reset=None, at_start=False):
    """Modes with one-letter names, and transitions given as ``ab``, numbered; ``a.`` ends the run."""
    return HybridSystem(
        state=("q",),
        modes=[Mode(name, lambda t, x, p: (1.0,)) for name in names],
        transitions=[
            Transition(
                a,
                None if b == "." else b,
                Guard(lambda t, x, p: x.q, direction, at_start=at_start),
                reset,
                name=f"{k}",
            )
            for k, (a, b) in enumerate(pairs)
        ],
    )


def modes(ax):
    """Places of the boxes of modes by name."""
    return {text.get_text(): np.array(text.get_position()) for text in ax.texts if len(text.get_text()) == 1}


def label(ax, name):
    [found] = [text for text in ax.texts if text.get_text().startswith(f"{name} ")]
    return found


def arrows(ax):
    """Start, end and bend of each arrow between boxes, in order."""
    return [
        (np.array(each.xyann), np.array(each.xy), float(each.arrowprops["connectionstyle"].split("rad=")[1]))
        for each in ax.texts
        if getattr(each, "arrowprops", None) is not None
    ]


@pytest.mark.parametrize(
    ("names", "along"), [("ab", 0.5), ("abc", 0.38), ("abcd", 0.38), ("abcde", 0.38), ("abcdefg", 0.38)]
)
def test_each_arrow_goes_from_source_to_target_and_its_label_is_on_it(names, along):
    """The arrow of matplotlib is a Bezier curve whose control point is off the middle by the bend."""
    pairs = [*zip(names, names[1:] + names[0], strict=True)]
    ax = plot_graph(system(names, pairs))
    ax.get_figure().draw_without_rendering()
    places = modes(ax)
    drawn = arrows(ax)
    assert len(drawn) == len(pairs)
    assert {bend for _, _, bend in drawn} == {0.28 if len(names) < 5 else 0.12}
    for k, ((a, b), (start, end, bend)) in enumerate(zip(pairs, drawn, strict=True)):
        np.testing.assert_array_equal(start, places[a])
        np.testing.assert_array_equal(end, places[b])
        across = end - start
        control = (start + end) / 2 + bend * np.array([across[1], -across[0]])
        on_curve = (1 - along) ** 2 * start + 2 * along * (1 - along) * control + along**2 * end
        np.testing.assert_allclose(label(ax, k).get_position(), on_curve, rtol=1e-12)
    patches = [each.arrow_patch for each in ax.texts if getattr(each, "arrowprops", None) is not None]
    for patch, (start, end, bend) in zip(patches, drawn, strict=True):
        [_, control, _] = patch.get_connectionstyle()(start, end, shrinkA=0, shrinkB=0).vertices
        np.testing.assert_allclose(
            control, (start + end) / 2 + bend * np.array([(end - start)[1], -(end - start)[0]])
        )


def test_arrows_between_the_same_modes_bend_apart():
    ax = plot_graph(system("ab", ["ab", "ab", "ab", "ba"]))
    assert [bend for *_, bend in arrows(ax)] == pytest.approx([0.28, 0.58, 0.88, 0.28])
    labels = [label(ax, k).get_position() for k in range(4)]
    distances = [np.hypot(*np.subtract(labels[i], labels[j])) for i in range(4) for j in range(i)]
    assert min(distances) > 0.1


def test_in_a_crowd_they_share_one_arrow_with_all_names():
    ax = plot_graph(system("abcde", ["ab", "ab", "ba", "cd", "de", "ea"]))
    assert len(arrows(ax)) == 5
    assert label(ax, 0).get_text() == "0 ↑\n1 ↑"


@pytest.mark.parametrize(("reset", "style"), [(None, "solid"), (Reset(lambda t, x, p: (0.0,)), "dashed")])
@pytest.mark.parametrize(("direction", "sign"), [(-1, "↓"), (0, "↕"), (1, "↑")])
def test_the_key_explains_what_is_drawn(reset, style, direction, sign):
    ax = plot_graph(system("ab", ["ab", "aa"], direction=direction, reset=reset))
    assert label(ax, 0).get_text() == f"0 {sign}"
    key = ax.texts[-1].get_text()
    assert ("either" in key) == (direction == 0)
    assert ("dashed" in key) == (reset is not None)
    [loop] = ax.patches
    assert (loop.get_linestyle() in ("-", "solid")) == (style == "solid")


def test_transitions_of_a_start_are_left_out_and_the_end_is_a_dot():
    assert not arrows(plot_graph(system("ab", ["ab", "aa"], at_start=True)))
    ax = plot_graph(system("a", ["a."]))
    [(start, end, _)] = arrows(ax)
    [dot] = [text for text in ax.texts if text.get_text() == " "]
    np.testing.assert_array_equal(end, dot.get_position())
    np.testing.assert_array_equal(start, modes(ax)["a"])
    assert abs(end[0] - start[0]) == pytest.approx(2.2)


class TestLoops:
    @pytest.mark.parametrize("count", [1, 2, 3])
    def test_loops_of_one_mode_fan_out_around_the_outward_direction(self, count):
        for names, outward in (("a", None), ("abc", "b")):
            mode = outward or "a"
            ring = [*zip(names, names[1:] + names[0], strict=True)] if len(names) > 1 else []
            ax = plot_graph(system(names, [(mode, mode)] * count + ring))
            at = modes(ax)[mode]
            middle = 90.0 if outward is None else np.degrees(np.arctan2(at[1], at[0]))
            wanted = middle + FAN * (np.arange(count) - (count - 1) / 2)
            for k, angle in enumerate(np.radians(wanted)):
                away = np.array(label(ax, k).xyann)
                out = away / np.hypot(*away)
                np.testing.assert_allclose(out, [np.cos(angle), np.sin(angle)], atol=1e-9)
                # The label is aligned so that it lies behind the loop, in both directions.
                across = "center" if abs(out[0]) < 0.4 else "left" if out[0] > 0 else "right"
                up = "center" if abs(out[1]) < 0.4 else "bottom" if out[1] > 0 else "top"
                assert (label(ax, k).get_ha(), label(ax, k).get_va()) == (across, up)

    def test_a_loop_leaves_and_enters_the_box_on_its_side(self):
        """Symmetric about its ray, in points; wide enough to see, and its label is at its far end."""
        ax = plot_graph(system("ab", ["aa", "ab"]))
        [loop] = ax.patches
        vertices = loop._path_original.vertices
        np.testing.assert_allclose(vertices[:, 0], [8.0, 34.0, -34.0, -8.0], atol=1e-9)
        np.testing.assert_allclose(vertices[[1, 2], 1], 63.0)
        # It enters where the ray leaves the box, and starts inside of the box.
        np.testing.assert_allclose(vertices[[0, 3], 1], [13.0, 17.0])
        assert label(ax, 0).xyann == pytest.approx((0.0, 57.0), abs=1e-9)
        shown = loop.get_transform().transform([(0.0, 0.0), (0.0, 72.0)])
        np.testing.assert_allclose(shown[0], ax.transData.transform(modes(ax)["a"]))
        assert shown[1, 1] - shown[0, 1] == pytest.approx(ax.get_figure().dpi)

    def test_the_box_of_a_long_name_is_wide(self):
        def foot(name, angle):
            names = [name, "b", "c"]
            ring = [*zip(names, ["b", "c", name], strict=True)]
            ax = plot_graph(system(names, [(name, name), *ring]))
            [loop] = ax.patches
            assert angle == pytest.approx(0.0)
            return loop._path_original.vertices[3, 0]

        # The first mode of three is at the right of the circle.
        assert foot("long name", 0.0) - foot("longer", 0.0) == pytest.approx(3 * 3.6)

    def test_labels_are_aligned_away_from_their_loops(self):
        ax = plot_graph(system("abcd", ["ab", "bc", "cd", "da", "aa", "bb", "cc", "dd"]))
        aligned = [(label(ax, k).get_ha(), label(ax, k).get_va()) for k in range(4, 8)]
        assert aligned == [("left", "center"), ("center", "bottom"), ("right", "center"), ("center", "top")]


def test_a_few_modes_are_on_a_circle_and_the_neighbours_of_many_are_near():
    """The ends of a chain of six modes are as far apart as the chain is long."""
    for names in ("abc", "abcd"):
        places = modes(plot_graph(system(names, [*zip(names, names[1:] + names[0], strict=True)])))
        turns = 2 * np.pi * np.arange(len(names)) / len(names)
        circle = np.column_stack([np.cos(turns), np.sin(turns)])
        np.testing.assert_allclose([places[name] for name in names], circle, atol=1e-6)
    places = modes(plot_graph(system("abcdef", ["ab", "bc", "cd", "de", "ef"])))
    step, whole = np.hypot(*(places["a"] - places["b"])), np.hypot(*(places["a"] - places["f"]))
    assert whole > 3.0 * step


@pytest.mark.parametrize("names", ["a", "ab", "abc", "abcd", "abcde", "abcdefgh"])
@pytest.mark.parametrize("loops", [False, True])
def test_everything_is_inside_of_the_frame(names, loops):
    pairs = [*zip(names, names[1:] + names[0], strict=True)] if len(names) > 1 else []
    ax = plot_graph(system(names, pairs + [(name, name) for name in names] * loops))
    figure = ax.get_figure()
    assert tuple(figure.get_size_inches()) == SIZES[min(len(names), 5) - 1]
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    places = np.array([*modes(ax).values()])
    (x0, y0), (x1, y1) = places.min(axis=0), places.max(axis=0)
    margin = 0.65 if loops or len(names) < 3 else 0.25
    # Loops of modes in a row are above them.
    above = margin + 0.35 * (loops and len(names) < 3)
    np.testing.assert_allclose([y0 - low, high - y1], [max(margin, 0.5), above])
    np.testing.assert_allclose([x0 - left, right - x1], 0.7 if len(names) < (5 if loops else 3) else 0.4)
    assert not ax.axison
    assert ax.get_aspect() == 1.0
    figure.draw_without_rendering()
    for patch in ax.patches:
        top = patch.get_window_extent().y1
        assert top < ax.transData.transform((left, high))[1] + 40.0


def test_boxes_have_the_colours_of_their_modes():
    ax = plot_graph(system("abc", ["ab", "bc", "ca"]))
    for k, name in enumerate("abc"):
        [box] = [text.get_bbox_patch() for text in ax.texts if text.get_text() == name]
        assert mpl.colors.to_hex(box.get_edgecolor()).upper() == COLOURS[k]


def test_the_label_of_a_clock_says_when_it_ticks():
    def row(a, b, guard, name):
        return Transition(a, b, guard, name=name)

    clocked = HybridSystem(
        state=("q",),
        parameters={"T": 0.5, "rest": 0.2},
        modes=[Mode(name, lambda t, x, p: (1.0,)) for name in "abc"],
        transitions=[
            row("a", "b", Every("T"), "tick"),
            row("b", "c", After("rest"), "recover"),
            row("c", "a", At([1.0, 2.0]), "listed"),
        ],
    )
    ax = plot_graph(clocked)
    texts = {text.get_text() for text in ax.texts}
    assert {"tick (every T)", "recover (after rest)", "listed (at 2 times)"} <= texts
    assert not any("guard" in text for text in texts)
    arc = simulate(clocked, (0.0,), (0.0, 3.0), mode="a")
    rows = plot_jumps(arc.jumps)
    assert [label.get_text() for label in rows.get_yticklabels()][:1] == ["tick (every T)"]


@pytest.mark.parametrize(
    "model", [models.stick_slip, models.boost_converter, models.chua_circuit, models.delayed_neurons]
)
@pytest.mark.parametrize("chosen", [None, "paper"])
def test_labels_of_edges_are_apart_and_on_the_figure(model, chosen):
    assert illegible(plot_graph(model(), style=chosen).figure) == []


def test_labels_that_need_not_move_stay():
    """Of three arrows the third has no place of its own: its label alone is moved."""
    figure, ax = plt.subplots()
    ax.set(xlim=(-1.0, 2.0), ylim=(-1.0, 1.0))
    flat = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    curves = [flat, flat + np.array([0.0, 0.5]), flat + np.array([0.0, 1e-3])]
    labels = [CurveLabel(ax.text(*point_on(curve, 0.5), "a"), curve, 0.5) for curve in curves]
    lay_out(ax)
    keep_apart(ax, labels, [])
    places = [label.text.get_position() for label in labels]
    assert places[1] == pytest.approx((0.5, 0.5))
    assert illegible(figure) == []
    for (x, _), curve in zip(places, curves, strict=True):
        assert curve[0, 0] < x < curve[2, 0]
