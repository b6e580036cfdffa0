"""The bifurcation diagram, which is computed a few columns at a time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

import lyapunov
from hybrid.display.tables import counted
from hybrid.explorer.calls import Call, Written
from hybrid.explorer.pictures import start_of, surface_of, values_key
from hybrid.explorer.scene import JUMPS, PERIOD, Scene
from hybrid.explorer.subject import Subject
from hybrid.explorer.worker import Job
from hybrid.status import StatusCode

if TYPE_CHECKING:
    import xarray

# Intervals of the exponents of each column, and its points.
COLUMN_INTERVALS, COLUMN_TRANSIENT, COLUMN_POINTS = 200, 200, 60
# Columns that are computed at once.
AT_ONCE = 4
NO_PARAMETER = (
    "the model has no parameter to draw it over. Give it one: HybridSystem(parameters={...}), and read it in "
    "the functions of the model as p.name."
)
ELSEWHERE = "Choose another section, or another level, under 'Section and portrait'."


def diagram_call(subject: Subject, scene: Scene) -> Call:
    """The call that makes the bifurcation diagram with the largest exponent below."""
    values = np.linspace(scene.low, scene.high, scene.columns)
    text = f"np.linspace({scene.low!r}, {scene.high!r}, {scene.columns})"
    others = {name: value for name, value in scene.values.items() if name != scene.over}
    known = {PERIOD: None, JUMPS: "jumps"}
    at = known[scene.section] if scene.section in known else surface_of(subject, scene)
    keywords = {
        **start_of(subject, scene.with_(values=others)),
        "intervals": COLUMN_INTERVALS,
        "transient": COLUMN_TRANSIENT,
        "section": COLUMN_POINTS,
        "at": at,
        "outputs": [scene.across] if scene.across in subject.system.outputs else None,
    }
    system = Written(subject.system, "system")
    return Call("diagram", lyapunov.chart, (system, {scene.over: Written(values, text)}, scene.x0), keywords)


def diagram_job(subject: Subject, scene: Scene) -> Job:
    """Columns of the diagram, first a few over the whole range, then those between them."""
    call = diagram_call(subject, scene)
    system, over, x0 = call.arguments
    values = over[scene.over].value

    def some(part: np.ndarray) -> Callable[[], Any]:
        some_call = attrs.evolve(call, arguments=(system, {scene.over: values[part]}, x0))
        return lambda: (scene, some_call.result(progress=False))

    order = coarse_to_fine(scene.columns)
    parts = tuple(some(order[i : i + AT_ONCE]) for i in range(0, len(order), AT_ONCE))
    key = values_key(scene, "columns", "section", "level"), call.keywords["outputs"] and scene.across
    return Job("diagram", key, parts)


def coarse_to_fine(count: int) -> np.ndarray:
    """The numbers 0 to ``count - 1``, each next one far from those before."""
    bits = max(1, (count - 1).bit_length())
    turned = [int(f"{i:0{bits}b}"[::-1], 2) for i in range(2**bits)]
    return np.array([each for each in turned if each < count])


def joined(scene: Scene, charts: Sequence[xarray.Dataset]) -> xarray.Dataset:
    """The columns that have been computed, as one chart over the parameter."""
    import xarray as xr

    whole = xr.concat(charts, dim=scene.over, data_vars="all", coords="minimal", compat="override")
    return whole.sortby(scene.over)


def remark(scene: Scene, charts: Sequence[xarray.Dataset]) -> str:
    """What is to be said of the columns so far: why there are none, or why some are missing."""
    codes = np.concatenate([each.status.values for each in charts])
    early = codes != StatusCode.SUCCESS
    drawn = any("section" in each and np.isfinite(each.section.values).all(axis=-1).any() for each in charts)
    passes = "jumps" if scene.section == JUMPS else "passes the section"
    if not early.any():
        return "" if drawn else f"it has no column, since no run {passes}. {ELSEWHERE}"
    at = np.concatenate([each[scene.over].values for each in charts])
    texts = [str(text) for each in charts for text in each.message.values]
    # The usual reason, where it is met first.
    usual = Counter(codes[early].tolist()).most_common(1)[0][0]
    first = next((i for i in np.flatnonzero(codes == usual) if texts[i]), int(np.argmax(codes == usual)))
    beyond = bool((codes[early] == StatusCode.START_BEYOND).any())
    what = "ended early or began beyond a guard" if beyond else "ended early"
    if not drawn and early.all():
        head = f"it has no column, since every run {what}"
    elif not drawn:
        head = f"it has no column: {counted(int(early.sum()), 'run')} {what}, and no other {passes}"
    else:
        head = f"{counted(int(early.sum()), 'column')} {what}"
    return f"{head}; at {scene.over} = {at[first]:.6g}: {texts[first] or StatusCode(usual).name}"
