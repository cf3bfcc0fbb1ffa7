"""Every parameter in one place: their names and defaults, and settings built from plain names and values."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from typing import TYPE_CHECKING, Any, final, get_args

from mclcli.errors import UsageError, nearest_name
from mclcli.filter.kld import KldParameters
from mclcli.filter.parameters import FilterParameters
from mclcli.filter.recovery import RecoveryParameters
from mclcli.motion import MOTIONS, MotionParameters
from mclcli.motion.odometry import OdometryParameters
from mclcli.parameters import Description, check_value, described, parameter, validate
from mclcli.quantity import parse_quantity
from mclcli.search.parameters import SearchParameters
from mclcli.sensors.beams import BeamSelection
from mclcli.sensors.bearing import BearingParameters
from mclcli.sensors.models import LIDAR_MODELS, lidar_entry
from mclcli.world import MapUpdate

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from mclcli.settings import Profile

Value = float | str


@final
@dataclass(frozen=True, slots=True)
class FrameParameters:
    """Names of frames and topics; empty means found from the log."""

    base_frame_id: str = parameter(
        "", "frame of the robot's base; empty: the odometry's child, base_link, base_footprint", in_nav2=True
    )
    odom_frame_id: str = parameter("", "frame of the odometry; empty: as recorded", in_nav2=True)
    global_frame_id: str = parameter("map", "frame of the map, in MCAP traces and for poses of the log", in_nav2=True)
    scan_topic: str = parameter("", "topic of the laser scans; empty: found; `--scan` overrides it", in_nav2=True)
    map_topic: str = parameter("", "topic of the map where `--map` names none; empty: found", in_nav2=True)
    map_update: MapUpdate = parameter(
        "auto",
        "which message of the map's topic counts: auto, the last of a map that grew and else the first; follow, the "
        "one in force at each update",
        choices=get_args(MapUpdate),
    )

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True)
class Settings:
    """All parameters of a run, a group per part of the filter, and whose defaults they started from.

    ``lidars`` are the groups of the lidar models, by name (``sensors.models.Entry.group``).
    """

    profile: Profile
    model: str
    filter: FilterParameters
    kld: KldParameters
    recovery: RecoveryParameters
    motion: MotionParameters
    odometry: OdometryParameters
    beams: BeamSelection
    lidars: dict[str, Any]
    bearing: BearingParameters
    search: SearchParameters
    frames: FrameParameters

    def values(self) -> dict[str, Value]:
        """Effective value of every parameter, in the table's order."""
        groups = [
            self.lidars[name] if name in self.lidars else getattr(self, name) for name in active_groups(self.model)
        ]
        return {field.name: getattr(group, field.name) for group in groups for field in fields(group)}

    def as_file(self) -> dict[str, Value]:
        """Profile, model and every value: all that it takes to make the same settings from a file."""
        return {"profile": self.profile, "model": self.model, **self.values()}


_LIDARS = {name: lidar_entry(name) for name in LIDAR_MODELS}
GROUPS: dict[str, type[Any]] = {
    "filter": FilterParameters,
    "kld": KldParameters,
    "recovery": RecoveryParameters,
    "motion": MotionParameters,
    "odometry": OdometryParameters,
    "beams": BeamSelection,
    **{entry.group: entry.parameters for entry in _LIDARS.values()},
    "bearing": BearingParameters,
    "search": SearchParameters,
    "frames": FrameParameters,
}
# Where the parameters of a group come from, if they do not say so themselves. Numbers are of Thrun, Burgard, Fox 2005,
# *Probabilistic Robotics*.
SOURCES: dict[str, str] = {
    "filter": "table 8.2; nav2_amcl",
    "kld": "table 8.4; Fox 2003, eq. 7",
    "recovery": "table 8.3",
    "motion": "table 5.6; nav2_amcl",
    "odometry": "mcl's own",
    "beams": "nav2_amcl, Beluga",
    **{entry.group: entry.source for entry in _LIDARS.values()},
    "bearing": "sections 6.3.1, 6.6.2",
    "search": "mclcli.search; Hess et al. 2016, section V",
    "frames": "REP 105; nav2_amcl",
}
# Parameters of other origin than their group; those of ``_OWN`` are in no other program.
_OWN = "mcl's own"
SOURCES_OF: dict[str, str] = {
    **dict.fromkeys(("ess_target", "fit_ignored", "fit_trusted", "hypotheses", "vision_min_a", "vision_min_d"), _OWN),
    **dict.fromkeys(("field_lookup", "obstacles", "map_update", "stationary_sigma_xy", "stationary_sigma_yaw"), _OWN),
    "degenerate": "uniform: nav2_amcl; carry: mcl's own",
    "estimate_mean": "set: Beluga; heaviest: nav2_amcl; heaviest_if_apart: mcl's own",
    "recovery": "uniform: table 8.3; locate: mcl's own",
    "resample_ess": "Kong, Liu, Wong 1994; Beluga",
    "resampler": "systematic: table 4.4; Douc, Cappé, Moulines 2005",
}


