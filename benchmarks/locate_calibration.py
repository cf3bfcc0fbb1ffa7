"""Fit and judge the probabilities of ``mcl locate``: ``python -m benchmarks.locate_calibration WORLDS.csv [REAL.csv]``.

Fits the logistic of ``mclcli.search.calibration`` on the layouts with even seeds (weights that would make it fall where
it should rise are held at 0) and prints its constants; then, with those in the source, how the held-out layouts do, and
real logs; ``--picture`` draws both. ``--least`` is the probability from which an answer counts as confident.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import math
from pathlib import Path

import numpy as np

from benchmarks.locate_worlds import OFF_MAP
from mclcli.search import calibration
from mclcli.search.calibration import Figures

Row = dict[str, str]
_EDGES = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 0.98, 1.0)


def figures(row: Row) -> Figures:
    """The figures of one search."""
    return Figures(**{name: float(row[name]) for name in Figures.__dataclass_fields__})


def features(rows: list[Row]) -> np.ndarray:
    """A row per search: 1 and the clipped figures."""
    terms = calibration.TERMS
    told = [figures(row) for row in rows]
    columns = [np.clip([getattr(one, term.figure) for one in told], term.low, term.high) for term in terms]
    return np.column_stack([np.ones(len(rows)), *columns])


def fit(rows: list[Row]) -> np.ndarray:
    """Constant and weights of the greatest likelihood with a slight pull to 0, signs as in the source."""
    from scipy.optimize import minimize

    widths = np.array([1.0, *(term.high - term.low for term in calibration.TERMS)])
    x, y = features(rows) / widths, np.array([int(row["right"]) for row in rows], dtype=np.float64)
    pull = np.array([0.0, *[0.04] * len(calibration.TERMS)])

    def cost(weights: np.ndarray) -> tuple[float, np.ndarray]:
        z = x @ weights
        slope = x.T @ (1.0 / (1.0 + np.exp(-z)) - y) + pull * weights
        return float(np.sum(np.logaddexp(0.0, z) - y * z) + 0.5 * pull @ weights**2), slope

    bounds = [(None, None), *[(0.0, None) if term.weight > 0.0 else (None, 0.0) for term in calibration.TERMS]]
    found = minimize(cost, np.zeros(len(widths)), jac=True, method="L-BFGS-B", bounds=bounds)
    return np.array([weight / width for weight, width in zip(found.x, widths, strict=True)])


def wilson(right: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Bounds of a share. Source: Wilson 1927."""
    if count == 0:
        return 0.0, 1.0
    share, spread = right / count, z * z / count
    middle = (share + spread / 2.0) / (1.0 + spread)
    half = z * math.sqrt(share * (1.0 - share) / count + spread / (4.0 * count)) / (1.0 + spread)
    return middle - half, middle + half


def judge(rows: list[Row], title: str) -> None:
    """Reliability, log score and coverage of the probabilities that the source gives."""
    p = np.array([calibration.probability(figures(row)) for row in rows])
    y = np.array([int(row["right"]) for row in rows])
    score = -float(np.mean(np.where(y == 1, np.log(p), np.log1p(-p))))
    base = y.mean() if 0 < y.sum() < y.size else 0.5
    plain = -float(np.mean(np.where(y == 1, np.log(base), np.log1p(-base))))
    print(f"\n{title}: {len(rows)} searches, {y.mean():.0%} right, log score {score:.3f} (base rate {plain:.3f})\n")
    print("| probability | searches | mean | right | 95 % band |\n|---|---|---|---|---|")
    for low, high in itertools.pairwise(_EDGES):
        inside = (p >= low) & ((p < high) | (high == 1.0))
        if inside.any():
            bounds = wilson(int(y[inside].sum()), int(inside.sum()))
            print(
                f"| {low:g}–{high:g} | {inside.sum()} | {p[inside].mean():.3f} | {y[inside].mean():.3f} | "
                f"{bounds[0]:.2f}–{bounds[1]:.2f} |"
            )


def draw(parts: dict[str, list[Row]], path: Path) -> None:
    """How often the best place was right against its probability, with Wilson bands; one panel for each part."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, len(parts), figsize=(4.2 * len(parts), 4.0), sharey=True, squeeze=False)
    for panel, (title, rows) in zip(panels[0], parts.items(), strict=True):
        p = np.array([calibration.probability(figures(row)) for row in rows])
        y = np.array([int(row["right"]) for row in rows])
        panel.plot([0, 1], [0, 1], color="0.7", linewidth=1)
        for low, high in itertools.pairwise(_EDGES):
            inside = (p >= low) & ((p < high) | (high == 1.0))
            if inside.any():
                bounds = wilson(int(y[inside].sum()), int(inside.sum()))
                panel.plot([p[inside].mean()] * 2, bounds, color="#2a6f97", linewidth=2)
                panel.plot(p[inside].mean(), y[inside].mean(), "o", color="#2a6f97", markersize=5)
        panel.set(title=f"{title}, {len(rows)} searches", xlabel="probability of the best place", xlim=(0, 1))
    panels[0, 0].set(ylabel="share that is right, 95 % band", ylim=(0, 1.02))
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def by_window(rows: list[Row], least: float) -> None:
    """A row per length of window: how often right, how often confident, and how often wrong when confident."""
    print("\n| window | searches | right | truth among 5 | confident | of those wrong |\n|---|---|---|---|---|---|")
    for window in sorted({float(row["window"]) for row in rows}):
        own = [row for row in rows if float(row["window"]) == window]
        p = np.array([calibration.probability(figures(row)) for row in own])
        y, among = (np.array([int(row[name]) for row in own]) for name in ("right", "among"))
        sure = p >= least
        wrong = f"{int((1 - y[sure]).sum())} of {sure.sum()}"
        print(f"| {window:g} s | {len(own)} | {y.mean():.1%} | {among.mean():.1%} | {sure.mean():.1%} | {wrong} |")


def main() -> None:
    """Fit and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("worlds", type=Path, help="CSV of benchmarks.locate_worlds")
    options.add_argument("real", nargs="*", type=Path, help="CSVs of benchmarks.locate_logs")
    options.add_argument("--picture", type=Path, help="reliability diagram, PNG")
    options.add_argument("--least", type=float, default=0.8)
    chosen = options.parse_args()
    rows = list(csv.DictReader(chosen.worlds.open()))
    fitted = [row for row in rows if int(row["layout"]) % 2 == 0]
    constant, *weights = fit(fitted)
    print(f"CONSTANT = {constant:.3f}")
    for term, weight in zip(calibration.TERMS, weights, strict=True):
        print(f"Term({term.figure!r}, {term.low}, {term.high}, {weight:.3f}),")
    held_out = [row for row in rows if int(row["layout"]) % 2]
    for title, part in (("Fitted layouts", fitted), ("Held-out layouts", held_out)):
        if part:
            judge(part, title)
            by_window(part, chosen.least)
    on_map = [row for row in held_out if row["change"] not in OFF_MAP]
    if on_map:
        print("\nHeld-out layouts, without robots that are elsewhere and scans of noise:")
        by_window(on_map, chosen.least)
    parts = {"Held-out layouts": held_out}
    for path in chosen.real:
        real = list(csv.DictReader(path.open()))
        parts["Real logs"] = parts.get("Real logs", []) + real
        judge(real, path.stem)
        for log in dict.fromkeys(row["kind"] for row in real):
            print(f"\n{log}:")
            by_window([row for row in real if row["kind"] == log], chosen.least)
    if chosen.picture:
        draw(parts, chosen.picture)


if __name__ == "__main__":
    main()
