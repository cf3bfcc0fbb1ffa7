"""The weight trace as Parquet, and how pandas and Polars read the CSV."""

from __future__ import annotations

import importlib
import io
import json
import sys
from typing import TYPE_CHECKING
from unittest import mock

import numpy as np
import pytest

from mclcli.errors import UsageError
from mclcli.io.traces import trace_parquet
from mclcli.io.traces.trace_csv import TraceCsv
from mclcli.io.traces.trace_parquet import TraceParquet
from tests.io.traces import record

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

SENSORS = ("lidar", "vision")
METADATA = {"version": "1", "note": 'a # and a "quote"'}


def needed(module: str) -> Any:
    return pytest.importorskip(module, reason=f"needs {module}")


def written(*steps: Any) -> io.BytesIO:
    needed("pyarrow")
    stream = io.BytesIO()
    trace = TraceParquet(stream, METADATA, SENSORS)
    for step in steps:
        trace.write(step)
    trace.close()
    return io.BytesIO(stream.getvalue())


def csv_file(folder: Path, *steps: Any) -> Path:
    stream = io.StringIO()
    trace = TraceCsv(stream, METADATA, sensors=SENSORS)
    for step in steps:
        trace.write(step)
    trace.close()
    path = folder / "trace.csv"
    path.write_text(stream.getvalue())
    return path


def odd() -> Any:
    """A step with logarithms that are −inf and that are not usable."""
    made = record(1, n=3)
    logs = np.array([[-1.0, -np.inf, np.nan], [np.inf, -2.0, -3.0]])
    return record(1, n=3, log_likelihoods=logs, log_weights=made.log_weights, weights=made.weights)


def test_what_is_read_is_what_was_written() -> None:
    first, lidar_alone = record(0, n=40), record(1, n=7, sensors=("lidar",))
    table = needed("pyarrow.parquet").read_table(written(first, lidar_alone))
    assert table.column_names == [
        *("step", "stamp", "particle", "x", "y", "yaw", "log_lidar", "log_vision", "log_weight", "weight", "stamp_ns"),
    ]
    columns = {name: table[name].to_numpy() for name in table.column_names if name != "log_vision"}
    for number, made in enumerate((first, lidar_alone)):
        rows = columns["step"] == number
        np.testing.assert_array_equal(
            np.stack([columns[name][rows] for name in ("x", "y", "yaw")], axis=-1), made.poses
        )
        np.testing.assert_array_equal(columns["weight"][rows], made.weights)
        np.testing.assert_array_equal(columns["log_weight"][rows], made.log_weights)
        np.testing.assert_array_equal(columns["log_lidar"][rows], made.log_likelihoods[0])
        np.testing.assert_array_equal(columns["particle"][rows], np.arange(len(made.poses)))
        assert set(columns["stamp_ns"][rows]) == {made.stamp_ns}
        assert set(columns["stamp"][rows]) == {float(f"{made.stamp_ns}e-9")}
    assert table["log_vision"].null_count == 7


def test_the_metadata_is_inside() -> None:
    schema = needed("pyarrow.parquet").read_schema(written(record()))
    assert json.loads(schema.metadata[b"mcl"]) == METADATA


def test_unusable_logarithms_are_null() -> None:
    table = needed("pyarrow.parquet").read_table(written(odd()))
    assert table["log_lidar"].to_pylist() == [-1.0, -np.inf, None]
    assert table["log_vision"].to_pylist() == [None, -2.0, -3.0]


def test_row_groups_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trace_parquet, "_ROWS", 60)
    file = needed("pyarrow.parquet").ParquetFile(written(*(record(step, n=40) for step in range(5))))
    assert [file.metadata.row_group(i).num_rows for i in range(file.metadata.num_row_groups)] == [80, 80, 40]


def test_no_update_is_a_table_of_no_rows() -> None:
    assert needed("pyarrow.parquet").read_table(written()).num_rows == 0


def test_without_pyarrow_there_is_one_clear_line() -> None:
    absent = mock.patch.dict(sys.modules, {"pyarrow": None})
    with absent, pytest.raises(UsageError, match=r"needs pyarrow, .* pip install 'mclcli\[table\]'"):
        TraceParquet(io.BytesIO(), METADATA, SENSORS)


def test_pandas_reads_the_csv_in_a_line(tmp_path: Path) -> None:
    pandas = needed("pandas")
    made = record(0, n=40)
    frame = pandas.read_csv(csv_file(tmp_path, made, odd()), comment="#")
    rows = frame[frame["step"] == 0]
    np.testing.assert_allclose(rows[["x", "y", "yaw"]].to_numpy(), made.poses, atol=6e-10)
    assert frame["log_lidar"].tolist()[-2] == -np.inf
    assert np.isnan(frame["log_lidar"].tolist()[-1])


def test_polars_reads_the_csv_in_a_line(tmp_path: Path) -> None:
    polars = needed("polars")
    made = record(0, n=40)
    frame = polars.read_csv(csv_file(tmp_path, made, odd()), comment_prefix="#")
    rows = frame.filter(polars.col("step") == 0)
    np.testing.assert_allclose(rows.select("x", "y", "yaw").to_numpy(), made.poses, atol=6e-10)
    assert frame["log_lidar"].to_list()[-2:] == [-np.inf, None]


def test_the_library_is_imported_for_it_alone() -> None:
    before = set(sys.modules)
    importlib.reload(trace_parquet)
    assert not {name for name in set(sys.modules) - before if name.startswith("pyarrow")}
