"""Integrals over plane facets of far leaves, interpolated from few kernel values, agree with those element by
element."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_hmatrix import HierarchicalBEM, formulation
from meeframe_hmatrix.assembly import assemble
from meeframe_hmatrix.clusters import distance
from meeframe_hmatrix.facets import facets, interpolate
from meeframe_hmatrix.kernels import enter
from meeframe_hmatrix.rows import column_window, local, near_rows, no_sums, orders_from, output

from meeframe.elements import Quad8, Tri3
from meeframe.material import rotation_about
from meeframe.mesh.body import Body


def integrals_of(body: Body, monkeypatch: pytest.MonkeyPatch):
    calls = []
    monkeypatch.setattr(formulation, "assemble", lambda *arguments: calls.append(arguments) or assemble(*arguments))
    HierarchicalBEM(tolerance=1e-3, leaf_size=20).boundary(body)
    return calls[0][0]


def relative(computed, expected) -> float:
    return float(np.linalg.norm(computed - expected) / np.linalg.norm(expected)) if expected.any() else 0.0


def rotate(body: Body) -> Body:
    """Rotate points about an axis such that no plane is parallel to two coordinate axes."""
    rotation = rotation_about((1.0, -2.0, 0.7), 0.6)
    return replace(body, mesh=replace(body.mesh, points=body.mesh.points @ rotation.T))


@pytest.mark.full
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
@pytest.mark.parametrize("make", [lambda make: make(8), lambda make: rotate(make(8, Tri3()))], ids=["quad4", "tri3"])
def test_integrals_match_element_by_element(make_block, monkeypatch, make, tolerance):
    integrals = integrals_of(make(make_block), monkeypatch)
    accuracy = integrals.accuracy._replace(tolerance=tolerance)
    fine = replace(integrals, accuracy=accuracy._replace(tolerance=1e-8))
    facets_of_leaves, leaves, points, direct, largest_error = (
        facets(integrals),
        list(integrals.tree.root.leaves()),
        0,
        0,
        0.0,
    )
    row_cluster = next(leaf for leaf in leaves if leaf.sources.stop - leaf.sources.start > 5)
    positions = integrals.positions[row_cluster.sources][:1]
    far = [leaf for leaf in leaves if distance(row_cluster.row_box, leaf.column_box) > 0]
    for leaf in far:
        window = column_window(integrals, [leaf])
        box = np.stack([positions[0], positions[0]])
        interpolated, others = interpolate(integrals, [leaf], facets_of_leaves, positions, box, accuracy, window)
        assert (interpolated is None) == (others == [leaf])
        if interpolated is None:
            continue
        sums, rows = no_sums(integrals, window), local(integrals.rows[row_cluster.sources.start], row_cluster)
        interpolated.add(integrals.kernel, positions[0], sums)
        out = output(integrals, row_cluster.unknowns.stop - row_cluster.unknowns.start, [leaf])
        enter(integrals.fields, sums, rows, integrals.columns, window, out)
        one = replace(row_cluster, sources=slice(row_cluster.sources.start, row_cluster.sources.start + 1))
        expected = near_rows(fine, one, [leaf])
        for block, exact in zip((out.unknown, out.load), (expected.unknown, expected.load), strict=True):
            largest_error = max(largest_error, relative(block, exact))
        points += len(interpolated.points)
        rules = [orders_from(box, facet.kind, facet.numbers, accuracy) for facet in facets_of_leaves[leaf]]
        direct += sum(int(orders.prod(axis=1).sum()) for orders in rules)
    assert 0 < points < 0.7 * direct
    assert largest_error < tolerance


@pytest.mark.full
def test_facets_are_planes_of_a_leaf(make_block, monkeypatch):
    integrals = integrals_of(make_block(8), monkeypatch)
    for leaf, leaf_facets in facets(integrals).items():
        assert {site for facet in leaf_facets for site in facet.sites} == set(range(leaf.sites.start, leaf.sites.stop))
        for facet in leaf_facets:
            nodes = facet.kind.elements.nodes[facet.numbers] - facet.centre
            assert np.abs(nodes @ facet.normal).max() < 1e-12
            assert (np.abs(nodes @ facet.axes.T).max(axis=(0, 1)) <= facet.half_sides * (1 + 1e-12)).all()


@pytest.mark.full
@pytest.mark.parametrize("element", [Quad8(), Tri3()], ids=["quad8", "tri3"])
def test_curved_surfaces_have_no_facets(make_block, monkeypatch, element):
    body = make_block(6, element)
    size = np.ptp(body.mesh.points, axis=0)
    bulge = 0.1 * size * np.cos(body.mesh.points / size).sum(axis=1, keepdims=True)
    integrals = integrals_of(replace(body, mesh=replace(body.mesh, points=body.mesh.points + bulge)), monkeypatch)
    assert not any(facets(integrals).values())
