"""Where the integrals of dense boundary elements spend their points: counted at the fundamental solution."""

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from common import Record, prose, table

from meeframe.fields import Array, Indices
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.greens import Tabulated
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.model.load import case_from_tables

MOST = {"4 (2 x 2)": 4, "6 to 9": 9, "10 to 16": 16, "17 to 64": 64, "more than 64 (divided)": np.inf}
"""Points of a pair, by groups."""
OWN = "the element holds the source"


@dataclass(frozen=True, eq=False)
class _CountedKernel(Kernel):
    """pairs: for each element seen from a source its points and its distance in its own lengths; own: points where an
    element holds the source."""

    kernel: Kernel
    pairs: list[Array]
    own: list[int]

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        self.own.append(len(offset))
        return self.kernel.evaluate(offset, normal)

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> Any:
        points = np.diff(starts)
        first, last = starts[0], starts[-1]
        centre = np.add.reduceat(offset[first:last], starts[:-1] - first) / points[:, None]
        area = np.add.reduceat(weights[first:last].sum(axis=1), starts[:-1] - first)
        self.pairs.append(np.stack([points, np.linalg.norm(centre, axis=1) / np.sqrt(area)]))
        return self.kernel.integrate(offset, weights, starts, normals)

    def gradient(self, offset: Array) -> Array:
        return self.kernel.gradient(offset)


@dataclass(frozen=True)
class _Counted(FundamentalSolution):
    """The table, counted."""

    pairs: list[Array] = field(default_factory=list, hash=False)
    own: list[int] = field(default_factory=list, hash=False)

    def bind(self, stiffness: Array) -> Kernel:
        return _CountedKernel(Tabulated().bind(stiffness), self.pairs, self.own)


def counted(case: Path) -> Record:
    """Pairs of a source and an element of a case by the points they take: pairs, points, median distance in lengths."""
    solution = _Counted()
    DenseBEM(solution).reduce(case_from_tables(tomllib.loads(case.read_text(encoding="utf-8"))).body)
    points, distance = np.concatenate(solution.pairs, axis=1)
    groups, least = {}, 0.0
    for name, most in MOST.items():
        chosen = (least < points) & (points <= most)
        middle = float(np.median(distance[chosen])) if chosen.any() else None
        groups[name] = {"pairs": int(chosen.sum()), "points": int(points[chosen].sum()), "distance": middle}
        least = most
    groups[OWN] = {"pairs": len(solution.own), "points": sum(solution.own), "distance": None}
    return groups


def effort(groups: Record) -> list[str]:
    """A paragraph and a table of the page."""
    pairs, points = (sum(group[name] for group in groups.values()) for name in ("pairs", "points"))
    rows = [
        [
            name,
            "" if group["distance"] is None else f"{group['distance']:.1f}",
            f"{100 * group['pairs'] / pairs:.1f} %",
            f"{100 * group['points'] / points:.1f} %",
        ]
        for name, group in groups.items()
    ]
    return [
        prose(
            "Effort where it matters: every pair of a source and an element has the least order of Gauss points whose"
            " error, known from the distance in lengths of the element, is below the tolerance; near elements are"
            f" divided. Counted on the mesh of the main job: {points / pairs:.1f} points a pair on the average,"
            f" {64 * pairs / points:.1f} times less than if all had 8 x 8."
        ),
        table(("points of a pair", "median distance, in lengths of the element", "pairs", "points"), rows),
        prose(
            "Symmetric work is done once: U is symmetric, so that 15 of its 25 entries are interpolated; it is the same"
            " in opposite directions, so that half of them are tabulated; T comes from the derivatives of the same"
            " interpolation, on plane elements contracted with the normal once an element; points, normals and weights"
            " of an element are made once an order for all sources. What collocation cannot share: an element seen from"
            " a node is another integral than the node's elements seen from there, and the matrix is not symmetric."
        ),
    ]
