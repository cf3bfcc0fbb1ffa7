"""Motion models p(x_t | u_t, x_{t−1}): a file a model, chosen by name from ``MODELS``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, final

from mclcli.motion.differential import DifferentialMotion, DifferentialParameters, TurnNoise
from mclcli.motion.omnidirectional import OmnidirectionalMotion, OmnidirectionalParameters
from mclcli.motion.stationary import StationaryMotion, StationaryParameters
from mclcli.native.backend import NUMPY, Backend
from mclcli.parameters import parameter, parameter_of, validate

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray
    from mclcli.motion.noise import Expression, Scaling
    from mclcli.parameters import ParameterSet


class MotionModel(Protocol):
    """Moves particles by an odometry increment, with noise."""

    def sample(self, poses: FloatArray, increment: FloatArray, normals: FloatArray) -> FloatArray:
        """Poses (N, 3) after the increment (3,) in the base frame, with standard normals (N, 3) for the noise."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Entry:
    """A motion model in the registry: the dataclass of its parameters, and how to make the model from them."""

    parameters: type[ParameterSet]
    make: Callable[[Any, Backend], MotionModel]


MODELS: dict[str, Entry] = {
    "differential": Entry(DifferentialParameters, DifferentialMotion),
    "omnidirectional": Entry(OmnidirectionalParameters, lambda parameters, _: OmnidirectionalMotion(parameters)),
    "stationary": Entry(StationaryParameters, lambda parameters, _: StationaryMotion(parameters)),
}


Word = bool | int | float | str  # a value in a file of parameters

# Names of motion models in files: nav2's plugins, Beluga's own, and nav2's before it had plugins.
MOTION_PLUGINS = {
    "differential": "nav2_amcl::DifferentialMotionModel",
    "omnidirectional": "nav2_amcl::OmniMotionModel",
}
BELUGA_MOTIONS: dict[Word, Word] = {
    "differential_drive": "differential",
    "omnidirectional_drive": "omnidirectional",
    "stationary": "stationary",
}
MOTIONS: dict[Word, Word] = {
    **{plugin: name for name, plugin in MOTION_PLUGINS.items()},
    **BELUGA_MOTIONS,
    **{name: name for name in MOTION_PLUGINS},
}


@final
@dataclass(frozen=True, slots=True)
class MotionParameters:
    """Which motion model, and the parameters of all of them; each model takes those it has."""

    robot_model_type: str = parameter("differential", "how the robot moves", choices=tuple(MODELS), in_nav2=True)
    alpha1: float = parameter_of(OmnidirectionalParameters, "alpha1")
    alpha2: float = parameter_of(OmnidirectionalParameters, "alpha2")
    alpha3: float = parameter_of(OmnidirectionalParameters, "alpha3")
    alpha4: float = parameter_of(OmnidirectionalParameters, "alpha4")
    alpha5: float = parameter_of(OmnidirectionalParameters, "alpha5")
    turn_noise: TurnNoise = parameter_of(DifferentialParameters, "turn_noise")
    noise_scaling: Scaling = parameter_of(DifferentialParameters, "noise_scaling")
    noise_expression: Expression = parameter_of(DifferentialParameters, "noise_expression")
    stationary_sigma_xy: float = parameter_of(StationaryParameters, "stationary_sigma_xy")
    stationary_sigma_yaw: float = parameter_of(StationaryParameters, "stationary_sigma_yaw")

    def __post_init__(self) -> None:
        validate(self)


def build(parameters: MotionParameters, backend: Backend = NUMPY) -> MotionModel:
    """Motion model that the parameters name, with those of them that it has; ``backend`` runs its loops."""
    entry = MODELS[parameters.robot_model_type]
    own = entry.parameters.__dataclass_fields__
    return entry.make(entry.parameters(**{name: getattr(parameters, name) for name in own}), backend)
