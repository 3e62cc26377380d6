"""Test coarser meshes of a case: which keys change, and how."""

from copy import deepcopy

import pytest

from meeframe.common.errors import CaseError, PluginError
from meeframe.study.refinement import coarsen, element_size

MESH = {"divisions": 16, "rings": 8, "layers": 4, "height": "120 mm", "half_width": 0.05}


def test_counts_and_growth_factors(registry):
    tables = {"mesh": MESH | {"layer_growth": 1.2}, "formulation": {"name": "skfem", "growth": 1.3, "layers": 6}}
    before = deepcopy(tables)
    coarse = coarsen(tables, 2.0, registry)
    assert coarse["mesh"] == MESH | {"divisions": 8, "rings": 4, "layers": 2, "layer_growth": pytest.approx(1.44)}
    assert coarse["formulation"] == {"name": "skfem", "growth": pytest.approx(1.69), "layers": 3}
    assert tables == before


def test_defaults_are_coarsened(registry):
    """skfem has a growth of 1.5, a block a layer growth of 1.5, a half space none."""
    coarse = coarsen({"mesh": MESH, "formulation": "skfem"}, 2.0, registry)
    assert coarse["mesh"]["layer_growth"] == pytest.approx(2.25)
    assert coarse["formulation"] == {"name": "skfem", "growth": pytest.approx(2.25)}
    half_space = {"type": "half-space", "divisions": [16, 9], "rings": 8}
    assert coarsen({"mesh": half_space}, 2.0, registry)["mesh"] == half_space | {"divisions": [8, 4], "rings": 4}
    assert coarsen({"mesh": MESH, "formulation": "dense-bem"}, 2.0, registry)["formulation"] == {"name": "dense-bem"}
    nameless = {"quadrature_tolerance": 1e-3}
    assert coarsen({"mesh": MESH, "formulation": nameless}, 2.0, registry)["formulation"] == nameless


def test_the_same_size_is_the_same_mesh(registry):
    coarse = coarsen({"mesh": MESH}, 1.0, registry)
    assert coarse["mesh"] == MESH | {"layer_growth": 1.5}


def test_both_bodies_are_coarsened(registry):
    second_body = {"mesh": MESH | {"divisions": 12}, "formulation": {"name": "skfem"}}
    coarse = coarsen({"mesh": MESH, "second_body": second_body}, 4.0, registry)
    assert (coarse["mesh"]["divisions"], coarse["second_body"]["mesh"]["divisions"]) == (4, 3)
    assert coarse["second_body"]["formulation"]["growth"] == pytest.approx(1.5**4)


def test_at_least_one_element_remains(registry):
    assert coarsen({"mesh": MESH}, 100.0, registry)["mesh"]["layers"] == 1


def test_sizes_of_elements():
    assert element_size({"mesh": {"divisions": 8}}) == pytest.approx(1 / 8)
    assert element_size({"mesh": {"divisions": [4, 16]}}) == pytest.approx(1 / 8)


@pytest.mark.parametrize(
    ("tables", "error", "message"),
    [
        ({"mesh": {"file": "a.msh"}}, CaseError, "mesh.file: a mesh from a file cannot be coarsened"),
        (
            {"mesh": MESH, "second_body": {"mesh": {"file": "a.msh"}}},
            CaseError,
            "second_body.mesh.file: a mesh from a file",
        ),
        ({"mesh": MESH, "restart": {"from": "out"}}, CaseError, "restart: a run can only be continued on the same"),
        ({"mesh": MESH, "formulation": "skfen"}, PluginError, "unknown formulation 'skfen'"),
    ],
)
def test_mesh_from_a_file_is_rejected(registry, tables, error, message):
    with pytest.raises(error, match=message):
        coarsen(tables, 2.0, registry)
