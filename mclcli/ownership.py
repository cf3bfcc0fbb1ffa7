"""Who may change a file or folder: what others than this user and the superuser may change is not to be believed."""

from __future__ import annotations

import functools
import os
import stat
import sys
from pathlib import Path

_MAX_LINKS = 40  # as of Linux


def is_ours(status: os.stat_result) -> bool:
    """Whether a file or folder belongs to this user."""
    return sys.platform == "win32" or status.st_uid == os.getuid()


def fault(status: os.stat_result, place: int | str) -> str:
    """Why a file or folder (its status, and its descriptor or path) is not this user's alone; empty if it is."""
    if not is_ours(status):
        return "it belongs to another user"
    return "others may write to it" if _others_may_write(status, place) else ""


def fault_on_the_way(path: Path) -> tuple[Path, str] | None:
    """First folder or link by which others may change where a path leads, and why; None if there is none.

    A folder on the way may be everybody's if it is sticky, as /tmp is: there, nobody takes away what is not his. What
    is missing is no fault. Where nothing is wrong, only this user and the superuser can change that, so the path may be
    used later.
    """
    if sys.platform == "win32":
        return None
    at, links, left = "/", 0, list(reversed(path.parts if path.is_absolute() else (Path.cwd() / path).parts))
    trusted = {os.getuid(), 0, os.lstat(at).st_uid}  # in a container, the superuser may show as another number
    try:
        while left:
            name = left.pop()
            match name:
                case "..":
                    here = str(Path(at).parent)
                case _ if name.startswith("/"):
                    here = name  # a link may start anew
                case _:
                    here = f"{at.rstrip('/')}/{name}"
            status = os.lstat(here)
            if status.st_uid not in trusted:
                return Path(here), "it belongs to another user"
            if stat.S_ISLNK(status.st_mode):
                links += 1
                left += reversed(Path(here).readlink().parts if links <= _MAX_LINKS else ())
                continue
            if not status.st_mode & stat.S_ISVTX and _others_may_write(status, here):
                return Path(here), "others may write to it"
            at = here
    except OSError:  # whoever opens the path meets the same error, and says it
        return None
    return None


def _others_may_write(status: os.stat_result, place: int | str) -> bool:
    if sys.platform == "win32":
        return False
    if status.st_mode & stat.S_IWOTH:
        return True
    return bool(status.st_mode & stat.S_IWGRP) and (_names_others(place) or not _is_our_group(status.st_gid))


def _names_others(place: int | str) -> bool:
    """Whether rights are given to users and groups by name, for which the bits of the group stand."""
    if sys.platform != "linux":
        return False
    try:
        return bool(os.getxattr(place, "system.posix_acl_access"))
    except OSError:
        return False


@functools.cache
def _is_our_group(group: int) -> bool:
    """Whether nobody but this user and the superuser is a member; no if that cannot be known."""
    import grp
    import pwd

    try:
        entry, name = grp.getgrgid(group), pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return False
    accounts = pwd.getpwall()
    members = {account.pw_name for account in accounts if account.pw_gid == group} | set(entry.gr_mem)
    known = {account.pw_name for account in accounts if account.pw_uid in {os.getuid(), 0}}
    # Directory services list nobody: there, only a group of the user's name is taken for the user's alone.
    return members <= known | {name} and (name in known or entry.gr_name == name)
