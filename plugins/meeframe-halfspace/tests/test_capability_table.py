"""Systems that are made of others have the capabilities that the table on docs/howto/fast-formulation.md states."""

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

import meeframe.plugin
from meeframe.elements import Quad4
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.system import capabilities
from meeframe.system.capabilities import ApproximateInverse, MaterialFlow
from meeframe.system.edge_correction import correct_edge
from meeframe.system.reduced import ReducedSystem
from meeframe.system.rolling import CellShift, SteadyRollingSystem
from meeframe.system.rotated import rotate_frames
from meeframe.system.two_body import combine_bodies
from meeframe.testing.capabilities import check_capabilities

PAGE = (Path(__file__).parents[3] / "docs" / "howto" / "fast-formulation.md").read_text("utf-8")
COMPOSED = PAGE.partition("## Composed systems")[2].partition("\n## ")[0]
HEADER, _, *ROWS = (re.split(r" *\| *", line.strip("| ")) for line in COMPOSED.splitlines() if line.startswith("|"))
KINDS = [row[0].strip("`") for row in ROWS if not row[0].startswith("its ")]


@cache
def half_space(cells: tuple[int, int], is_periodic: bool = False) -> ReducedSystem:
    """Return a half space with all capabilities that formulations have."""
    mesh = half_space_mesh(4e-2, 6e-3, cells, 1, Quad4())
    body = Body(library_material("orthotropic-mee").stiffness, mesh, (), "contact")
    edges: Any = "nodes" if is_periodic else "resolved"
    return HalfSpace(matrix_up_to=0, periodic=is_periodic, edges=edges).reduce(body)


def rotated(system: ReducedSystem) -> ReducedSystem:
    return rotate_frames(system, np.tile([1.0, 1.0, 0.0], (len(system.points), 1)))


def edge_corrected(system: ReducedSystem) -> ReducedSystem:
    near = (np.hypot(*system.points[:, :2].T) > 2e-3)[:, None, None]
    return correct_edge(system, near * 0.1 * np.eye(5) * system.diagonal_blocks())


def rolling(system: ReducedSystem, is_periodic: bool = False) -> ReducedSystem:
    shift = CellShift.of(system.points, system.frames, np.array([1.0, 0.0, 0.0]), is_periodic)
    return SteadyRollingSystem.of(system, shift)


SYSTEMS: dict[str, Callable[[ReducedSystem], ReducedSystem]] = {
    "other frames": rotated,
    "two bodies": lambda system: combine_bodies(system, system),
    "two bodies with different divisions": lambda system: combine_bodies(system, half_space((25, 25))),
    "edge correction": edge_corrected,
    "steady rolling": rolling,
}


def test_table_lists_all_systems_and_capabilities() -> None:
    assert ["capability", *SYSTEMS] == HEADER
    defined = {name: value for name, value in vars(capabilities).items() if isinstance(value, type)}
    abstract = {name for name, value in defined.items() if getattr(value, "__abstractmethods__", ())}
    assert set(KINDS) == {name for name in abstract if defined[name].__module__ == capabilities.__name__} | {
        "ZoneRecovery"
    }
    assert all(getattr(meeframe.plugin, name) is getattr(capabilities, name) for name in KINDS)


SLOW = "two bodies with different divisions"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.full) if name == SLOW else name for name in SYSTEMS]
)
def test_capabilities_are_those_of_the_table(name: str) -> None:
    """Each capability of a half space is there, or absent."""
    plain = half_space((47, 48))
    formulations_have = {kind for kind in KINDS if plain.capability(getattr(capabilities, kind)) is not None}
    assert formulations_have >= {*KINDS} - {"MaterialFlow", "Persistence"}
    system = SYSTEMS[name](plain)
    stated = {row[0].strip("`"): not row[HEADER.index(name)].startswith("no") for row in ROWS}
    actual = {kind: system.capability(getattr(capabilities, kind)) is not None for kind in KINDS}
    assert actual == {kind: stated[kind] for kind in KINDS}
    approximate, resistances = system.capability(ApproximateInverse), np.arange(5.0).clip(2.0)
    assert approximate is not None
    assert (approximate.series_inverse(range(5), resistances) is not None) == stated["its `series_inverse"]
    assert (approximate.prolongation(np.arange(40)) is not None) == stated["its `prolongation"]


@pytest.mark.parametrize("is_periodic", [False, True])
def test_capabilities_of_steady_rolling_conform(is_periodic: bool) -> None:
    """Coarser systems too: they agree except at the border where the material enters."""
    system = rolling(half_space((47, 47), is_periodic), is_periodic)
    assert system.capability(MaterialFlow) is system
    check_capabilities(system)
