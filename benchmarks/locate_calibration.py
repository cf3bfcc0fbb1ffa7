"""The posterior of ``mcl locate``, judged: ``python -m benchmarks.locate_calibration WORLDS.jsonl [REAL.jsonl]``.

Reads what ``benchmarks.locate_worlds`` and ``benchmarks.locate_logs`` wrote. ``--fit`` finds the constants of
``mclcli.search.calibration`` with the best log score on layouts with even seeds, and prints them; without it, those in
the source are judged, on the other layouts and on real logs. ``--picture`` draws how often a share was right.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mclcli.search.calibration import LAW, Law
from mclcli.search.evidence import Looked, weigh
from mclcli.search.posterior import Posterior, posterior

_EDGES = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 0.98, 1.0)
_FITTED = ("ends", "rays", "changed", "fitting", "strange", "beams", "doubt")
_OFF_MAP_WEIGHT = 0.2  # of all robots that are not on the map, over those that are
_PRIOR = 0.05
_FLOOR = 1e-3


@dataclass(frozen=True)
class Case:
    """A search: what was measured at its places, which of them are right (M,), and what it is about."""

    about: dict[str, Any]
    looked: Looked
    right: np.ndarray
    left_out: float

    @property
    def on_map(self) -> bool:
        """Whether the robot is on the map."""
        return bool(self.about["on_map"])

    def posterior(self, law: Law) -> Posterior:
        """What a law makes of it."""
        return posterior(weigh(self.looked, law), self.left_out, _PRIOR, law)

    def probability(self, law: Law) -> float:
        """Of what is true: the right place, one that was not listed, or another map."""
        found = self.posterior(law)
        if not self.on_map:
            return found.elsewhere
        right = self.right[found.order]
        return float(found.shares[right].sum()) if right.any() else found.unlisted


def read(path: Path) -> list[Case]:
    """Cases of a file, a line each."""
    cases = []
    for line in path.open():
        row = json.loads(line)
        values: dict[str, Any] = {k: np.array(v) if isinstance(v, list) else v for k, v in row.pop("looked").items()}
        looked = Looked(**values)
        right, left_out = np.array(row.pop("right"), bool), row.pop("left_out")
        cases.append(Case(row, looked, right, left_out))
    return cases


def log_score(cases: list[Case], law: Law) -> float:
    """Mean −log of the probability of what is true; robots off the map count as a fifth of those on it."""
    on = sum(case.on_map for case in cases)
    weight = _OFF_MAP_WEIGHT * on / max(len(cases) - on, 1)
    scores = [-math.log(max(case.probability(law), _FLOOR)) for case in cases]
    return float(np.average(scores, weights=[1.0 if case.on_map else weight for case in cases]))


def fit(cases: list[Case], tries: int) -> Law:
    """The law with the best log score; ``length`` and ``unlisted`` are given, not fitted."""
    from scipy.optimize import minimize

    def law_of(values: np.ndarray) -> Law:
        return dataclasses.replace(LAW, **dict(zip(_FITTED, values.tolist(), strict=True)))

    def cost(values: np.ndarray) -> float:
        law = law_of(values)
        sound = 0.02 < law.ends < 3.0 and 0.0 <= law.rays <= law.ends and law.strange < law.fitting
        return log_score(cases, law) if sound else 1e3

    start = np.array([getattr(LAW, name) for name in _FITTED])
    simplex = start + np.vstack([np.zeros(start.size), np.diag(0.25 * np.abs(start) + 0.05)])
    found = minimize(cost, start, method="Nelder-Mead", options={"maxfev": tries, "initial_simplex": simplex})
    return law_of(found.x)


def wilson(right: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Bounds of a share. Source: Wilson 1927."""
    if count == 0:
        return 0.0, 1.0
    share, spread = right / count, z * z / count
    middle = (share + spread / 2.0) / (1.0 + spread)
    half = z * math.sqrt(share * (1.0 - share) / count + spread / (4.0 * count)) / (1.0 + spread)
    return middle - half, middle + half


def told(cases: list[Case], law: Law) -> tuple[np.ndarray, np.ndarray]:
    """Share of every place and of being elsewhere, and whether that was so."""
    shares: list[float] = []
    so: list[bool] = []
    for case in cases:
        found = case.posterior(law)
        shares += [*found.shares.tolist(), found.elsewhere]
        so += [*(case.right[found.order] & case.on_map).tolist(), not case.on_map]
    return np.array(shares), np.array(so)


