"""``mcl params``: every parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, final, get_args

import click

from mclcli.cli import console, options
from mclcli.cli.chosen import choose_settings
from mclcli.errors import UsageError

if TYPE_CHECKING:
    from mclcli.settings.profiles import Settings

Form = Literal["mcl", "nav2"]


@final
@dataclass(frozen=True, slots=True)
class ParamsOptions:
    """What ``mcl params`` is asked for."""

    parameters: options.ParameterOptions
    form: Form
    as_json: bool


@click.command("params", short_help="Print every parameter with its effective value and meaning.")
@options.parameters
@click.option(
    "--format",
    "form",
    type=click.Choice(get_args(Form)),
    default="mcl",
    show_default=True,
    help="mcl's own names with their meanings, or a file for nav2_amcl.",
)
@options.as_json
@options.common
@options.into(ParamsOptions)
def command(params: ParamsOptions) -> None:
    """Print the effective parameters as YAML that --params reads, with units and meanings."""
    if params.as_json and params.form != "mcl":
        raise UsageError(f"--json prints mcl's own parameters, --format {params.form} a file; give one of them")
    chosen = choose_settings(params.parameters, {})
    if params.as_json:
        from mclcli.cli.results import print_json

        print_json(_facts(chosen.settings))
    elif params.form == "nav2":
        from mclcli.settings.robots.writing import to_nav2

        click.echo(to_nav2(chosen.settings, chosen.file), nl=False)
    else:
        from mclcli.io.tables.params_yaml import format_params

        click.echo(format_params(chosen.settings.as_file(), _comments()), nl=False)
        if chosen.file is not None and chosen.file.start is not None:
            x, y, yaw = (float(value) for value in chosen.file.start.pose)
            console.remark(f"the start is no parameter, give it to mcl run: --init {x:g},{y:g},{yaw:g}")


def _comments() -> dict[str, str]:
    from mclcli.settings import profiles

    meanings = {
        name: f"[{description.unit}] {description.meaning}" if description.unit else description.meaning
        for _, name, _, description in profiles.table()
    }
    return {
        "profile": "rules and defaults to follow: textbook, nav2 or beluga, as --profile",
        "model": "lidar model, as --model",
        **meanings,
    }


def _facts(settings: Settings) -> dict[str, Any]:
    """Every parameter that takes part with the model: its value, and what there is to know of it."""
    from mclcli.settings import profiles

    effective = settings.values()
    parameters = {
        name: {
            "value": effective[name],
            "unit": description.unit or None,
            "meaning": description.meaning,
            "choices": list(description.choices) or None,
            "group": group,
            "in_nav2": description.in_nav2,
        }
        for group, name, _, description in profiles.table(settings.model)
    }
    return {"profile": settings.profile, "model": settings.model, "parameters": parameters}
