"""What a task may return, and results as columns, in memory and as bytes."""

import numpy as np
import pytest
import xarray

from hybrid import ArgumentError, ModelError, Status, StatusCode
from hybrid.sweep.outcome import Batch, attempt, outcome_of, text_of
from hybrid.sweep.parts import DamagedError, read_part, written
from hybrid.sweep.points import as_points
from hybrid.sweep.sheet import Labels, Sheet

MIXED = {
    "real": 1.5,
    "whole": 3,
    "flag": True,
    "complex": 1 + 2j,
    "text": "word",
    "row": np.array([1, 2]),
    "grid": np.array([[1j, 2.0]]),
    "words": np.array(["a", "bc"]),
}


class TestOutcome:
    def test_kinds_and_shapes_of_values(self):
        found = outcome_of(MIXED)
        assert found.schema.columns == (
            ("real", (), "f"),
            ("whole", (), "f"),
            ("flag", (), "f"),
            ("complex", (), "c"),
            ("text", (), "s"),
            ("row", (2,), "f"),
            ("grid", (1, 2), "c"),
            ("words", (2,), "s"),
        )
        assert found.status.code == StatusCode.SUCCESS
        assert found.values[5].dtype == float

    def test_a_status_is_not_a_value(self):
        status = Status(StatusCode.NOT_CONVERGED, "no", "try")
        found = outcome_of({"status": status, "y": 1.0})
        assert found.status is status
        assert found.schema.columns == (("y", (), "f"),)
        assert text_of(status) == "no try"
        assert text_of(Status(StatusCode.SUCCESS, "well")) == "well"

    @pytest.mark.parametrize(
        "result", [None, 3, [1.0], {"y": None}, {"y": [[1.0], [1.0, 2.0]]}, {"status": 1.0}, {3: 1.0}]
    )
    def test_results_that_are_none(self, result):
        with pytest.raises(ArgumentError, match="task"):
            outcome_of(result)

    def test_datasets_have_labels(self):
        data = xarray.Dataset(
            {"y": ("k", [1.0, 2.0], {"units": "m"}), "status": ((), 0)},
            {"k": ("k", [5, 6]), "scalar": 3.0},
        )

        class Result:
            status = Status(StatusCode.NOT_CONVERGED, "no")

            def to_xarray(self):
                return data

        for result, code in ((data, StatusCode.SUCCESS), (Result(), StatusCode.NOT_CONVERGED)):
            found = outcome_of(result)
            assert found.status.code == code
            assert found.schema.columns == (("y", (2,), "f"),)
            labels = Labels.read(found.schema.labels)
            assert labels == Labels({"y": ("k",)}, {"k": (("k",), [5, 6])}, {"y": {"units": "m"}})

    @pytest.mark.parametrize(
        ("failure", "code", "text"),
        [
            (MemoryError("full"), StatusCode.NOT_RUN, "MemoryError: full. Call again"),
            (OSError("gone"), StatusCode.NOT_RUN, "OSError: gone. Call again"),
            (ModelError("wrong"), StatusCode.FAILED, "wrong"),
            (ValueError("bad"), StatusCode.FAILED, "ValueError: bad"),
        ],
    )
    def test_failures_of_the_machine_are_tried_again_and_others_are_not(self, failure, code, text):
        def task(a, b):
            assert (a, b) == (1, 2)
            raise failure

        found = attempt(task, 1, 2)
        assert (found.schema, found.values, found.status.code) == (None, [], code)
        assert found.status.message.startswith(text)


def parts_of(*results):
    batch = Batch()
    for row, result in results:
        batch.add(row, attempt(lambda result=result: result))
    assert batch.count == len(results)
    parts = batch.taken()
    assert batch.count == 0
    assert batch.taken() == []
    return parts