def judge(cases: list[Case], law: Law, title: str, least: float) -> None:
    """How often shares were right, and what each family and window came to."""
    p, y = told(cases, law)
    print(f"\n{title}: {len(cases)} searches, log score {log_score(cases, law):.3f}\n")
    print("| share | places | mean | so | 95 % band |\n|---|---|---|---|---|")
    for low, high in itertools.pairwise(_EDGES):
        inside = (p >= max(low, 0.01)) & ((p < high) | (high == 1.0))
        if inside.any():
            bounds = wilson(int(y[inside].sum()), int(inside.sum()))
            print(
                f"| {low:g}–{high:g} | {inside.sum()} | {p[inside].mean():.3f} | {y[inside].mean():.3f} | "
                f"{bounds[0]:.2f}–{bounds[1]:.2f} |"
            )
    for name in ("family", "window"):
        print(f"\n| {name} | searches | right | listed | among 5 | confident | of those wrong | not on this map |")
        print("|---|---|---|---|---|---|---|---|")
        for value in dict.fromkeys(case.about[name] for case in cases):
            print(f"| {value} | {_row([case for case in cases if case.about[name] == value], law, least)} |")


def _row(cases: list[Case], law: Law, least: float) -> str:
    found = [case.posterior(law) for case in cases]
    right = [case.right[one.order] & case.on_map for case, one in zip(cases, found, strict=True)]
    sure = np.array([one.shares[0] >= least for one in found])
    first = np.array([one[0] for one in right])
    shares = [
        first.mean(), np.mean([one.any() for one in right]), np.mean([one[:5].any() for one in right]), sure.mean()
    ]  # fmt: skip
    elsewhere = np.mean([one.elsewhere for one in found])
    wrong = f"{(sure & ~first).sum()} of {sure.sum()}"
    return f"{len(cases)} | {' | '.join(f'{share:.0%}' for share in shares)} | {wrong} | {elsewhere:.2f}"


def draw(parts: dict[str, list[Case]], law: Law, path: Path) -> None:
    """How often a share was right against the share, with Wilson bands; one panel for each part."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, len(parts), figsize=(4.2 * len(parts), 4.0), sharey=True, squeeze=False)
    for panel, (title, cases) in zip(panels[0], parts.items(), strict=True):
        p, y = told(cases, law)
        panel.plot([0, 1], [0, 1], color="0.7", linewidth=1)
        for low, high in itertools.pairwise(_EDGES):
            inside = (p >= max(low, 0.01)) & ((p < high) | (high == 1.0))
            if inside.any():
                bounds = wilson(int(y[inside].sum()), int(inside.sum()))
                panel.plot([p[inside].mean()] * 2, bounds, color="#2a6f97", linewidth=2)
                panel.plot(p[inside].mean(), y[inside].mean(), "o", color="#2a6f97", markersize=5)
        panel.set(title=f"{title}, {len(cases)} searches", xlabel="share of a place", xlim=(0, 1))
    panels[0, 0].set(ylabel="how often it was so, 95 % band", ylim=(0, 1.02))
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Fit and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("worlds", type=Path, help="what benchmarks.locate_worlds wrote")
    options.add_argument("real", nargs="*", type=Path, help="what benchmarks.locate_logs wrote")
    options.add_argument("--fit", type=int, default=0, metavar="N", help="fit, with N evaluations")
    options.add_argument("--picture", type=Path, help="reliability diagram, PNG")
    options.add_argument("--least", type=float, default=0.8)
    chosen = options.parse_args()
    cases = read(chosen.worlds)
    even = [case for case in cases if case.about["layout"] % 2 == 0]
    law = fit(even, chosen.fit) if chosen.fit else LAW
    print(law)
    parts = {"Held-out layouts": [case for case in cases if case.about["layout"] % 2]}
    judge(even, law, "Fitted layouts", chosen.least)
    judge(parts["Held-out layouts"], law, "Held-out layouts", chosen.least)
    for path in chosen.real:
        parts["Real logs"] = parts.get("Real logs", []) + read(path)
        judge(parts["Real logs"], law, "Real logs", chosen.least)
    if chosen.picture:
        draw(parts, law, chosen.picture)


if __name__ == "__main__":
    main()
