"""``mcl params``: every parameter."""

from __future__ import annotations

from typing import Any

import click

from mclcli.cli import options


@click.command("params", short_help="Print every parameter with its effective value and meaning.")
@options.parameters
@click.option("--format", "form", type=click.Choice(["mcl"]), default="mcl", show_default=True, help="Whose names.")
@options.threads
@options.common
def command(**arguments: Any) -> None:
    """Effective parameters as YAML that --params reads, with units and meanings."""
    from mclcli import profiles
    from mclcli.io.params_yaml import format_params

    settings = options.build_settings(arguments, {})
    comments = {
        name: f"[{description.unit}] {description.meaning}" if description.unit else description.meaning
        for _, name, _, description in profiles.table()
    }
    click.echo(format_params(settings.values(), comments), nl=False)