class TestParts:
    def test_results_of_one_schema_are_together(self):
        one, other, failed = parts_of((4, {"y": 1.0}), (2, {"z": 2.0}), (7, {"y": 3.0}), (1, None))
        assert (one.rows.tolist(), one.columns[0].tolist()) == ([4, 7], [1.0, 3.0])
        assert (other.rows.tolist(), other.columns[0].tolist()) == ([2], [2.0])
        assert (failed.schema, failed.codes.tolist()) == (None, [StatusCode.FAILED])
        moved = one.at(np.array([9, 8, 7]), np.array([1, 0, 1]))
        assert (moved.rows.tolist(), moved.columns[0].tolist()) == ([9, 8, 7], [3.0, 1.0, 3.0])

    def test_a_part_is_read_as_it_was_written(self, tmp_path):
        other = {**MIXED, "real": np.nan, "text": "", "words": np.array(["bc", "bc"])}
        for part in parts_of((0, MIXED), (1, other)) + parts_of((0, None), (1, None)):
            keys, path = [b"\x00\x01", b"\xff"], tmp_path / "part"
            path.write_bytes(written(part, keys))
            found_keys, found = read_part(path)
            assert found_keys == keys
            assert found.schema == part.schema
            assert (found.rows.tolist(), found.messages) == ([0, 1], part.messages)
            np.testing.assert_array_equal(found.codes, part.codes)
            for a, b in zip(found.columns, part.columns, strict=True):
                assert (a.dtype, a.shape) == (b.dtype, b.shape)
                np.testing.assert_array_equal(a, b)

    def test_a_part_in_which_one_byte_differs_is_damaged(self, tmp_path):
        [part] = parts_of((0, {"y": 1.0}))
        content, path = written(part, [b"k"]), tmp_path / "part"
        for place in (0, 5, len(content) // 2, len(content) - 1):
            path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
            with pytest.raises(DamagedError):
                read_part(path)


class TestSheet:
    def sheet(self, *results, over=None):
        sheet = Sheet(as_points(over or {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0]}))
        for part in parts_of(*results):
            sheet.put(part)
        return sheet

    def test_points_that_are_missing(self):
        sheet = self.sheet((1, {"y": 1.0}), (3, None))
        assert sheet.untouched().tolist() == [True, False, True, False, True, True]
        data = sheet.dataset(Labels(), {"made": "here"})
        assert data.attrs == {"made": "here"}
        np.testing.assert_array_equal(data.y, [[np.nan, 1.0, np.nan], [np.nan] * 3])
        assert data.status.values.ravel().tolist() == [102, 0, 102, 106, 102, 102]
        assert "Call again" in str(data.message.values[0, 0])
        assert data.status.attrs["flag_meanings"].split()[:1] == ["SUCCESS"]
        assert len(data.status.attrs["flag_values"]) == len(StatusCode)

    def test_results_unlike_those_of_the_first_point_have_failed(self):
        """The first point of the sweep counts, not the first that was computed."""
        sheet = self.sheet((5, {"z": 2.0}), (4, {"y": np.ones(2)}), (0, {"y": 1.0}))
        data = sheet.dataset(Labels(), {})
        assert set(data.data_vars) == {"y", "status", "message"}
        assert data.status.values.ravel().tolist() == [0, 102, 102, 102, 106, 106]
        texts = data.message.values.ravel()
        assert texts[5].startswith("The task returned z () real, and at the first point y () real.")
        assert texts[4].startswith("The task returned y (2,) real")

    def test_names_of_axes_and_coordinates(self):
        labels = Labels(
            {"y": ("k",)},
            {"k": (("k",), [7.0, 8.0]), "other": (("m",), [1.0])},
            {"y": {"units": "m"}, "a": {"units": "s", "long_name": "?"}},
        )
        over = {"a": xarray.DataArray([1.0, 2.0], dims="a", attrs={"units": "kg"})}
        data = self.sheet(
            *((i, {"y": np.ones(2), "u": np.zeros((1, 2))}) for i in range(2)), over=over
        ).dataset(labels, {})
        assert data.y.dims == ("a", "k")
        assert data.u.dims == ("a", "u_0", "u_1")
        assert data.k.values.tolist() == [7.0, 8.0]
        assert set(data.coords) == {"a", "k"}
        assert (data.y.attrs, data.u.attrs) == ({"units": "m"}, {})
        # Attributes that the axis was given win.
        assert data.a.attrs == {"units": "kg", "long_name": "?"}

    def test_a_result_with_the_name_of_an_axis_is_refused_at_once(self):
        with pytest.raises(ArgumentError, match="'a' has the name of an axis"):
            self.sheet((0, {"a": 1.0}))
