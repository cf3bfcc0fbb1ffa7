"""The trace as MCAP: everything a viewer of ROS 2 logs needs to show the filter at work."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2, se3
from mclcli.io.traces import trace_messages as messages
from mclcli.io.traces.chunked_mcap import ROSBAG2, ChunkedMcap, ros2_stream
from mclcli.io.traces.formats import Format, Writer
from mclcli.io.traces.mcap_writer import for_clouds
from mclcli.io.traces.sinks import require_finite
from mclcli.native.backend import NUMPY, Backend
from mclcli.records import Transform

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mclcli.io.traces.formats import About
    from mclcli.io.traces.output import Output
    from mclcli.io.traces.sinks import BinarySink
    from mclcli.records import StepRecord, TrackPoint

_TYPES = {
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/amcl_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/mcl/pose": "geometry_msgs/msg/PoseStamped",
    "/particle_cloud": "nav2_msgs/msg/ParticleCloud",
    "/particlecloud": "geometry_msgs/msg/PoseArray",
    "/mcl/step": "mcl_msgs/msg/Step",
    "/mcl/hypotheses": "nav2_msgs/msg/ParticleCloud",
    "/scan": "sensor_msgs/msg/LaserScan",
}
_HELD = 4096  # messages of transforms at most; beyond, no point comes any more
_STREAMS = {
    name: ros2_stream(name, kind, messages.definition(kind), latched=name in {"/map", "/tf_static"})
    for name, kind in _TYPES.items()
}


@final
class TraceMcap:
    """Writes track points with their step records and scans as MCAP, profile ros2.

    Recorded ``static_transforms`` go to /tf_static. Recorded transforms that would give the odometry frame a second
    parent, or whose parent is the map frame, are left out. The same input makes the same bytes.

    ``close`` after any exception, KeyboardInterrupt too, leaves a complete file of whole steps; an error in writing is
    raised by a later call, ``close`` at the latest (see ``ChunkedMcap``).
    """

    __slots__ = ("_backend", "_base", "_file", "_grid", "_has_base", "_held", "_map", "_odom", "_started", "_statics")

    def __init__(
        self,
        stream: BinarySink,
        *,
        grid: messages.Grid | None,
        metadata: Mapping[str, str],
        parameters_yaml: str,
        odom_frame: str,
        base_frame: str,
        map_frame: str = "map",
        static_transforms: Sequence[Transform] = (),
        backend: Backend = NUMPY,
    ) -> None:
        self._backend = backend
        self._grid = grid
        self._map, self._odom, self._base = map_frame, odom_frame, base_frame
        self._statics = [t for t in static_transforms if self._is_kept(t)]
        self._has_base = any(t.child == base_frame for t in self._statics)
        self._started = False
        self._held: list[tuple[int, list[Transform]]] = []  # recorded, later than the last point
        records = {
            "mcl": {**metadata, "rounding": messages.ROUNDING},
            "rosbag2": {"serialized_metadata": ROSBAG2},
        }
        self._file = ChunkedMcap(
            stream, _STREAMS, for_clouds(), records=records, attached=("parameters.yaml", parameters_yaml)
        )

    def transforms(self, stamp_ns: int, transforms: Sequence[Transform]) -> None:
        """Pass on one recorded /tf message, received at ``stamp_ns``.

        It is held until a point has come up to it, so that log times are in order: a point waits for odometry.
        """
        kept = [transform for transform in transforms if self._is_kept(transform)]
        if kept:
            self._has_base |= any(transform.child == self._base for transform in kept)
            self._held.append((stamp_ns, kept))
            if len(self._held) > _HELD:
                self._pass_on(self._held[_HELD // 2][0])

    def write(self, point: TrackPoint) -> None:
        """Append one track point, with the scan and the step made there, if any.

        Raises
        ------
        InputError
            If writing failed, or a stamp lies outside ROS time.

        """
        require_finite("estimate", point.estimate.pose)
        stamp, pose = point.stamp_ns, point.estimate.pose
        self._pass_on(stamp)
        batch = self._beginning(stamp)
        batch.append(("/tf", messages.tf_message(self._own_transforms(point))))
        batch.append(("/mcl/pose", messages.pose_stamped(stamp, self._map, pose)))
        if point.scan is not None:
            batch.append(("/scan", messages.laser_scan(point.scan)))
        if point.step is not None:
            batch += self._step(point.step)
        elif point.measured:
            require_finite("covariance", point.estimate.covariance)
            batch.append(("/amcl_pose", messages.pose_with_covariance(stamp, self._map, point.estimate)))
        self._file.add(stamp, batch)

    def close(self) -> None:
        """Finish the file: what is held, the chunk in progress, indexes, summary. Later calls do nothing."""
        self._pass_on(None)
        self._file.close()

    def _pass_on(self, until_ns: int | None) -> None:
        """Write the transforms that are held, up to a stamp, in the order of their stamps; None: all of them."""
        due = [held for held in self._held if until_ns is None or held[0] <= until_ns]
        self._held = [held for held in self._held if until_ns is not None and held[0] > until_ns]
        for stamp_ns, kept in sorted(due, key=lambda held: held[0]):
            self._file.add(stamp_ns, [*self._beginning(stamp_ns), ("/tf", messages.tf_message(kept))])

    def _is_kept(self, transform: Transform) -> bool:
        return transform.parent != self._map and transform.child != self._odom

    def _beginning(self, stamp_ns: int) -> list[tuple[str, bytes]]:
        """Messages that come before all others, once."""
        if self._started:
            return []
        self._started = True
        first = []
        if self._grid is not None:
            first.append(("/map", messages.occupancy_grid(stamp_ns, self._map, self._grid)))
        if self._statics:
            first.append(("/tf_static", messages.tf_message(self._statics)))
        return first

    def _own_transforms(self, point: TrackPoint) -> list[Transform]:
        """``map_from_odom = map_from_base ⊕ base_from_odom``, and the base where the log's tf does not know it."""
        map_from_odom = se2.compose(point.estimate.pose, se2.inverse(point.odom_from_base))
        edges = [(self._map, self._odom, map_from_odom)]
        if not self._has_base:
            edges.append((self._odom, self._base, point.odom_from_base))
        return [
            Transform(point.stamp_ns, parent, child, se3.from_planar(pose), static=False)
            for parent, child, pose in edges
        ]

    def _step(self, record: StepRecord) -> list[tuple[str, bytes]]:
        require_finite("pose", record.poses)
        require_finite("weight", record.weights)
        require_finite("estimate", record.estimate.pose)
        require_finite("covariance", record.estimate.covariance)
        stamp, frame = record.stamp_ns, self._map
        poses, particles = messages.rounded_clouds(record.poses, record.weights, self._backend)
        found = record.hypotheses()
        places = messages.planar_poses(np.array([h.estimate.pose for h in found]).reshape(-1, 3))
        hypotheses = np.column_stack([places, [h.weight for h in found]])
        return [
            ("/amcl_pose", messages.pose_with_covariance(stamp, frame, record.estimate)),
            ("/mcl/step", messages.step(record, frame)),
            ("/mcl/hypotheses", messages.particle_cloud(stamp, frame, hypotheses)),
            # The cloud repeats the array's bytes: in this order, next to each other, the two compress best.
            ("/particlecloud", messages.pose_array(stamp, frame, poses)),
            ("/particle_cloud", messages.particle_cloud(stamp, frame, particles)),
        ]


def _trace(output: Output, about: About) -> Writer:
    metadata = {key: value if isinstance(value, str) else json.dumps(value) for key, value in about.metadata.items()}
    trace = TraceMcap(
        output,
        grid=about.grid,
        metadata=metadata,
        parameters_yaml=about.parameters_yaml(),
        odom_frame=about.odom_frame,
        base_frame=about.base_frame,
        map_frame=about.map_frame,
        static_transforms=about.static_transforms,
        backend=about.backend,
    )
    return Writer(trace.write, trace.close, trace.transforms)


TRACE = Format(_trace, binary=True, stays_whole=True)
