"""The settings that a command works with, and the topics and frames that they name in a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from mclcli.cli import console
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Collection

    from mclcli.cli.options import ParameterOptions
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.roles import RequestedRoles, Roles
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.settings.profiles import Settings
    from mclcli.settings.robots.reading import FileParameters
    from mclcli.world.occupancy import OccupancyGrid


@final
@dataclass(frozen=True, slots=True)
class Chosen:
    """Settings, and the file of --params that they come from, if any; ``tentative`` are what only the file says."""

    settings: Settings
    file: FileParameters | None
    tentative: frozenset[str] = frozenset()


def choose_settings(
    options: ParameterOptions, base: dict[str, object], flags: dict[str, object] | None = None
) -> Chosen:
    """Settings of --params and --set over a command's own defaults: flag > --set > --params > default.

    What there is to say about the file is said.
    """
    from mclcli.settings import profiles

    profile, model = options.profile, options.model
    given = profiles.spelled_out(options.settings) | profiles.spelled_out(flags or {})
    if options.params is None:
        values = {**base, **given}
        built = profiles.build(values, profile=profile or "textbook", model=model or "likelihood_field")
        _tell(built, given)
        return Chosen(built, None)
    from mclcli.settings.robots.reading import load, settings_of

    file = load(options.params, profile=profile, model=model, lenient=options.lenient)
    settings = settings_of(file, given, base=base, profile=profile, model=model)
    if not file.remarks:
        console.detail(f"{file.name}: parameters in {file.dialect}'s own dialect")
    for line in file.remarks:
        console.remark(line)
    for line in file.warnings:
        console.warn(line)
    _tell(settings, given)
    return Chosen(settings, file, file.tentative - set(given))


def _tell(settings: Settings, given: Collection[str]) -> None:
    """With -v: profile, model, and what the command line sets."""
    values = settings.values()
    said = "".join(f", {name} {values[name]}" for name in given if name in values)
    console.detail(f"settings: profile {settings.profile}, model {settings.model}{said}")


def warn_of_turned_map(grid: OccupancyGrid | None, settings: Settings) -> None:
    """Say so if the map's origin is turned and the settings do not turn the map."""
    yaw = 0.0 if grid is None else float(grid.origin[2])
    if yaw and settings.values().get("origin_yaw") == "ignore":
        console.warn(
            f"the map's origin has a yaw of {yaw:g} rad, which profile {settings.profile} ignores as nav2_amcl does: "
            "poses are in the map as if it were not turned; --set origin_yaw=use turns it"
        )


def assigned(recording: Recording, requested: RequestedRoles) -> Roles:
    """Roles of a log's topics and frames; says so where there was a choice, or where what is used is doubtful.

    Raises UsageError and InputError as ``mclcli.io.recording.roles.assign`` does.
    """
    parts = recording.roles(requested)
    if parts.robot and "robot" in parts.reasons:
        console.remark(f"robot: {clean(parts.robot)}, {parts.reasons['robot']}")
    for role, name in (("scan", " ".join(parts.scan)), ("odometry", parts.odometry), ("map", parts.map)):
        if "not " in (reason := parts.reasons.get(role, "")):
            console.remark(f"{role}: {clean(name)}, {reason}")
    if "frames" in parts.reasons:
        console.remark(f"frames: {parts.reasons['frames']}")
    for line in parts.doubts:
        console.warn(f"odometry: {line}")
    for role, name in (("scan", " ".join(parts.scan)), ("odometry", parts.odometry), ("map", parts.map)):
        if name:
            console.detail(f"{role}: {clean(name)}, {parts.reasons.get(role) or 'the only one'}")
    console.detail(f"base: {clean(parts.base_frame)}")
    recording.keep_to(parts)
    return parts


def tell_refused(recording: Recording) -> None:
    """Say of which topics nothing can be used, where the log has others in their place."""
    from mclcli.io.recording.unusable import refused

    for sentence in refused(recording.survey):
        console.warn(sentence)


def names_in(survey: LogSurvey, chosen: Chosen, overruled: Collection[str] = ()) -> dict[str, str]:
    """Topics and frames by parameter: those set, and those of the robot's file that the log has; the rest is empty.

    ``overruled`` are parameters that an option of the command line replaces.
    """
    from mclcli.io.recording import topic_names

    frames = chosen.settings.frames
    named = {key: getattr(frames, key) for key in ("base_frame_id", "odom_frame_id", "scan_topic", "map_topic")}
    for key, name in named.items():
        if key in overruled:
            named[key] = ""
        elif chosen.file is not None and key in chosen.tentative:
            named[key] = topic_names.find(survey, key, name, chosen.file.namespace)
            if not named[key]:
                console.remark(f"{chosen.file.name}: {key} '{name}' is not in the log; chosen as if not given")
        elif name and key.endswith("topic"):
            named[key] = f"/{name.lstrip('/')}"
    return named
