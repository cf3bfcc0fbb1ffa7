"""Completion by Tab in bash, zsh and fish: what an option can take, from the files that the words before it name.

``_MCL_COMPLETE=bash_source mcl`` prints the script, see click's shell_completion.
"""

from __future__ import annotations

import itertools
import os
from pathlib import Path
from typing import TYPE_CHECKING

from click.shell_completion import CompletionItem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import click
    from click.shell_completion import CompletionItem

    Completer = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]

VARIABLE = "_MCL_COMPLETE"
_LOOKED_AT = 3000  # messages of a log: nobody waits for the whole of it


def answer(group: click.Group) -> int | None:
    """Print what a shell asks for in the environment; the exit code, None if it asks for nothing."""
    from click.shell_completion import shell_complete

    asked = os.environ.get(VARIABLE)
    return shell_complete(group, {}, "mcl", VARIABLE, asked) if asked else None


def files(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Names of files; the shell itself knows them."""
    from click.shell_completion import CompletionItem

    del ctx, param
    return [CompletionItem(incomplete, type="file")]


def settings(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """``KEY=`` of every parameter, and behind it what the parameter can be."""
    from click.shell_completion import CompletionItem

    from mclcli.settings import profiles

    del ctx, param
    key, sign, _ = incomplete.partition("=")
    known = {name: description for _, name, _, description in profiles.table()}
    if not sign:
        return [CompletionItem(f"{name}=", help=known[name].meaning) for name in known if name.startswith(key)]
    choices = known[key].choices if key in known else ()
    return _starting(incomplete, [f"{key}={choice}" for choice in choices])


def topics(part: str, *words: str) -> Completer:
    """Topics of the log that may play a part (``scan``, ``odometry``, ``vision``, ``poses``, or any), after ``words``.

    Without one, files are offered where a file may stand in place of a topic.
    """

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        named = [name for name, kind in _topics_of(ctx) if _fits(part, kind)]
        found = _starting(incomplete, [*words, *named])
        may_be_file = "FILE" in (param.metavar or "") and not incomplete.startswith("/")
        return found or (files(ctx, param, incomplete) if may_be_file else [])

    return complete


def _starting(incomplete: str, texts: list[str]) -> list[CompletionItem]:
    from click.shell_completion import CompletionItem

    return [CompletionItem(text) for text in texts if text.startswith(incomplete)]


def _fits(part: str, kind: str) -> bool:
    from mclcli.io.recording import kinds

    types = {
        "scan": kinds.SCAN,
        "odometry": kinds.ODOMETRY,
        "vision": kinds.SIGHTINGS,
        "poses": (*kinds.POSES, *kinds.ODOMETRY),
    }
    return part not in types or kind in types[part]


def _topics_of(ctx: click.Context) -> Iterator[tuple[str, str]]:
    """Topics and types at the beginning of the logs that the words before name."""
    from mclcli.errors import MclError
    from mclcli.io.logs import open_log
    from mclcli.io.logs.base import Tally

    # click leaves the arguments unread where the last option has no value yet.
    given = ctx.params.get("logs") or ctx.params.get("log") or ctx.params.get("scan") or ctx.args
    paths = [Path(name) for name in ([given] if isinstance(given, str) else given)]
    try:
        log = open_log([path for path in paths if path.exists()])
        messages = itertools.islice(log.messages(None, Tally(), announce=False), _LOOKED_AT)
        yield from sorted({(message.channel.topic, message.channel.type) for message in messages})
    except (MclError, OSError):
        return
