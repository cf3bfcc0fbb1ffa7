"""The weight trace as Parquet, for pandas, Polars and DuckDB: the columns of the CSV, in full precision."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, final

import numpy as np

from mclcli.errors import UsageError
from mclcli.io.traces.formats import Format, of_steps
from mclcli.io.traces.sinks import require_finite
from mclcli.io.traces.trace_csv import columns_of, metadata_line

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mclcli.arrays import FloatArray
    from mclcli.io.traces.formats import About, Writer
    from mclcli.io.traces.output import Output
    from mclcli.io.traces.sinks import BinarySink
    from mclcli.records import StepRecord

_ROWS = 250_000  # of a row group: what a reader takes at once


@final
class TraceParquet:
    """Weight trace: ``step,stamp,particle,x,y,yaw,log_<sensor>…,log_weight,weight,stamp_ns``.

    ``stamp`` is in seconds as a double, ``stamp_ns`` exact. What is an empty field of the CSV is null. ``metadata`` is
    one JSON object under the key ``mcl`` of the file's own metadata.

    Raises
    ------
    UsageError
        If pyarrow is not installed.

    """

    __slots__ = ("_arrow", "_rows", "_schema", "_sensors", "_steps", "_writer")

    def __init__(self, stream: BinarySink, metadata: Mapping[str, object], sensors: Sequence[str]) -> None:
        self._arrow = _pyarrow("pyarrow")
        parquet = _pyarrow("pyarrow.parquet")
        self._sensors = tuple(sensors)
        whole, real = self._arrow.int64(), self._arrow.float64()
        logs = [(f"log_{name}", real) for name in self._sensors]
        reals = [(name, real) for name in ("x", "y", "yaw")]
        fields = [("step", whole), ("stamp", real), ("particle", whole), *reals, *logs]
        fields += [("log_weight", real), ("weight", real), ("stamp_ns", whole)]
        self._schema = self._arrow.schema(fields, metadata={"mcl": metadata_line(metadata)})
        self._writer = parquet.ParquetWriter(_Sink(stream), self._schema, compression="zstd")
        self._steps: list[StepRecord] = []
        self._rows = 0

    def write(self, record: StepRecord) -> None:
        """Append one update: N rows.

        Raises
        ------
        ValueError
            If a pose or weight is not finite, or a sensor has no column.

        """
        require_finite("pose", record.poses)
        require_finite("weight", record.weights)
        self._steps.append(record)
        self._rows += len(record.poses)
        if self._rows >= _ROWS:
            self._flush()

    def close(self) -> None:
        """Write what is left, and the file's end."""
        self._flush()
        self._writer.close()

    def _flush(self) -> None:
        """Write the updates so far as a row group."""
        if not self._steps:
            return
        counts = np.array([len(step.poses) for step in self._steps])
        stamps = np.repeat(np.array([step.stamp_ns for step in self._steps], dtype=np.int64), counts)
        logs = np.concatenate([columns_of(self._sensors, step) for step in self._steps], axis=1)
        poses = np.concatenate([step.poses for step in self._steps])
        columns: list[Any] = [
            np.repeat(np.array([step.step for step in self._steps], dtype=np.int64), counts),
            np.array([float(f"{stamp}e-9") for stamp in np.unique(stamps)])[np.unique(stamps, return_inverse=True)[1]],
            np.concatenate([np.arange(count, dtype=np.int64) for count in counts]),
            *poses.T,
            *(self._nullable(row) for row in logs),
            np.concatenate([step.log_weights for step in self._steps]),
            np.concatenate([step.weights for step in self._steps]),
            stamps,
        ]
        arrays = [self._arrow.array(column) for column in columns]
        self._writer.write_table(self._arrow.Table.from_arrays(arrays, schema=self._schema))
        self._steps.clear()
        self._rows = 0

    def _nullable(self, values: FloatArray) -> object:
        return self._arrow.array(values, mask=np.isnan(values) | np.isposinf(values))


@final
class _Sink:
    """A stream as pyarrow wants it: it asks where it is, and closes what is not its own."""

    closed = False

    def __init__(self, stream: BinarySink) -> None:
        self._stream, self._at = stream, 0

    def write(self, data: bytes) -> int:
        """Append bytes."""
        raw = bytes(data)
        self._stream.write(raw)
        self._at += len(raw)
        return len(raw)

    def tell(self) -> int:
        """How many bytes were written."""
        return self._at

    def flush(self) -> None:
        """Hand everything on."""
        self._stream.flush()

    def close(self) -> None:
        """The stream is its owner's to close."""


def _pyarrow(module: str) -> Any:  # noqa: ANN401 - a module without types
    try:
        return importlib.import_module(module)
    except ImportError:
        raise UsageError(
            "a trace as .parquet needs pyarrow, which is not installed; pip install 'mclcli[table]', or write .csv.gz"
        ) from None


def _trace(output: Output, about: About) -> Writer:
    return of_steps(TraceParquet(output, about.metadata, about.sensors))


TRACE = Format(_trace, binary=True)
