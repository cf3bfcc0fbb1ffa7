"""``--json``: what is promised in docs/formats.md is there, of the kinds promised, and standard output is its own."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.cli.results import plain, seconds
from tests.cli.support import OFFICE, OFFICE_MAP, REFERENCE_MAP, ROOT, SAMPLES, Table, mcl, single_error

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner

NUMBER = (int, float)
POSE = {"x": float, "y": float, "yaw": float}
PLACE = {"stamp": float, **POSE, "position_sd": float, "yaw_sd": float}
RUN = {
    "version": str,
    "logs": [str],
    "map": str,
    "profile": str,
    "model": str,
    "seed": int,
    "updates": int,
    "duration": float,
    "way": float,
    "segments": int,
    "log_start": float,
    "starts": [{"stamp": float, "places": [{**POSE, "probability": float}], "not_on_map": float}],
    "first": PLACE,
    "last": PLACE,
    "ends_lost": bool,
    "converged": bool,
    "reliability": {"mean": float, "least": float, "last": float},
    "lost_updates": int,
    "lost": [
        {"start": float, "end": float, "from": [float], "to": [float], "reliability": float, "updates": int},
    ],
    "degenerate": int,
    "sensors": {
        "lidar": {"topic": str, "used": int, "skipped": dict, "scored": int, "unknown": int, "alpha": float},
    },
    "doubts": [str],
    "truth": (dict, type(None)),
    "versus": (dict, type(None)),
    "damaged": bool,
    "took": float,
}
SCORED = {**POSE, "log_lidar": float, "log_weight": float, "weight": float}
SCORE = {
    "map": str,
    "stamp": float,
    "sensors": {"lidar": {"scored": int, "alpha": float}},
    "best": {"index": int, **SCORED},
    "poses": [SCORED],
}
NOT_SAVED = [{"topic": str, "reason": str, "messages": int}]
RECOVER = {
    "output": str,
    "messages": int,
    "topics": dict,
    "beside": dict,
    "not_saved": NOT_SAVED,
    "lost": int,
    "lost_more": bool,
}
PARAMETER = {
    "value": (str, bool, *NUMBER),
    "unit": (str, type(None)),
    "meaning": str,
    "choices": (list, type(None)),
    "group": str,
    "in_nav2": bool,
}
PARAMS = {"profile": str, "model": str, "parameters": dict}
DT = {
    "map": str,
    "width": int,
    "height": int,
    "resolution": float,
    "occupied": int,
    "method": str,
    "max_dist": float,
    "milliseconds": float,
    "cache": str,
    "file": str,
}
SEEDS = {
    "seeds": [int],
    "last": {"middle": POSE, "position": float, "yaw": float},
    "truth": (dict, type(None)),
    "runs": [RUN],
}
SCAN = SAMPLES / "reference_set3.yaml"


def check(value: object, schema: object, where: str = "result") -> None:
    """Hold a value against a schema of kinds: keys are the same, lists hold items of one kind."""
    if isinstance(schema, dict):
        assert isinstance(value, dict), where
        assert list(value) == list(schema), where
        for key, kind in schema.items():
            check(value[key], kind, f"{where}.{key}")
    elif isinstance(schema, list):
        assert isinstance(value, list), where
        for number, item in enumerate(value):
            check(item, schema[0], f"{where}[{number}]")
    else:
        kinds = schema if isinstance(schema, tuple) else (schema,)
        assert type(value) in kinds, f"{where}: {value!r}"


def facts(*words: object) -> dict[str, Any]:
    """What a command prints with --json."""
    result = mcl(*words, "--json")
    assert result.code == 0, result.err
    found = json.loads(result.out, parse_constant=lambda text: pytest.fail(f"{text} is no JSON"))
    assert isinstance(found, dict)
    return found


def test_run(run_short: Runner) -> None:
    result = run_short("--json", init="4,-4,0,0.1,3deg")
    found = json.loads(result.out)
    check(found, RUN)
    steps = run_short("--steps", "-", init="4,-4,0,0.1,3deg").table
    assert found["updates"] == len(steps.rows)
    assert found["last"]["x"] == pytest.approx(steps["x"][-1], abs=1e-9)
    assert found["reliability"]["mean"] == pytest.approx(steps["reliability"].mean())
    assert found["lost_updates"] == steps["lost"].sum() == sum(stretch["updates"] for stretch in found["lost"]) > 0
    assert found["lost"][0]["start"] == pytest.approx(steps["stamp"][np.flatnonzero(steps["lost"])[0]])
    assert [f"mcl: warning: {doubt}" in result.err for doubt in found["doubts"]] == [True] * len(found["doubts"])
    assert found["doubts"]


def test_run_with_references_and_a_search(run_short: Runner) -> None:
    found = json.loads(
        run_short("--json", "--truth", SAMPLES / "office.truth.tum", "--versus", "/ground_truth", init="global").out
    )
    check(found, RUN)
    assert len(found["starts"]) == 1
    assert found["starts"][0]["places"][0]["probability"] > 0.5
    assert found["truth"]["ape"]["translation"]["rmse"] < 0.2
    assert found["versus"]["source"] == "/ground_truth"


def test_run_writes_its_outputs_as_without(run_short: Runner, tmp_path: Path) -> None:
    plainly = run_short("--track", tmp_path / "a.csv")
    assert run_short("--track", tmp_path / "b.csv", "--json").code == plainly.code == 0
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_score() -> None:
    words = ("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0,0,0", "--pose", "0.91,-0.81,-65deg")
    found, table = facts(*words), Table(mcl(*words).out.decode())
    check(found, SCORE)
    assert list(found["poses"][0]) == table.names
    for name in table.names:
        np.testing.assert_array_equal([pose[name] for pose in found["poses"]], table[name])
    assert found["best"]["index"] == int(table["log_weight"].argmax())


def test_recover(short: Path, tmp_path: Path) -> None:
    found = facts("recover", short, "-o", tmp_path / "good.mcap")
    check(found, RECOVER)
    assert found["messages"] == sum(found["topics"].values()) > 0
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(short.read_bytes()[:-40_000])
    result = mcl("recover", cut, "-o", tmp_path / "saved.mcap", "--json")
    assert result.code == 3
    check(json.loads(result.out), RECOVER)


def test_params() -> None:
    found = facts("params", "--set", "sigma_hit=15cm")
    check(found, PARAMS)
    for name, parameter in found["parameters"].items():
        check(parameter, PARAMETER, name)
    assert found["parameters"]["sigma_hit"] == {**found["parameters"]["sigma_hit"], "value": 0.15, "unit": "m"}
    assert "--format nav2" in single_error(mcl("params", "--json", "--format", "nav2"), 2)


def test_dt(tmp_path: Path) -> None:
    check(facts("dt", REFERENCE_MAP, "--cache-dir", tmp_path), DT)


def test_seeds(run_short: Runner) -> None:
    check(json.loads(run_short("--json", "--seeds", 2).out), SEEDS)


@pytest.mark.parametrize(
    "words",
    [
        ("run", OFFICE, "--map", OFFICE_MAP, "--track", "-"),
        ("run", OFFICE, "--map", OFFICE_MAP, "-o", "-"),
        ("run", OFFICE, "--map", OFFICE_MAP, "--steps", "-"),
        ("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0,0,0", "-o", "-"),
        ("recover", OFFICE, "-o", "-"),
        ("dt", REFERENCE_MAP, "-o", "-"),
    ],
)
def test_json_takes_standard_output(words: tuple[object, ...]) -> None:
    assert "--json takes standard output" in single_error(mcl(*words, "--json"), 2)


@pytest.mark.parametrize("schema", [RUN, SCORE, RECOVER, PARAMS, PARAMETER, DT, SEEDS])
def test_every_key_is_documented(schema: dict[str, Any]) -> None:
    text = (ROOT / "docs/formats.md").read_text()
    section = text.partition("## Results as JSON")[2].partition("\n## ")[0]
    for key in schema:
        assert key in section.replace("`", " ").replace("{", " ").replace("}", " ").replace(",", " ").split(), key


def test_plain_values() -> None:
    assert plain({"a": (math.nan, math.inf, -0.0, 1), 2: {"b": np.float64(0.5)}}) == {
        "a": [None, None, 0.0, 1],
        "2": {"b": 0.5},
    }
    assert math.copysign(1.0, plain(-0.0)) == 1.0
    assert json.dumps(seconds(1_715_697_000_062_500_001)) == "1715697000.0625"
