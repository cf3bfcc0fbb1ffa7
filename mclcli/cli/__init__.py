"""The command line: a thin layer of click over library calls. ``main`` is the entry point."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import click

from mclcli.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence

# name: what `mcl --help` says of it; each command is a function `command` in the module, or the package's module
# `command`, of its name
COMMANDS = {
    "info": "What a log holds, which topic plays which part, and how to run it.",
    "dt": "Compute (or find in the cache) the distance field of a map.",
    "score": "Score poses of a robot against one scan.",
    "locate": "Find where a scan was taken, anywhere on the map.",
    "run": "Run Monte Carlo Localization over a log.",
    "smooth": "The best track of a log: every scan and all of its odometry at once.",
    "plot": "Draw reliability, ESS, particles and errors of a run over time.",
    "eval": "Errors of tracks against a reference, with limits for CI.",
    "extract": "Print one message of a log, a laser scan ready for `mcl score -`.",
    "recover": "Save every whole message of a damaged log into a clean MCAP.",
    "params": "Print every parameter with its effective value and meaning.",
}
# what `mcl --help` lists together
GROUPS = {
    "Look at a log or a map": ("info", "extract", "dt"),
    "Localize": ("run", "smooth", "locate", "score"),
    "Judge the result": ("eval", "plot"),
    "Prepare": ("params", "recover"),
}
EXAMPLES = """\
Try:
  mcl info LOG                                    what it holds, how to run it
  mcl run LOG --map MAP.yaml --picture track.png  where the robot was\
"""
_HELP = "Explain a command: `mcl help run` is `mcl run --help`."

_PACKAGES = {"run", "smooth", "eval", "locate", "score"}


def load_command(name: str) -> click.Command:
    """A subcommand by its name, imported now."""
    import importlib

    where = f"mclcli.cli.{name}.command" if name in _PACKAGES else f"mclcli.cli.{name}"
    command: click.Command = importlib.import_module(where).command
    return command


class _LazyGroup(click.Group):
    """Imports a subcommand's module only when that subcommand is called."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Words after ``mcl``, with ``help [COMMAND]`` read as ``[COMMAND] --help``."""
        if args[:1] == ["help"]:
            return self.parse_args(ctx, [*args[1:], "--help"])
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all subcommands, in the order of the help."""
        del ctx
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The subcommand of this name, imported now; None if there is none."""
        del ctx
        if cmd_name not in COMMANDS:
            return None
        return load_command(cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The subcommand that the first word names; UsageError, with the nearest name, if there is none."""
        if args and args[0] not in COMMANDS:
            from mclcli.errors import nearest_name

            hint = nearest_name(args[0], [*COMMANDS, "help"]) or "; `mcl --help` lists the commands"
            raise click.UsageError(f"no command '{args[0]}'{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the subcommands in the help without importing any."""
        del ctx
        listed = {heading: [(name, COMMANDS[name]) for name in names] for heading, names in GROUPS.items()}
        listed["Help"] = [("help", _HELP)]
        width = max(map(len, [*COMMANDS, "help"]))
        for heading, rows in listed.items():
            with formatter.section(heading):
                formatter.write_dl([(name.ljust(width), what) for name, what in rows])


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, "-V", "--version", prog_name="mcl")
def group() -> None:
    """Replay a robot's recorded log through Monte Carlo Localization: offline, repeatable, every weight visible."""


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    from mclcli.cli.process import run

    if "_MCL_COMPLETE" in os.environ:
        from mclcli.cli.completion import answer

        sys.exit(answer(group))
    sys.exit(run(group, list(sys.argv[1:] if args is None else args)))