def source_of(group: str, name: str, description: Description) -> str:
    """Where a parameter comes from, for the table of them all."""
    return description.source or SOURCES_OF.get(name) or SOURCES[group]


# Lidar models, and the group that each has its parameters in.
MODELS = {name: entry.group for name, entry in _LIDARS.items()}

# What a profile changes of the textbook's defaults for all models; what it changes for one stands beside that model.
# Beluga's and nav2's differences are described, with their sources, in docs/models.md.
_ALPHAS: dict[str, Value] = {f"alpha{i}": 0.2 for i in range(1, 6)}
_NO_RECOVERY: dict[str, Value] = {"recovery": "uniform", "recovery_alpha_slow": 0.0, "recovery_alpha_fast": 0.0}
_NAV2: dict[str, Value] = {
    **_ALPHAS,
    "short_range": "max",
    "laser_max_range": 100.0,
    "beam_angles": "nav2",
    "beam_subsampling": "stride",
    "field_anchor": "half_cell",
    "origin_yaw": "ignore",
    "field_precision": "single_distance",
    "gate": "per_axis",
    "turn_noise": "folded",
    "noise_scaling": "step",
    "estimate": "after",
    "resampler": "multinomial",
    "resample_ess": 1.0,
    "degenerate": "uniform",
    "estimate_mean": "heaviest",
    "covariance": "sample",
    "min_particles": 500,
    "kld_quantile": "z",
    "kld_unlimited_bins": 1,
    **_NO_RECOVERY,
    "recovery_rule": "linear",
}
_BELUGA: dict[str, Value] = {
    **_ALPHAS,
    "max_range": "keep_equal",
    "laser_min_range": 0.0,
    "laser_max_range": 100.0,
    "range_of_rand": "parameter",
    "turn_noise": "folded",
    "noise_scaling": "step",
    "beam_subsampling": "even",
    "hit_normalised": "yes",
    "off_map": "uniform",
    "obstacles": "boundary",
    "field_precision": "single_likelihood",
    "estimate": "after",
    "resampler": "multinomial",
    "resample_ess": 1.0,
    "estimate_mean": "heaviest",
    "estimate_covariance": "heaviest",
    "covariance": "sample",
    "min_particles": 500,
    "kld_quantile": "z",
    "kld_unlimited_bins": 2,
    **_NO_RECOVERY,
    "recovery_rule": "normalised",
}
_EVERYWHERE: dict[Profile, dict[str, Value]] = {"textbook": {}, "nav2": _NAV2, "beluga": _BELUGA}
PROFILES: dict[Profile, dict[str, dict[str, Value]]] = {
    profile: {name: {**changes, **entry.profiles.get(profile, {})} for name, entry in _LIDARS.items()}
    for profile, changes in _EVERYWHERE.items()
}


def active_groups(model: str) -> list[str]:
    """Groups of parameters that take part with a lidar model."""
    return [group for group in GROUPS if group not in MODELS.values() or group == MODELS[model]]


