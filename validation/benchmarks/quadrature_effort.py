"""Count the quadrature points of dense boundary elements, at the calls of the fundamental solution."""

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
"""Largest number of points per pair, by group."""
OWN = "the element holds the source"
"""Key of the stored record."""


@dataclass(frozen=True, eq=False)
class _CountedKernel(Kernel):
    """Kernel that counts its quadrature points.

    pairs: number of points and distance in element lengths, for each pair of a source and an element; own: numbers of
    points for elements that contain the source.
    """

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
    """Tabulated fundamental solution that counts its quadrature points."""

    pairs: list[Array] = field(default_factory=list, hash=False)
    own: list[int] = field(default_factory=list, hash=False)

    def bind(self, stiffness: Array) -> Kernel:
        return _CountedKernel(Tabulated().bind(stiffness), self.pairs, self.own)


def counted(case: Path) -> Record:
    """Group the pairs of source and element by number of points: pairs, points, median distance in element lengths."""
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
    """Return two paragraphs and a table."""
    pairs, points = (sum(group[name] for group in groups.values()) for name in ("pairs", "points"))
    rows = [
        [
            "the element contains the source" if name == OWN else name.replace("divided", "subdivided"),
            "" if group["distance"] is None else f"{group['distance']:.1f}",
            f"{100 * group['pairs'] / pairs:.1f} %",
            f"{100 * group['points'] / points:.1f} %",
        ]
        for name, group in groups.items()
    ]
    return [
        prose(
            "Quadrature is adaptive: each pair of source and element uses the lowest order of Gauss points whose error,"
            " estimated from the distance in element lengths, is below the tolerance; near elements are subdivided. On"
            f" the mesh of the main job this takes {points / pairs:.1f} points per pair on average,"
            f" {64 * pairs / points:.1f} times less than 8 x 8 points for each."
        ),
        table(("points per pair", "median distance, in element lengths", "pairs", "points"), rows),
        prose(
            "The assembly exploits symmetries. U is symmetric, so only 15 of its 25 entries are interpolated; it is"
            " equal in opposite directions, so only half of the directions are tabulated. T comes from the derivatives"
            " of the same interpolation; on plane elements they are contracted with the normal once per element."
            " Points, normals and weights of an element are computed once per order for all sources. The matrices of"
            " collocation are not symmetric, so the integrals of two nodes over each other's elements cannot be shared."
        ),
    ]
