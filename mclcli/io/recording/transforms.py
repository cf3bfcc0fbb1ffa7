"""The transforms of a log by the topics they came on: robots whose frames have the same names do not mix."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry.frames import TransformTree
from mclcli.io.recording.samples import EvenSample

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mclcli.records import Transform

RUNS = 64
"""Runs of three transforms that are kept of each moving edge."""

_NAME = re.compile(r"(.*?)tf(?:_static)?(?:\W.*|_.*)?")


def namespace_of(topic: str) -> str:
    """Whose transforms a topic carries, by its name: ``/robot1/`` of ``/robot1/tf`` and of ``/robot1/tf_static``."""
    folder, slash, name = topic.rpartition("/")
    known = _NAME.fullmatch(name)
    return f"{folder}{slash}{known[1]}" if known else topic


@final
@dataclass(slots=True)
class TransformSurvey:
    """What a look through a log found out about the transforms of one namespace.

    ``topics`` carry them. ``statics`` holds the fixed ones by child, ``sampled`` some others by parent and child.
    """

    topics: list[str] = field(default_factory=list)
    tree: TransformTree = field(default_factory=lambda: TransformTree(keep_history=False))
    statics: dict[str, Transform] = field(default_factory=dict)
    sampled: dict[tuple[str, str], EvenSample[Transform]] = field(default_factory=dict)

    def travel(self, edge: tuple[str, str]) -> tuple[float, float]:
        """How far [m, rad] the child of an edge (parent, child) goes from where it is at first, by a sample."""
        matrices = np.array([transform.parent_from_child for transform in self.sampled[edge].items])
        turned = np.linalg.inv(matrices[0, :3, :3]) @ matrices[:, :3, :3]
        angles = np.arccos(np.clip((np.trace(turned, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
        return float(np.linalg.norm(matrices[:, :3, 3] - matrices[0, :3, 3], axis=1).max()), float(angles.max())

    def add(self, topic: str, transforms: Iterable[Transform]) -> None:
        """Take the transforms of one message in."""
        if topic not in self.topics:
            self.topics.append(topic)
        for transform in transforms:
            self.tree.add(transform)
            if transform.static:
                self.statics[transform.child] = transform
                continue
            edge = transform.parent, transform.child
            sample = self.sampled.get(edge)
            if sample is None:
                sample = self.sampled[edge] = EvenSample(3, RUNS)
            if sample.wants():
                sample.keep(transform)
