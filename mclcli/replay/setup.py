"""Putting a log, a map and settings together into what ``mclcli.replay.loop`` runs."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

from mclcli import motion
from mclcli.errors import InputError, UsageError, nearest_name
from mclcli.filter.localizer import Localizer
from mclcli.filter.recovery import FromAnywhere, Proposal
from mclcli.filter.start import Anywhere, AroundPose, Start, WhenTold
from mclcli.io.recording.unusable import because, no_map, no_scan, obstacles
from mclcli.native.backend import COMPILED, NUMPY, Backend, choose
from mclcli.records import LandmarkSightings, LaserScan, Odometry, PixelSightings
from mclcli.replay.checking import lidar_temperature, make_check
from mclcli.replay.loop import Setup
from mclcli.sensors.bearing import BearingModel
from mclcli.sensors.instruments import Camera, Lidar
from mclcli.sensors.models import lidar_entry
from mclcli.settings import profiles
from mclcli.world import distance_field

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mclcli.arrays import FloatArray
    from mclcli.io.recording.roles import Roles
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.sensors import Temperature
    from mclcli.sensors.instruments import Instrument, LidarModel
    from mclcli.settings.profiles import Settings
    from mclcli.world.distance_field import DistanceField
    from mclcli.world.landmarks import Landmarks
    from mclcli.world.occupancy import OccupancyGrid

    FieldMaker = Callable[..., DistanceField]
    Mounts = Mapping[str, FloatArray]

# Measured, see docs/decisions/0004 and 0013.
VISION_TEMPERATURE: Final = 0.15
_UPDATES_OF_A_STREAM = 1500  # nobody knows how long a stream will be


def prepare(
    survey: LogSurvey,
    roles: Roles,
    *,
    grid: OccupancyGrid | None = None,
    landmarks: Landmarks | None = None,
    settings: Settings | None = None,
    start: Start | None = None,
    seed: int = 0,
    temperature: Mapping[str, Temperature] | None = None,
    mounts: Mounts | None = None,
    window_ns: tuple[int, int] = (-(2**63), 2**63 - 1),
    make_field: FieldMaker = distance_field.compute,
    threads: int = 1,
    follow: str = "",
    map_topic: str = "",
    deskew: bool = False,
    scan_offset_ns: int = 0,
    proposal: Proposal | None = None,
    search: Start | None = None,
    backend: Backend | None = None,
) -> Setup:
    """Set a replay up: which topics take part, with which models.

    Parameters
    ----------
    survey, roles
        What is in the log and who does what; see ``mclcli.open_recording``.
    grid
        The map; the lidar takes part only if there is one.
    landmarks
        Landmarks by id; sightings take part only if there are some.
    settings
        Parameters; ``mclcli.settings.profiles.build({...})`` makes them.
    start
        Where the particles start: ``AroundPose``, ``AlongPoses`` or ``Anywhere`` (the default: the map's free cells).
    seed
        Seed of every random stream.
    temperature
        α in (0, 1], ``auto`` or ``ess`` by sensor (``lidar``, ``vision_2``…); the name '' stands for all others. What
        is not named has the profile's own: in textbook ``auto`` for lidars and 0.15 for vision.
    mounts
        ``base_from_sensor`` (4, 4) by frame, instead of the log's transforms; the frame '' stands for any.
    window_ns
        First and last stamp of the readings to use.
    make_field
        Computes, or finds, the distance field.
    threads
        How many threads score; the results are the same.
    follow
        Topic of poses that an operator states; the filter begins anew around each. Without a start it begins there.
    map_topic
        Topic of maps, each of which counts from when it comes; ``grid`` counts until then.
    deskew
        Score each beam of a scan from where the robot was at the beam's own time.
    scan_offset_ns
        Added to the stamps of laser scans.
    proposal
        Where a robot that seems lost may be, unless parameter ``recovery`` is off; default: anywhere on the map.
    search
        Where the robot may be once odometry was reset; by default anywhere if it may start anywhere, else the filter
        goes on where it was.
    backend
        What runs the loops; by default the size of the job chooses. The results are the same.

    Raises
    ------
    InputError
        If the log has no sensor or no odometry that could be used, or nothing says where the lidar sits.
    UsageError
        If a start pose lies off the map.

    """
    settings = settings or profiles.build({})
    scored = (*(roles.scan[:1] if grid else ()), *(roles.vision if landmarks else ()))
    if backend is None:
        beams = _readings(survey, scored, settings)
        is_compiled = grid is not None and lidar_entry(settings.model).compiled
        backend = COMPILED if is_compiled else choose(settings.kld.max_particles * beams, rounds=beams)
    over = partial(
        _instruments,
        roles,
        landmarks,
        settings,
        temperature or {},
        make_field=make_field,
        backend=backend,
        threads=threads,
    )
    instruments = over(grid)
    if not roles.odometry or not (roles.scan or roles.vision):
        raise InputError("; ".join(obstacles(survey, roles.scan, roles.vision, roles.odometry)))
    if not instruments:
        raise InputError(_nothing_to_score(survey, roles, grid, landmarks))
    check_mounts(survey, mounts or {})
    for topic in instruments:
        _check_mount(survey, roles, topic, mounts or {})
    begin = WhenTold() if start is None and follow else _checked_start(start, grid)
    return Setup(
        localizer=Localizer(
            motion.build(settings.motion, backend), settings.filter, seed, settings.kld, settings.recovery, backend
        ),
        instruments=instruments,
        start=begin,
        odometry=roles.odometry,
        odom_frame=roles.odom_frame,
        base_frame=roles.base_frame,
        frames=roles.frames,
        mounts=mounts or {},
        window_ns=window_ns,
        transform_topics=_transform_topics(survey, roles, list(instruments)),
        follow=follow,
        scan_offset_ns=scan_offset_ns,
        deskew=deskew,
        odometry_limits=settings.odometry,
        proposal=_proposal(settings, grid, proposal),
        map_topic=map_topic,
        over=over,
        search=begin if search is None and isinstance(begin, Anywhere) else search,
    )


def _instruments(
    roles: Roles,
    landmarks: Landmarks | None,
    settings: Settings,
    temperature: Mapping[str, Temperature],
    grid: OccupancyGrid | None,
    *,
    make_field: FieldMaker,
    backend: Backend,
    threads: int,
) -> dict[str, Instrument]:
    return {
        **_lidars(roles, grid, settings, temperature, make_field, backend, threads),
        **_cameras(roles, landmarks, settings, temperature, backend),
    }


def _proposal(settings: Settings, grid: OccupancyGrid | None, given: Proposal | None) -> Proposal | None:
    if not settings.recovery.enabled:
        return None
    if given is None and grid is None:
        raise UsageError(
            f"recovery={settings.recovery.recovery}: without a map there is no place to look; set it to off"
        )
    return given or (None if grid is None else FromAnywhere(grid))


def lidar_model(
    grid: OccupancyGrid, settings: Settings, make_field: FieldMaker, backend: Backend = NUMPY, threads: int = 1
) -> LidarModel:
    """Lidar model over a map; ``backend`` runs its loops.

    Raises
    ------
    InputError
        If no cell of the map is occupied: every pose would score the same.

    """
    entry = lidar_entry(settings.model)
    model = entry.make(grid, settings.lidars[entry.group], make_field, backend, threads)
    _require_obstacles(grid)
    return model


def _require_obstacles(grid: OccupancyGrid) -> None:
    if not grid.occupied.any():
        raise InputError("map: no cell is occupied, so no pose fits a scan better than another; check its thresholds")


def _readings(survey: LogSurvey, topics: Sequence[str], settings: Settings) -> int:
    """About how many beams and bearings each particle will be scored by: those of the first message, every time."""
    total = 0
    for topic in topics:
        sample, messages = survey.topics[topic].sample, survey.topics[topic].count
        each = (settings.beams.max_beams or sample.ranges.size) if isinstance(sample, LaserScan) else 0
        each += len(sample.ids) if isinstance(sample, LandmarkSightings | PixelSightings) else 0
        total += each * (messages if survey.complete else _UPDATES_OF_A_STREAM)
    return total


def _lidars(
    roles: Roles,
    grid: OccupancyGrid | None,
    settings: Settings,
    temperature: Mapping[str, Temperature],
    make_field: FieldMaker,
    backend: Backend,
    threads: int,
) -> dict[str, Instrument]:
    if grid is None or not roles.scan:
        return {}
    model = lidar_model(grid, settings, make_field, backend, threads)
    check = make_check(grid, settings, make_field)
    names = _numbered("lidar", len(roles.scan))
    alphas = [alpha_of(temperature, name, lidar_temperature(settings)) for name in names]
    return {
        topic: Lidar(name, model, settings.beams, alpha, check)
        for topic, name, alpha in zip(roles.scan, names, alphas, strict=True)
    }


def _cameras(
    roles: Roles,
    landmarks: Landmarks | None,
    settings: Settings,
    temperature: Mapping[str, Temperature],
    backend: Backend,
) -> dict[str, Instrument]:
    if landmarks is None:
        return {}
    model = BearingModel(settings.bearing, backend)
    names = _numbered("vision", len(roles.vision))
    alphas = [alpha_of(temperature, name, VISION_TEMPERATURE) for name in names]
    return {
        topic: Camera(name, model, landmarks, alpha)
        for topic, name, alpha in zip(roles.vision, names, alphas, strict=True)
    }


def alpha_of(temperature: Mapping[str, Temperature], sensor: str, default: Temperature) -> Temperature:
    """Temperature of one sensor: its own, that of its kind, that of all, or the default."""
    names = (sensor, sensor.partition("_")[0], "")
    return next((temperature[name] for name in names if name in temperature), default)


def _transform_topics(survey: LogSurvey, roles: Roles, topics: list[str]) -> tuple[str, ...]:
    """Topics of transforms, if odometry or a sensor's mount can only be known from moving ones."""
    samples = [survey.topics[topic].sample for topic in topics]
    frames = [
        sample.frame_id for sample in samples if isinstance(sample, LaserScan | LandmarkSightings | PixelSightings)
    ]
    sample = survey.topics[roles.odometry].sample if roles.odometry in survey.topics else None
    if isinstance(sample, Odometry):
        frames.append(sample.child_frame_id or roles.base_frame)
    moving = any(roles.frames.moves_between(roles.base_frame, frame) for frame in frames)
    return roles.transform_topics if moving or roles.odometry == "tf" else ()


def _numbered(role: str, count: int) -> list[str]:
    return [role] if count == 1 else [f"{role}_{i + 1}" for i in range(count)]


def _nothing_to_score(survey: LogSurvey, roles: Roles, grid: OccupancyGrid | None, landmarks: Landmarks | None) -> str:
    if roles.scan and grid is None:
        return no_map(survey)
    if roles.vision and landmarks is None:
        seen = f"landmarks are seen on {', '.join(roles.vision)}, but nothing says where they stand; give --landmarks"
        return seen + because(survey, "scan")
    return no_scan(survey)


def _check_mount(survey: LogSurvey, roles: Roles, topic: str, mounts: Mounts) -> None:
    sample = survey.topics[topic].sample
    if not isinstance(sample, LaserScan | LandmarkSightings | PixelSightings):
        return
    frame, frames = sample.frame_id, roles.frames.frames
    known = frame == roles.base_frame or roles.frames.connected(roles.base_frame, frame)
    if frame in mounts or "" in mounts or known:
        return
    raise InputError(
        f"{topic}: no transform from '{roles.base_frame}' to '{frame}'; frames in the log: "
        f"{', '.join(frames) or 'none'}; give --mount {frame}=X,Y,YAW, or --set base_frame_id=FRAME"
        f"{because(survey, 'transforms')}"
    )


def check_mounts(survey: LogSurvey, mounts: Mounts) -> None:
    """Refuse mounts of frames that a log knows nothing of.

    Raises
    ------
    UsageError
        If neither a transform nor a message names the frame.

    """
    told = (
        getattr(topic.sample, name, "") for topic in survey.topics.values() for name in ("frame_id", "child_frame_id")
    )
    known = sorted({*survey.frames.frames, *told} - {""})
    for frame in mounts:
        if frame and frame not in known and survey.complete:
            hint = nearest_name(frame, known)
            raise UsageError(f"--mount {frame}: the log has no such frame{hint}; it has {', '.join(known) or 'none'}")


def _checked_start(start: Start | None, grid: OccupancyGrid | None) -> Start:
    if start is None:
        if grid is None:
            raise UsageError("without a map there is no place to start from; give --init X,Y,YAW")
        return Anywhere(grid)
    if isinstance(start, AroundPose) and grid is not None and not grid.contains(start.pose[:2]):
        x, y = start.pose[:2]
        raise UsageError(f"--init: ({x:g}, {y:g}) lies off the map; {describe_extent(grid)}")
    return start


def describe_extent(grid: OccupancyGrid) -> str:
    """Where a map lies, for messages."""
    corners = grid.to_map([[0, 0], [grid.width, 0], [grid.width, grid.height], [0, grid.height]])
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return f"the map spans x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m"
