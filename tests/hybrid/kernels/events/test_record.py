"""What is written of a step before its polynomial, as plain Python."""

from types import SimpleNamespace

import numpy as np

from hybrid.kernels.events import record
from tests.hybrid.kernels.plain import plain


def test_steps_are_written_one_after_the_other():
    names = ("phase", "low", "length", "cycle", "mode", "jumps")
    written = SimpleNamespace(steps=1, **{f"step_{name}": np.zeros(4) for name in names})
    run = SimpleNamespace(phase_low=0.25, cycle=7, mode=2, jumps=5)
    for slot in (1, 2):
        assert plain(record).start_record(run, written, 3.0 + slot, 0.5) == slot
        assert written.steps == slot + 1
    for name, value in zip(
        names, ([4.0, 5.0], [0.25] * 2, [0.5] * 2, [7] * 2, [2] * 2, [5] * 2), strict=True
    ):
        assert getattr(written, f"step_{name}").tolist() == [0.0, *value, 0.0]
