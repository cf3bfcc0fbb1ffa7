"""Traces as CSV: a row per particle per update, and a row per update.

Readers go by column names. Numbers: x, y, yaw and logs with 9 decimals, weights and all else with 9 significant digits,
stamps as absolute seconds with 9 decimals. A log-likelihood of −inf is written ``-inf``; one that is not usable (NaN or
+inf, on a step flagged degenerate) and one of a sensor without measurements at that update are empty fields.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.io.traces.formats import Format, of_steps
from mclcli.io.traces.sinks import COVARIANCE_COLUMNS, covariance_text, require_finite, stamp_text
from mclcli.native.backend import NUMPY, Backend

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import SimpleNamespace

    from mclcli.arrays import FloatArray
    from mclcli.io.traces.formats import About, Writer
    from mclcli.io.traces.output import Output
    from mclcli.io.traces.sinks import TextSink
    from mclcli.records import Hypothesis, StepRecord

_ROWS = 4096  # formatted at once: bounds the memory that a million particles take
HYPOTHESES = 2  # clusters with columns of their own


@final
class TraceCsv:
    """Weight trace: ``step,stamp,particle,x,y,yaw,log_<sensor>…,log_weight,weight``.

    ``metadata`` becomes one JSON object on a line that starts with ``#``. The columns of sensors are those of
    ``sensors``, or of the first record where that is None. ``backend`` writes the numbers; the text is the same.
    """

    __slots__ = ("_backend", "_sensors", "_started", "_stream")

    def __init__(
        self,
        stream: TextSink,
        metadata: Mapping[str, object],
        *,
        sensors: Sequence[str] | None = None,
        backend: Backend = NUMPY,
    ) -> None:
        self._stream, self._backend = stream, backend
        self._sensors = None if sensors is None else tuple(sensors)
        self._started = False
        stream.write(f"# {metadata_line(metadata)}\n")

    def write(self, record: StepRecord) -> None:
        """Append one update: N rows, always whole ones.

        Raises
        ------
        ValueError
            If a pose or weight is not finite, or a sensor has no column.

        """
        require_finite("pose", record.poses)
        require_finite("weight", record.weights)
        sensors = self._start(record.sensors)
        n = len(record.poses)
        logs = columns_of(sensors, record)
        block = np.column_stack([record.poses, logs.T, record.log_weights, record.weights])
        prefix = f"{record.step},{stamp_text(record.stamp_ns)},"
        for first in range(0, n, _ROWS):
            self._stream.write(rows_text(prefix, first, block[first : first + _ROWS], self._backend))

    def close(self) -> None:
        """Write the header if no record did."""
        self._start(())

    def _start(self, sensors: tuple[str, ...]) -> tuple[str, ...]:
        if self._sensors is None:
            self._sensors = sensors
        if not self._started:
            self._started = True
            logs = (f"log_{name}" for name in self._sensors)
            self._stream.write(",".join(["step,stamp,particle,x,y,yaw", *logs, "log_weight,weight"]) + "\n")
        return self._sensors


@final
class StepsCsv:
    """A row per update: ``step,stamp,n,ess,log_evidence,alpha_<sensor>…,resampled,…``; bools are 0 or 1.

    The two heaviest clusters, with empty fields where there are not so many, and ``beams_<sensor>`` come last.
    ``sensors`` as for ``TraceCsv``.
    """

    __slots__ = ("_sensors", "_started", "_stream")

    def __init__(self, stream: TextSink, *, sensors: Sequence[str] | None = None) -> None:
        self._stream = stream
        self._sensors = None if sensors is None else tuple(sensors)
        self._started = False

    def write(self, record: StepRecord) -> None:
        """Append one update.

        Raises
        ------
        ValueError
            If the estimate is not finite, or a sensor has no column.

        """
        require_finite("estimate", record.estimate.pose)
        alphas = dict(zip(record.sensors, record.alphas, strict=True))
        counts = dict(zip(record.sensors, record.counts, strict=False))
        sensors = self._start(record.sensors)
        _require_columns(sensors, record)
        x, y, yaw = record.estimate.pose.tolist()
        found = record.hypotheses()
        fields = [
            f"{record.step},{stamp_text(record.stamp_ns)},{len(record.poses)},{record.ess:.9g}",
            f"{record.log_evidence:.9f}",
            *(f"{alphas[name]:.9g}" if name in alphas else "" for name in sensors),
            f"{record.resampled:d},{record.degenerate:d},{record.beams_used},{x:.9f},{y:.9f},{yaw:.9f}",
            covariance_text(record.estimate.covariance),
            f"{record.segment},{record.converged:d},{record.reliability:.9g},{record.injected},{record.lost:d},{record.modes}",
            *(_hypothesis_text(found, number) for number in range(HYPOTHESES)),
            *(str(counts.get(name, "")) for name in sensors),
        ]
        self._stream.write(_without_unusable(",".join(fields)) + "\n")

    def close(self) -> None:
        """Write the header if no record did."""
        self._start(())

    def _start(self, sensors: tuple[str, ...]) -> tuple[str, ...]:
        if self._sensors is None:
            self._sensors = sensors
        if not self._started:
            self._started = True
            alphas = (f"alpha_{name}" for name in self._sensors)
            facts = f"resampled,degenerate,beams_used,x,y,yaw,{COVARIANCE_COLUMNS}"
            tail = f"{facts},segment,converged,reliability,injected,lost,modes"
            places = (f"weight_{i},x_{i},y_{i},yaw_{i}" for i in range(1, HYPOTHESES + 1))
            beams = (f"beams_{name}" for name in self._sensors)
            self._stream.write(",".join(["step,stamp,n,ess,log_evidence", *alphas, tail, *places, *beams]) + "\n")
        return self._sensors


def _hypothesis_text(found: Sequence[Hypothesis], number: int) -> str:
    if number >= len(found):
        return ",,,"
    hypothesis = found[number]
    require_finite("hypothesis", hypothesis.estimate.pose)
    x, y, yaw = hypothesis.estimate.pose.tolist()
    return f"{hypothesis.weight:.9g},{x:.9f},{y:.9f},{yaw:.9f}"


def metadata_line(metadata: Mapping[str, object]) -> str:
    """One line of JSON in the given order, ASCII only: no text of a file can end the line or reach a terminal raw.

    Numbers that JSON lacks become strings (``"inf"``).
    """
    return json.dumps(_plain(metadata), separators=(",", ":"), allow_nan=False).replace("\x7f", "\\u007f")


def _plain(value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def rows_text(prefix: str, first: int, block: FloatArray, backend: Backend = NUMPY) -> str:
    """Rows (n, C) as text: prefix, number from ``first`` on, all but the last column fixed, the last general."""
    kernels = backend.kernels("text")
    return _rows(prefix, first, block) if kernels is None else _rows_compiled(kernels, prefix, first, block)


def _rows(prefix: str, first: int, block: FloatArray) -> str:
    """By one ``%``: the fastest that the standard library offers."""
    row = f"{prefix}%d,{'%.9f,' * (block.shape[1] - 1)}%.9g\n"
    numbered = np.column_stack([np.arange(first, first + len(block)), block])
    text = (row * len(block)) % tuple(numbered.ravel().tolist())
    return text if np.isfinite(block).all() else _without_unusable(text)


def _rows_compiled(kernels: SimpleNamespace, prefix: str, first: int, block: FloatArray) -> str:
    """As far as compiled code can write the numbers; the rest by ``%``."""
    head, block = np.frombuffer(prefix.encode(), np.uint8), np.ascontiguousarray(block)
    out = np.empty(len(block) * (head.size + 32 * (block.shape[1] + 1)), np.uint8)
    done = np.zeros(2, np.int64)
    kernels.put_rows(block, first, head, out, done)
    rows, end = done.tolist()
    text = out[:end].tobytes().decode()
    return text if rows == len(block) else text + _rows(prefix, first + rows, block[rows:])


def columns_of(sensors: tuple[str, ...], record: StepRecord) -> FloatArray:
    """Log-likelihoods (S, N) in the order of ``sensors``; NaN for one without measurements.

    Raises
    ------
    ValueError
        If the record has a sensor that is not among them.

    """
    _require_columns(sensors, record)
    if sensors == record.sensors:
        return record.log_likelihoods
    logs = np.full((len(sensors), len(record.poses)), np.nan)
    for name, row in zip(record.sensors, record.log_likelihoods, strict=True):
        logs[sensors.index(name)] = row
    return logs


def _require_columns(sensors: tuple[str, ...], record: StepRecord) -> None:
    for name in record.sensors:
        if name not in sensors:
            raise ValueError(f"step {record.step}: no column for sensor {name!r}; name all sensors at the start")


def _without_unusable(text: str) -> str:
    """Rows with NaN and +inf replaced by empty fields; −inf stays."""
    return text.replace(",nan", ",").replace(",inf", ",")


def _trace(output: Output, about: About) -> Writer:
    return of_steps(TraceCsv(output, about.metadata, sensors=about.sensors, backend=about.backend))


def _steps(output: Output, about: About) -> Writer:
    return of_steps(StepsCsv(output, sensors=about.sensors))


TRACE, STEPS = Format(_trace), Format(_steps)
