"""How a command ends: exceptions and signals become one line on stderr and an exit code."""

from __future__ import annotations

import os
import signal
import sys
import traceback
from typing import NoReturn, final

import click

from mclcli import startup
from mclcli.cli import console
from mclcli.errors import ExitCode, InputError, MclError
from mclcli.text import clean


def run(group: click.Group, args: list[str]) -> int:
    """Run the command line; returns the exit code. ``--debug`` shows the traceback as well."""
    if sys.stdin is None:  # as Python leaves it where the shell closed it (``<&-``)
        sys.stdin = _ClosedInput()
    if sys.stdout is None:
        sys.stdout = _ClosedOutput()
    try:
        return _attempt(group, args)
    except (KeyboardInterrupt, click.exceptions.Abort):
        _give_up_output()
        return 128 + signal.SIGINT
    except SystemExit:  # a signal
        _give_up_output()
        raise


def _attempt(group: click.Group, args: list[str]) -> int:
    """Run the command line and explain what goes wrong; signals may end that as well, and pass through."""
    received = startup.Received()
    try:
        if args:  # imported while a signal still ends the process at once
            group.get_command(click.Context(group), args[0])
        received = startup.unwind_on_signals()
        # Not group.main(): it turns a closed pipe into exit code 1 before we see it.
        with group.make_context("mcl", args) as context:
            code = group.invoke(context)
        sys.stdout.flush()
    except click.exceptions.Abort:
        raise
    except ImportError as error:
        if not received.number:
            return _told(error, args)
        _give_up_output()
        return 128 + received.number
    except Exception as error:  # noqa: BLE001 - the last line of defence: no traceback reaches the user
        return _told(error, args)
    return code if isinstance(code, int) else ExitCode.COMPLETE


def _told(error: Exception, args: list[str]) -> int:
    """Explain an error; the exit code."""
    if "--debug" in args and not isinstance(error, BrokenPipeError | click.exceptions.Exit):
        traceback.print_exc()
    code = _explain(error)
    _give_up_output()
    return code


@final
class _ClosedInput:
    """Stands for a standard input that is closed: to read it is an error, all else goes on."""

    closed = True

    @property
    def buffer(self) -> NoReturn:
        """Refuse to be read."""
        raise InputError("standard input: cannot read: it is closed; name a file")


@final
class _ClosedOutput:
    """Stands for a standard output that is closed: what would be lost there is an error, all else goes on."""

    closed = True
    encoding = "utf-8"
    errors = "strict"

    def write(self, text: str) -> NoReturn:
        """Refuse any text but none."""
        del text
        raise InputError("standard output: cannot write: it is closed; name a file with -o")

    def flush(self) -> None:
        """Nothing is held back."""

    def isatty(self) -> bool:
        """No terminal."""
        return False


def _give_up_output() -> None:
    """Let go of what standard output does not take, or Python would try again at its end, and exit with 120."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _explain(error: Exception) -> int:
    """Print what went wrong, if anything needs saying, and return the exit code."""
    if isinstance(error, BrokenPipeError):
        return 128 + signal.SIGPIPE
    if isinstance(error, click.exceptions.Exit):
        return error.exit_code
    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        from mclcli.cli import EXAMPLES

        error.show()
        if error.ctx.parent is None:
            click.echo(f"\n{EXAMPLES}", err=True)
        return ExitCode.USAGE
    message, code = _sentence(error)
    click.echo(console.line("error", clean(message, 1000)), err=True, color=console.in_colour() or None)
    return code


def _sentence(error: Exception) -> tuple[str, int]:
    """One line for the user, and the exit code."""
    match error:
        case click.ClickException():
            return _click_message(error), ExitCode.USAGE
        case MclError():
            return str(error), error.exit_code
        case MemoryError():
            return "out of memory; fewer particles or poses, or a smaller map, need less", ExitCode.FAILED
        case FileNotFoundError():
            return f"{error.filename}: no such file", ExitCode.USAGE
        case OSError():
            return f"{error.filename or 'input or output'}: {error.strerror or error}", ExitCode.FAILED
        case _:
            where = f"{type(error).__name__}: {error}"
            return (
                f"internal error: {where}; this is a bug in mcl: run again with --debug and report it",
                ExitCode.INTERNAL,
            )


def _click_message(error: click.ClickException) -> str:
    command = error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else "mcl"
    message = error.format_message().rstrip(".")
    return message if "--help`" in message else f"{message}; see `{command} --help`"
