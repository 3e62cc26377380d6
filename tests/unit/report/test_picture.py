"""Figures do not depend on the frames of the nodes; sections interpolate within the zone."""

from dataclasses import replace

import numpy as np

from meeframe.mesh.regular import grid_cells, shared_frames
from meeframe.results.picture import Picture
from meeframe.results.records import Zone


def test_figures_do_not_depend_on_friction_axes(synthetic) -> None:
    zone = synthetic.zone()
    radius = np.linalg.norm(zone.points, axis=1, keepdims=True)
    away = np.where(radius > 0.0, zone.points / np.where(radius > 0.0, radius, 1.0), [1.0, 0.0, 0.0])
    frames = zone.frames.copy()
    frames[:, 0], frames[:, 1] = away, np.cross(zone.frames[:, 2], away)
    np.testing.assert_allclose(Picture.of(zone).points, zone.points[:, :2] * 1e3)
    np.testing.assert_allclose(Picture.of(replace(zone, frames=frames)).points, zone.points[:, :2] * 1e3)


def test_section_is_the_interpolant_within_the_zone(synthetic) -> None:
    """Values are linear in each element, and masked in the gap between two halves of the zone."""
    zone = synthetic.zone()
    picture = Picture.of(zone)
    x = np.linspace(-1.9, 1.9, 39)
    linear, bent = picture.section(x, 3.0 + picture.points @ [2.0, 5.0], np.abs(picture.points[:, 0]))
    np.testing.assert_allclose(linear, 3.0 + 2.0 * x, atol=1e-12)
    np.testing.assert_allclose(bent, np.abs(x), atol=1e-12)
    name, cells = zone.cells[0]
    split = cells[np.abs(zone.points[cells, 0].mean(axis=1)) > 1e-3]
    np.testing.assert_array_equal(
        np.ma.getmaskarray(Picture.of(replace(zone, cells=((name, split),))).section(x, picture.points[:, 0])[0]),
        np.abs(x) < 1.0 - 1e-9,
    )


def test_section_outside_all_elements_is_masked(synthetic) -> None:
    zone = synthetic.zone()
    name, cells = zone.cells[0]
    outer = cells[np.abs(zone.points[cells, 1].mean(axis=1)) > 1e-3]
    picture = Picture.of(replace(zone, cells=((name, outer),)))
    assert np.ma.getmaskarray(picture.section(np.zeros(1), picture.points[:, 0])[0]).all()


def test_triangulation_of_elements_of_each_kind(synthetic) -> None:
    """Sixteen squares are divided into four triangles each; a node in the middle of a square has four triangles."""
    zone = synthetic.zone()
    picture = Picture.of(zone)
    middle = np.linalg.norm(zone.points, axis=1) < 1e-9
    assert len(picture.triangles_at(middle).triangles) == 4 * 4
    assert len(picture.triangles_at(middle, ~middle).triangles) == 4 * 4
    corner = np.abs(zone.points[:, :2]).min(axis=1) > 1.5e-3
    assert len(picture.triangles_at(corner).triangles) == 4 * 4
    assert len(picture.triangles_at(middle, corner).triangles) == len(picture.triangulation.triangles) == 4 * 16


def test_a_grid_finer_than_a_figure_is_an_image_of_its_nodes(synthetic) -> None:
    """A section of the image's values is that of the triangles, and each pixel is a node; nodes outside have none."""
    from matplotlib.figure import Figure

    x, y = np.linspace(-1e-3, 1e-3, 501), np.linspace(-2e-3, 2e-3, 402)
    points = np.stack([*(grid.ravel() for grid in np.meshgrid(x, y, indexing="ij")), np.zeros(501 * 402)], axis=1)
    frames = shared_frames(np.eye(3), len(points))
    zone = Zone(points, frames, np.ones(len(points)), (("quad", grid_cells(np.arange(len(points)).reshape(501, 402))),))
    picture = Picture.of(zone)
    values = 3.0 + picture.points @ [2.0, 5.0]
    along = np.linspace(-0.9, 0.9, 7)
    (section,) = picture.section(along, values)
    np.testing.assert_allclose(section, 3.0 + 2.0 * along, atol=1e-12)
    inside = points[:, 0] > 0.0
    image = picture.shade(Figure().subplots(), values, inside).get_array()
    np.testing.assert_array_equal(np.ma.getmaskarray(image).T.ravel(), ~inside)
    np.testing.assert_array_equal(image.T.ravel()[inside], values[inside])
    axes = Figure().subplots()
    filled = picture.fill(axes, np.where(inside, 1.0, -3.0), "red").get_array()
    np.testing.assert_array_equal(np.ma.getmaskarray(filled).T.ravel(), ~inside)
    picture.outline(axes, np.where(inside, 1.0, -3.0), "white")
    (line,) = axes.collections[0].get_paths()
    step = (x[1] - x[0]) * 1e3
    np.testing.assert_allclose(line.vertices[:, 0], 0.75 * step, atol=1e-9)
