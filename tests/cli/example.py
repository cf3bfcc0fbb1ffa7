"""The worked example of the samples through ``mcl score``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.cli.support import OFFICE_MAP, REFERENCE_MAP, SAMPLES, Table, mcl

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.world import FieldMethod

MODEL = ("--set", "z_hit=0.95", "--set", "z_rand=0.05", "--set", "sigma_hit=15cm")
SCORE_ALL = ("--set", "max_range=score")
LANDMARKS = SAMPLES / "reference.landmarks.csv"
METHODS: tuple[FieldMethod, ...] = ("brushfire", "exact")
SCAN = SAMPLES / "reference_set3.yaml"
POSES = SAMPLES / "reference_set3.poses.csv"
NEAR = ("--map", OFFICE_MAP, "--pose", "-7.4,1.6,-85deg", "--pose", "-7.3,1.5,-80deg")


def reference(number: int, method: FieldMethod, *words: object, grid: Path = REFERENCE_MAP) -> Table:
    """One set of the worked example through the command line."""
    named = (SAMPLES / f"reference_set{number}.yaml", "--poses", SAMPLES / f"reference_set{number}.poses.csv")
    switches = (*MODEL, "--set", f"field_method={method}", *(SCORE_ALL if number == 2 else ()))
    result = mcl("score", *named, "--map", grid, *switches, *words)
    assert result.code == 0, result.err
    return result.table
