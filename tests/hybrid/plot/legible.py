"""Whether the texts of a figure can be read: none leaves the figure, and none lies on another."""

from itertools import combinations

from matplotlib.text import Text

# Overlaps and overhangs below this many pixels are those of the empty margins of letters.
SLACK = 1.0


def illegible(figure):
    """The texts that leave the figure, and the pairs of texts that overlap, in words."""
    figure.draw_without_rendering()
    boxes = [(text.get_text(), text.get_window_extent()) for text in shown(figure)]
    outside = [f"{text!r} leaves the figure" for text, box in boxes if not within(box, figure.bbox)]
    pairs = combinations(boxes, 2)
    return outside + [f"{one!r} lies on {other!r}" for (one, a), (other, b) in pairs if overlap(a, b)]


def shown(figure):
    """The texts that are drawn: of ticks those within the limits."""
    hidden = set()
    for ax in figure.findobj(lambda each: hasattr(each, "xaxis")):
        for axis in (ax.xaxis, ax.yaxis):
            scale = axis.get_transform().transform
            low, high = sorted(scale(axis.get_view_interval()))
            margin = 1e-9 * (high - low)
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            out = [
                tick
                for tick in ticks
                if not low - margin <= scale(tick.get_loc()) <= high + margin or not ax.axison
            ]
            hidden.update(text for tick in out for text in (tick.label1, tick.label2))
            if not ax.axison:
                hidden.add(axis.label)
    return [
        each
        for each in figure.findobj(Text)
        if each not in hidden and each.get_visible() and each.get_text().strip() and drawn(each)
    ]


def drawn(text):
    """Whether a text has a place on the canvas."""
    box = text.get_window_extent()
    return box.width > 0 and box.height > 0


def within(box, canvas):
    """Whether a box lies on the canvas."""
    return (
        box.x0 >= canvas.x0 - SLACK
        and box.y0 >= canvas.y0 - SLACK
        and box.x1 <= canvas.x1 + SLACK
        and box.y1 <= canvas.y1 + SLACK
    )


def overlap(a, b):
    """Whether two boxes have more than a margin in common."""
    return min(a.x1, b.x1) - max(a.x0, b.x0) > SLACK and min(a.y1, b.y1) - max(a.y0, b.y0) > SLACK
