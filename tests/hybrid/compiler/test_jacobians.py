"""Statements of sparse matrices: which cells they write."""

from hybrid.compiler.jacobians import MANY_ZEROS, slope_columns, without_zeros, zeros_first

WRITTEN = ["out[0, 0] = 0.0", "out[0, 1] = x[1]", "out[0, 2] = 0.0", "out[1, 0] = 10.0", "out[1, 2] = t"]


def test_columns_of_the_state_by_row():
    """The last column is that of time, and a statement for a common subexpression writes no cell."""
    assert slope_columns(["x0 = x[0]*out[1, 1]", *WRITTEN], 2) == ((0, 1), (0,))
    assert slope_columns(["out[11, 10] = 1.0"], 12) == (*[()] * 11, (10,))
    assert slope_columns([], 2) == ((), ())


def test_zeros_of_the_time_are_written():
    assert without_zeros(WRITTEN, 2) == [each for each in WRITTEN if each != "out[0, 0] = 0.0"]


def test_many_zeros_are_a_loop():
    few = [f"out[{i}, 0] = 0.0" for i in range(MANY_ZEROS - 1)]
    assert zeros_first([*few, "out[0, 1] = x[1]"], 60) == [*few, "out[0, 1] = x[1]"]
    many = [*few, "out[0, 1] = x[1]", "out[59, 60] = 0.0"]
    lines = zeros_first(many, 60)
    assert lines[-1] == "out[0, 1] = x[1]"
    assert len(lines) == 4
    written = set()

    class Out(dict):
        def __setitem__(self, cell, value):
            written.add((cell, value))

    exec("\n".join(lines), {"out": Out(), "x": [0.0, 7.0]})
    cells = {((i, j), 0.0) for i in range(60) for j in range(61)}
    assert written == cells | {((0, 1), 7.0)}
