"""Make everything in samples/ and maps/ again: ``python samples/generate.py [--out DIR] [NAME...]``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))  # the simulator is not installed: it lives beside this file

from samples.sim.files import write_landmarks, write_map_pgm, write_map_png, write_truth  # noqa: E402
from samples.sim.log_writer import write_log  # noqa: E402
from samples.sim.recording import drift, simulate  # noqa: E402
from samples.sim.reference import write_reference  # noqa: E402
from samples.sim.scenarios import SCENARIOS  # noqa: E402

REFERENCE = "reference"
PNG_MAPS = frozenset({"warehouse"})
NAMES = (*SCENARIOS, REFERENCE)


def generate(name: str, out: Path) -> list[Path]:
    """Make one sample under ``out``/samples and ``out``/maps; returns what was written.

    Raises
    ------
    KeyError
        If there is no sample of this name.

    """
    maps, samples = out / "maps", out / "samples"
    for folder in (maps, samples):
        folder.mkdir(parents=True, exist_ok=True)
    return write_reference(maps, samples) if name == REFERENCE else _write_scenario(name, maps, samples)


def main(arguments: list[str] | None = None) -> int:
    """Make the samples named on the command line, or all of them."""
    parser = argparse.ArgumentParser(description="Make the sample logs and maps.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"any of {', '.join(NAMES)}; none means all")
    parser.add_argument("--out", type=Path, default=ROOT, help="folder for samples/ and maps/ (default: here)")
    options = parser.parse_args(arguments)
    unknown = sorted(set(options.names) - set(NAMES))
    if unknown:
        parser.error(f"no sample named {', '.join(unknown)}; there are {', '.join(NAMES)}")
    for name in options.names or NAMES:
        for path in generate(name, options.out):
            print(f"{path.stat().st_size:9d}  {path.relative_to(options.out)}")
    return 0


def _write_scenario(name: str, maps: Path, samples: Path) -> list[Path]:
    recording = simulate(SCENARIOS[name]())
    building = recording.scenario.mapped
    log, truth, marks = (samples / f"{name}{suffix}" for suffix in (".mcap", ".truth.tum", ".landmarks.csv"))
    write_log(recording, log)
    write_truth(recording.truth, truth)
    write_landmarks(building, marks)
    if name in PNG_MAPS:
        write_map_png(building, maps / f"{name}.yaml")
    else:
        write_map_pgm(building.grid, building.resolution, building.origin, maps / f"{name}.yaml")
    image = maps / f"{name}{'.png' if name in PNG_MAPS else '.pgm'}"
    print(
        f"{name}: {len(recording.ranges)} scans, odometry {drift(recording)[-1]:.2f} m off at the end", file=sys.stderr
    )
    return [log, truth, marks, maps / f"{name}.yaml", image]


if __name__ == "__main__":
    raise SystemExit(main())
