"""Every parameter in one table, by profile; and the robots' own files of parameters."""

from typing import Literal

Profile = Literal["textbook", "nav2", "beluga"]  # whose rules and defaults are followed, see ``profiles``
