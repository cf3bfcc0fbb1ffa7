"""What is known of the building: occupancy, distances, landmarks."""

from typing import Literal

FieldMethod = Literal["exact", "brushfire"]  # how distances are found, see ``distance_field``
MapUpdate = Literal["auto", "first", "last", "follow"]
"""Which message of a map's topic counts: ``auto`` the last of a map that grew and else the first, ``follow`` the one in
force at each update."""
