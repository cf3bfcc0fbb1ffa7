"""What is known of the building: occupancy, distances, landmarks."""

from typing import Literal

FieldMethod = Literal["exact", "brushfire"]  # how distances are found, see ``distance_field``
