"""Logs of every container as one stream of raw messages."""

from mclcli.io.logs.log import Log
from mclcli.io.logs.opening import open_log

__all__ = ["Log", "open_log"]