def table(model: str | None = None) -> Iterator[tuple[str, str, Value, Description]]:
    """Group, name, default and description of every parameter, or of those that take part with a lidar model."""
    for group in GROUPS if model is None else active_groups(model):
        parameters = GROUPS[group]
        for name, default, description in described(parameters):
            yield group, name, default, description


def build(values: Mapping[str, object], *, profile: Profile = "textbook", model: str = "likelihood_field") -> Settings:
    """Settings with these values over a profile's defaults; text is read with its unit (``3deg``).

    Parameters of other lidar models than ``model`` are passed over.

    Raises
    ------
    UsageError
        For an unknown profile, model or parameter (naming the nearest), or a value of the wrong kind or out of bounds.

    """
    _check_word("profile", profile, PROFILES)
    _check_word("model", model, MODELS)
    known = {name: (group, default, description) for group, name, default, description in table(model)}
    elsewhere = {name for _, name, _, _ in table()}
    chosen: dict[str, dict[str, Value]] = {group: {} for group in GROUPS}
    for name, value in {**PROFILES[profile][model], **spelled_out(values)}.items():
        if name not in known and name in elsewhere:
            continue  # it belongs to another lidar model
        if name not in known:
            hint = nearest_name(name, ["particles", *known])
            raise UsageError(f"unknown parameter '{name}'{hint or '; `mcl params` lists them all'}")
        group, default, description = known[name]
        chosen[group][name] = read_value(name, value, default, description)
    groups = {group: parameters(**chosen[group]) for group, parameters in GROUPS.items()}
    lidars = {group: groups.pop(group) for group in MODELS.values() if group in groups}
    return Settings(profile, model, lidars=lidars, **groups)


def _check_word(what: str, word: str, known: Collection[str]) -> None:
    if word not in known:
        raise UsageError(f"{what} '{word}': must be one of {', '.join(known)}{nearest_name(word, list(known))}")


def spelled_out(values: Mapping[str, object]) -> dict[str, object]:
    """The same values, with ``particles`` = N or ``MIN:MAX`` as ``min_particles`` and ``max_particles``.

    Where those two are given as well, they count.
    """
    rest = {name: value for name, value in values.items() if name != "particles"}
    if "particles" not in values:
        return rest
    size = values["particles"]
    smallest, colon, largest = size.partition(":") if isinstance(size, str) else (size, "", size)
    return {"min_particles": smallest, "max_particles": largest if colon else smallest} | rest


@cache
def _by_name(model: str) -> dict[str, tuple[Value, Description]]:
    """Every parameter; of those that several lidar models have, the given one's."""
    rows = [*table(), *table(model)]
    return {name: (default, description) for _, name, default, description in rows}


def check(name: str, value: object, model: str = "likelihood_field") -> None:
    """Check the value of one parameter, of this lidar model or another, by itself; UsageError as of ``build``."""
    rows = _by_name(model)
    for key, single in spelled_out({name: value}).items():
        if key not in rows:
            hint = nearest_name(key, ["particles", *rows])
            raise UsageError(f"unknown parameter '{key}'{hint or '; `mcl params` lists them all'}")
        default, description = rows[key]
        check_value(key, read_value(key, single, default, description), description)


def read_value(name: str, value: object, default: Value, description: Description) -> Value:
    """Value of one parameter from a number or text, of the default's kind.

    Raises
    ------
    UsageError
        Naming the parameter and what was expected.

    """
    if isinstance(default, str):
        words = MOTIONS if name == "robot_model_type" else {}
        return str(words.get(str(value), value))
    if isinstance(default, bool):
        return _read_bool(name, value)
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise UsageError(f"parameter {name} = {value!r}: must be a number; see `mcl params`")
    number = parse_quantity(value, description.unit, f"parameter {name}") if isinstance(value, str) else float(value)
    if isinstance(default, int):
        if not number.is_integer():
            raise UsageError(f"parameter {name} = {value}: must be a whole number; see `mcl params`")
        return int(number)
    return number


def _read_bool(name: str, value: object) -> bool:
    known = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
    if str(value).lower() not in known:
        raise UsageError(f"parameter {name} = {value!r}: must be true or false; see `mcl params`")
    return known[str(value).lower()]
