"""Parameters as fields of frozen dataclasses: each states its unit, nav2's name, its meaning and its bounds.

A model's parameters are a dataclass beside the model; ``mclcli.settings.profiles`` gathers them all into one table.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Literal, Protocol, final

from mclcli.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import ClassVar


YesNo = Literal["yes", "no"]


class ParameterSet(Protocol):
    """Any frozen dataclass whose fields were made with ``parameter``."""

    __dataclass_fields__: ClassVar[dict[str, Any]]


@final
@dataclasses.dataclass(frozen=True, slots=True)
class Description:
    """What is known of one parameter besides its value.

    ``unit`` is ``m``, ``rad``, ``s`` or empty. Bounds are inclusive unless ``above`` is set, which is exclusive.
    ``choices`` lists the words it may take; ``in_nav2`` says that nav2_amcl has it under the same name.
    """

    meaning: str
    unit: str = ""
    above: float | None = None
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    in_nav2: bool = False
    source: str = ""


def parameter(default: float | str, meaning: str, **details: Any) -> Any:  # noqa: ANN401 - as dataclasses.field
    """Dataclass field with a default and a ``Description``; ``details`` are the latter's other fields."""
    return dataclasses.field(default=default, metadata={"description": Description(meaning, **details)})


def parameter_of(parameters: type[ParameterSet], name: str) -> Any:  # noqa: ANN401 - as dataclasses.field
    """A field of another dataclass again: its default and description are written once, beside the model."""
    own = parameters.__dataclass_fields__[name]
    return dataclasses.field(default=own.default, metadata=own.metadata)


def described(parameters: type[ParameterSet]) -> Iterator[tuple[str, Any, Description]]:
    """Name, default and description of every parameter of a dataclass."""
    for field in dataclasses.fields(parameters):
        yield field.name, field.default, field.metadata["description"]


def validate(parameters: ParameterSet) -> None:
    """Check every value against its description; called in ``__post_init__``.

    Raises
    ------
    UsageError
        Naming the parameter, its value and what is allowed.

    """
    for name, _, description in described(type(parameters)):
        check_value(name, getattr(parameters, name), description)


def check_value(name: str, value: float | str, description: Description) -> None:
    """Check one value against its description; UsageError as of ``validate``."""
    problem = _problem(value, description)
    if problem:
        unit = f" {description.unit}" if description.unit else ""
        raise UsageError(f"parameter {name} = {value}{unit}: {problem}; see `mcl params`")


def _problem(value: float | str, description: Description) -> str:
    if description.choices:
        return "" if value in description.choices else f"must be one of {', '.join(description.choices)}"
    return "" if isinstance(value, str) else _out_of_bounds(value, description)


def _out_of_bounds(value: float, description: Description) -> str:
    above, low, high = description.above, description.low, description.high
    if not math.isfinite(value):
        return "must be a finite number"
    if above is not None and value <= above:
        return f"must be greater than {above:g}"
    if low is not None and value < low:
        return f"must be at least {low:g}"
    if high is not None and value > high:
        return f"must be at most {high:g}"
    return ""
