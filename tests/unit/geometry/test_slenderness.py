"""Which bodies stick out from their supports too far, by closed forms of their widths."""

from pathlib import Path

import numpy as np
import pytest

from meeframe.case.load import load_case
from meeframe.core.body import Body, BoundaryCondition
from meeframe.core.element import SurfaceElement
from meeframe.core.mesh import ElementBlock, SurfaceMesh
from meeframe.elements import Quad4, Quad9
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.geometry import box_mesh, half_space_mesh
from meeframe.geometry.slenderness import slender_parts

ROOT = Path(__file__).parents[3]


def held(mesh: SurfaceMesh, *groups: str) -> Body:
    """A body clamped at groups of faces; its material is of no matter here."""
    clamps = tuple(BoundaryCondition(group, field, "value") for group in groups for field in range(5))
    return Body(np.zeros((3, 5, 5, 3)), mesh, clamps, None)


QUADRATIC = Quad9()


def rod(length: float, element: SurfaceElement = QUADRATIC) -> SurfaceMesh:
    """Two metres wide, of so many widths."""
    return box_mesh((2.0, 2.0, 2.0 * length), (1, 1, 4), element)


@pytest.mark.parametrize(("length", "element"), [(40.0, Quad9()), (40.0, Quad4()), (13.0, Quad9())])
def test_a_clamped_rod_is_slender(length, element):
    """Four times volume over surface is 4 L / (4 L + 2) widths."""
    mesh = rod(length, element)
    (found,) = slender_parts(held(mesh, "z-"))
    assert found.length == pytest.approx(2.0 * length)
    assert found.width == pytest.approx(2.0 * 4.0 * length / (4.0 * length + 2.0))
    assert found.at[2] == mesh.points[:, 2].max()


@pytest.mark.parametrize(
    ("body", "slender"),
    [
        (held(rod(10.0), "z-"), False),
        (held(rod(10.0, Quad4()), "z-"), True),
        (held(rod(5.0, Quad4()), "z-"), False),
        (held(rod(20.0), "z-", "z+"), False),
        (held(rod(40.0), "z-", "z+"), True),
        (held(rod(1000.0), "x-"), False),
        (held(rod(40.0)), False),
        (held(box_mesh((100.0, 100.0, 1.0), (4, 4, 1), Quad9()), "z-"), False),
        (held(box_mesh((100.0, 100.0, 1.0), (4, 4, 1), Quad9()), "x-"), True),
        (held(half_space_mesh(1.0, 0.1, 2, 2, Quad4()), "contact"), False),
    ],
)
def test_supports_decide(body, slender):
    assert bool(slender_parts(body)) == slender


def test_separate_parts_are_judged_each_by_itself():
    """A thick block beside a slender rod, both held below."""
    block, thin = box_mesh((9.0, 9.0, 9.0), (2, 2, 2), Quad9()), rod(20.0)
    points = np.concatenate([block.points, thin.points + np.array([100.0, 0.0, 0.0])])
    second = thin.blocks[0]
    moved = ElementBlock(second.element, second.connectivity + len(block.points), second.groups)
    mesh = SurfaceMesh(points, (*block.blocks, moved), block.group_names)
    (found,) = slender_parts(held(mesh, "z-"))
    assert found.length == pytest.approx(40.0)
    assert found.at[0] > 50.0


def test_formulations_say_so():
    (warning,) = DenseBEM().warnings(held(rod(40.0), "z-"))
    assert "reaches 80 m from its supports" in warning
    assert "formulation skfem" in warning
    assert DenseBEM().warnings(held(rod(5.0), "z-")) == ()


@pytest.mark.parametrize("file", sorted((ROOT / "validation").glob("*/*.toml")), ids=lambda file: file.stem)
def test_no_shipped_case_warns(file):
    text = file.read_text(encoding="utf-8")
    if "[mesh" not in text:
        pytest.skip("a study, not a case")
    assert load_case(file).warnings == ()
