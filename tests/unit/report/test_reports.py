"""Test summary and figures of a synthetic result with known values."""

import dataclasses
import io
import json
from itertools import cycle

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from rich.console import Console

from meeframe.contact.problem import Status
from meeframe.elements import ELEMENTS
from meeframe.model.diagnostics import with_message
from meeframe.results.canvas import NO_CONTACT
from meeframe.results.figures import figures, save_figure, write_figure
from meeframe.results.picture import Picture
from meeframe.results.records import Loading, Region, Zone
from meeframe.results.resultants import resultants
from meeframe.results.summary import summary, summary_json, summary_table
from meeframe.study.reports.compare import ComparedRun, Comparison, comparison_table

STEP_KEYS = {
    "force", "charge", "magnetic_flux", "contact_area", "max_pressure", "max_abs_electric_potential",
    "max_abs_magnetic_potential", "iterations", "residual", "status", "step", "increment", "prescribed", "approach",
    "translation", "tilt", "twist", "electric_potential", "magnetic_potential", "normal_force", "tangential_force",
    "moment", "torque", "dissipated_energy", "stick_area", "slip_area", "max_tension", "duration",
    "contact_at_zone_boundary",
}  # fmt: skip


def test_summary_numbers(synthetic):
    data = summary(synthetic.result(synthetic.step(1e-6)))
    (step,) = data["steps"]
    area = 9 * 1e-6  # the nine nodes within 1.5 mm have one square millimetre each
    assert step["contact_area"] == pytest.approx(area)
    assert step["force"] == pytest.approx([1e5 * area, 0.0, -1e6 * area])
    assert step["charge"] == pytest.approx(2.0 * area)
    assert step["magnetic_flux"] == pytest.approx(-3.0 * area)
    assert step["max_pressure"] == pytest.approx(1e6)
    assert (step["max_abs_electric_potential"], step["max_abs_magnetic_potential"]) == (5.0, 7.0)
    assert step["normal_force"] == pytest.approx(1e6 * area)
    assert step["tangential_force"] == pytest.approx([1e5 * area, 0.0])
    assert step["moment"] == pytest.approx([0.0, 0.0], abs=1e-18)
    assert step["dissipated_energy"] == pytest.approx(1e5 * 1e-8 * 8e-6), "eight nodes slip by 10 nm"
    # the four cells around the centre: their middle node sticks, and the twelve nodes around them are open
    assert (step["stick_area"], step["slip_area"]) == (pytest.approx(1e-6), pytest.approx(8e-6))
    assert (step["step"], step["increment"], step["tilt"]) == (1, 1, [1e-3, -2e-3])
    assert step["prescribed"] == {"tangential_force": pytest.approx([0.9, 0.0])}
    assert step.keys() >= STEP_KEYS
    assert data.keys() >= {"status", "timings", "peak_memory_mb", "versions", "threads", "steps"}
    assert data["status"] == "converged"


@pytest.mark.parametrize(
    ("statuses", "planned", "expected"),
    [
        ([Status.CONVERGED], 2, "unfinished"),
        ([Status.CONVERGED, Status.DIVERGED], 2, "not-converged"),
        ([Status.DIVERGED], 2, "not-converged"),
        ([], 1, "unfinished"),
    ],
)
def test_overall_status(synthetic, statuses, planned, expected):
    steps = [synthetic.step(1e-6, status) for status in statuses]
    assert summary(synthetic.result(*steps, planned=planned))["status"] == expected


def test_nonfinite_numbers_are_valid_json(synthetic):
    step = synthetic.step(1e-6, Status.DIVERGED)
    broken = dataclasses.replace(step, traction=np.full_like(step.traction, np.nan), residual=float("inf"))
    data = json.loads("".join(summary_json(synthetic.result(broken))))
    assert data["steps"][0]["force"] == [None, None, None]
    assert data["steps"][0]["residual"] is None
    assert figures(synthetic.result(broken)) == {}


def test_table_shows_every_step_and_its_message(synthetic):
    stalled = dataclasses.replace(synthetic.step(2e-6, Status.STALLED, 2), message="the residual stays at 1e-3")
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(summary_table(synthetic.result(synthetic.step(1e-6), stalled)))
    text = console.export_text()
    assert "step 2: the residual stays at 1e-3" in text
    assert "not-converged: 2 of 2 steps" in text
    assert "-9" in text


def test_table_shows_round_off_as_zero(synthetic):
    loading = Loading(1e-6, np.array([2e-6, -3e-19]), twist=1e-3)
    step = dataclasses.replace(synthetic.step(1e-6), loading=loading)
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(summary_table(synthetic.result(step)))
    text = console.export_text()
    rows = {name: next(row.split() for row in text.splitlines() if name in row) for name in ("e1", "e2")}
    assert "2e-06" in rows["e1"]
    assert "0" in rows["e2"]
    assert "e-19" not in text


@pytest.mark.parametrize(
    ("second", "lines"),
    [
        ((2, 1), ["step 1: done", "step 2: slow", "steps 1 and 2: coarse; refine"]),
        (
            (1, 2),
            [
                "step 1, increment 1: done",
                "step 1, increment 2: slow",
                "step 1, increment 1 and step 1, increment 2: coarse; refine",
            ],
        ),
    ],
)
def test_table_says_once_what_several_increments_share(synthetic, second, lines):
    first = dataclasses.replace(synthetic.step(1e-6), message="done; coarse; refine")
    step, increment = second
    other = dataclasses.replace(synthetic.step(2e-6, Status.STALLED, step, increment), message="slow; coarse; refine")
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(summary_table(synthetic.result(first, other), [(1, 1), second]))
    text = console.export_text().splitlines()
    assert [line for line in text if line.startswith("step")] == lines


def test_semicolon_in_the_warning_of_a_plugin(synthetic):
    """Warnings of plugins may contain semicolons, which must not divide them among increments."""
    text = "the film is {} nm thick; take another formulation"
    first, second = (
        with_message(
            dataclasses.replace(synthetic.step(1e-6 * number, number=number), message="done"), [text.format(nm)]
        )
        for number, nm in ((1, 5), (2, 7))
    )
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(summary_table(synthetic.result(first, second), [(1, 1), (2, 1)]))
    lines = [line for line in console.export_text().splitlines() if line.startswith("step")]
    assert lines == [
        "step 1: the film is 5 nm thick, take another formulation",
        "step 2: the film is 7 nm thick, take another formulation",
        "steps 1 and 2: done",
    ]


def test_figures_are_drawn(tmp_path, synthetic):
    drawn = figures(synthetic.result(synthetic.step(1e-6)))
    assert set(drawn) == {
        "pressure", "electric_potential", "magnetic_potential", "sections", "stick_slip",
    }  # fmt: skip
    formats = cycle([("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
    for (name, figure), (suffix, start) in zip(drawn.items(), formats, strict=False):
        save_figure(figure, tmp_path / f"{name}.{suffix}")
        assert (tmp_path / f"{name}.{suffix}").read_bytes().startswith(start)


@pytest.mark.full
def test_titles_are_drawn_literally(tmp_path, synthetic):
    """Dollar signs and characters missing in the font cause no warning."""
    shown = dataclasses.replace(synthetic.result(synthetic.step(1e-6)).provenance, title=r"$\frac{$ 接触 $x_1^ \x07")
    for name, figure in figures(dataclasses.replace(synthetic.result(synthetic.step(1e-6)), provenance=shown)).items():
        save_figure(figure, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 1000


def test_figures_have_units(synthetic):
    drawn = figures(synthetic.result(synthetic.step(1e-6)))
    axes, bar = drawn["pressure"].axes
    assert bar.get_ylabel() == "contact pressure [MPa]"
    assert axes.collections[0].get_array().max() == pytest.approx(1.0)
    section = drawn["sections"].axes[2].lines[0].get_xydata()
    assert section[np.argmin(np.abs(section[:, 0])), 1] == pytest.approx(-5.0)
    assert section[0, 0] == pytest.approx(-2.0)


def test_sections_of_the_tangential_traction(synthetic):
    """The traction is along x of the figure in any frames: here e1 is along y and e2 against x."""
    step = synthetic.step(1e-6)
    traction = np.column_stack([0.0 * step.traction[:, 0], -step.traction[:, 0], step.traction[:, 2]])
    rotated = dataclasses.replace(synthetic.result(dataclasses.replace(step, traction=traction)), zone=synthetic.zone())
    frame = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rotated.zone.frames[:] = frame
    for result in (synthetic.result(step), rotated):
        axes = figures(result)["sections"].axes[1]
        assert axes.get_ylabel() == "traction along x\n[kPa]"
        np.testing.assert_allclose(axes.lines[1].get_ydata(), [0.0, 100.0, 100.0, 100.0, 0.0], atol=1e-9)
    without = dataclasses.replace(step, traction=step.traction * [0.0, 0.0, 1.0])
    assert len(figures(synthetic.result(without))["sections"].axes) == 3


def test_figures_show_step_contact_edge_and_nodes(synthetic):
    drawn = figures(synthetic.result(synthetic.step(1e-6), synthetic.step(2e-6, number=2), planned=3))
    assert drawn["pressure"].axes[0].get_title() == "a title\nstep 2, approach 2 µm\ncontact pressure"
    edge = drawn["electric_potential"].axes[0].collections[1].get_paths()[0].vertices
    # nodes in contact lie within 1.5 mm and the next ones at 2 mm, so the line lies midway, as drawn in mm
    assert np.abs(edge).max() == pytest.approx(1.5)
    section, nodes = (line.get_xydata() for line in drawn["sections"].axes[0].lines)
    np.testing.assert_allclose(nodes, np.column_stack([[-2, -1, 0, 1, 2], [0, 2, 2, 2, 0]]), atol=1e-9)
    np.testing.assert_allclose(nodes[:, 1], np.interp(nodes[:, 0], *section.T), atol=0.02)
    alone = figures(synthetic.result(synthetic.step(1e-6)))["pressure"].axes[0]
    assert alone.get_title() == "a title\ncontact pressure"


def test_figures_of_studies_replace_earlier_ones_in_any_format(tmp_path):
    (tmp_path / "sweep.png").touch()
    write_figure(Figure(), tmp_path, "sweep", "svg")
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.svg"]
    write_figure(None, tmp_path, "sweep", "png")
    assert not any(tmp_path.iterdir())


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(("size", "unit"), [(1e-4, "nm"), (1e-2, "µm"), (1.0, "mm"), (1e3, "m")])
def test_unit_of_length_follows_the_zone(synthetic, size, unit):
    result = synthetic.result(synthetic.step(1e-6))
    zone = dataclasses.replace(result.zone, points=size * result.zone.points, weights=size**2 * result.zone.weights)
    drawn = figures(dataclasses.replace(result, zone=zone))
    half = {"nm": 200.0, "µm": 20.0, "mm": 2.0, "m": 2.0}[unit]
    for name in ("pressure", "stick_slip"):
        axes = drawn[name].axes[0]
        assert (axes.get_xlabel(), axes.get_ylabel()) == (f"x [{unit}]", f"y [{unit}]")
    assert drawn["sections"].axes[-1].get_xlabel() == f"x [{unit}]"
    assert drawn["sections"].axes[0].lines[0].get_xdata()[-1] == pytest.approx(half)
    area = resultants(zone, result.steps[-1]).slip_area
    squared, metres = {"nm": ("µm²", 1e-6), "µm": ("µm²", 1e-6), "mm": ("mm²", 1e-3), "m": ("m²", 1.0)}[unit]
    labels = [text.get_text() for text in drawn["stick_slip"].axes[0].get_legend().get_texts()]
    assert f"slip, {area / metres**2:.4g} {squared}" in labels


def test_zones_without_cells_are_drawn_by_their_nodes(synthetic):
    result = synthetic.result(synthetic.step(1e-6))
    bare = dataclasses.replace(result, zone=dataclasses.replace(result.zone, cells=()))
    assert figures(bare).keys() == figures(result).keys()
    flat = Picture.of(bare.zone).triangulation
    corners = np.stack([flat.x, flat.y], axis=1)[flat.triangles]
    edges = corners[:, 1:] - corners[:, :1]
    assert np.abs(np.linalg.det(edges)).sum() / 2 == pytest.approx(16.0)
    line = bare.zone.points * [1.0, 0.0, 0.0]
    assert not figures(dataclasses.replace(bare, zone=dataclasses.replace(bare.zone, points=line)))


@pytest.mark.parametrize("cell", ["triangle", "triangle6", "quad", "quad8", "quad9"])
def test_triangles_cover_their_cell(cell):
    element = next(element for element in ELEMENTS.values() if element.meshio_type == cell)
    n = len(element.nodes)
    points = np.column_stack([element.nodes, np.zeros(n)])
    zone = Zone(points, np.tile(np.eye(3), (n, 1, 1)), np.ones(n), ((cell, np.arange(n)[None, :]),))
    picture = Picture.of(zone)
    flat = picture.triangulation
    corners = np.stack([flat.x, flat.y], axis=1)[flat.triangles] * picture.factor
    edges = corners[:, 1:] - corners[:, :1]
    areas = (edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(4.0 if element.reference == "quadrilateral" else 0.5)


def test_table_has_a_column_for_each_step_and_names_failures(synthetic):
    failed = dataclasses.replace(synthetic.step(2e-6, Status.STALLED, 2, 1), message="stalled on the way")
    arrived = dataclasses.replace(synthetic.step(3e-6, number=2, increment=2), message="arrived")
    console = Console(width=160, record=True, file=io.StringIO())
    console.print(summary_table(synthetic.result(synthetic.step(1e-6), failed, arrived)))
    text = console.export_text()
    (columns,) = [line for line in text.splitlines() if "unit" in line]
    assert "step 1 " in columns
    assert "step 2, increment 2 " in columns
    assert "step 2, increment 1: stalled on the way" in text
    assert "not-converged: 3 of 3 increments" in text
    (energy,) = [line for line in text.splitlines() if "dissipated energy" in line]
    assert "8e-09" in energy
    assert "2.4e-08" in energy, "what did not converge does not count"


def test_table_shows_round_off_beside_other_increments_as_zero(synthetic):
    """A prescribed force of zero is left with round-off by the solver."""
    step = synthetic.step(1e-6)
    released = dataclasses.replace(synthetic.step(5e-7, number=2), traction=1e-14 * step.traction)
    console = Console(width=160, record=True, file=io.StringIO())
    console.print(summary_table(synthetic.result(step, released)))
    (force,) = [line.split() for line in console.export_text().splitlines() if "force z" in line]
    assert [float(word) for word in force if word[-1:].isdigit()] == [pytest.approx(-9.0), 0.0]


def test_summary_sums_the_energy_of_each_load_step(synthetic):
    """Eight nodes slip by 10 nm under a tenth of the pressure; unconverged increments do not count."""
    failed = synthetic.step(2e-6, Status.STALLED, 2, 1)
    steps = [synthetic.step(1e-6), failed, *(synthetic.step(3e-6, number=2, increment=i) for i in (2, 3))]
    data = summary(synthetic.result(*steps, planned=5))
    one = {"step": 1, "increments": 1, "dissipated_energy": pytest.approx(8e-9)}
    two = {"step": 2, "increments": 3, "dissipated_energy": pytest.approx(4.8e-8)}
    assert data["load_steps"] == [one, two]
    assert data["planned_increments"] == 5


def test_map_of_stick_and_slip(synthetic):
    figure = figures(synthetic.result(synthetic.step(1e-6)))["stick_slip"]
    (axes,) = figure.axes
    legend = axes.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["slip, 8 mm²", "stick, 1 mm²"]
    slip, stick = (np.concatenate([path.vertices for path in area.get_paths()]) for area in axes.collections)
    assert np.abs(slip).max() == pytest.approx(1.5), "half way from the nodes in contact to the next"
    assert np.abs(stick).max() == pytest.approx(0.5)


def test_contact_edge_is_inside_the_map_of_few_nodes(synthetic):
    """Three nodes across the contact, whose edge lies half way to the next ones."""
    (axes,) = figures(synthetic.result(synthetic.step(1e-6)))["stick_slip"].axes
    outline = np.concatenate([path.vertices for path in axes.collections[0].get_paths()])
    assert np.abs(outline).max() < 0.9 * max(axes.get_xlim())


def test_boundary_of_the_stick_region(synthetic):
    """A strip sticks across the whole contact; pressures of its nodes differ by orders of magnitude."""
    step = synthetic.step(1e-6)
    points = synthetic.zone().points
    strip = step.touching & (np.abs(points[:, 0]) < 0.5e-3)
    traction = step.traction.copy()
    traction[step.touching & (points[:, 0] > 0.5e-3), 2] *= 1e-3
    step = dataclasses.replace(step, traction=traction, region=np.where(strip, Region.STICK, step.region))
    slip, stick = figures(synthetic.result(step))["stick_slip"].axes[0].collections
    vertices = np.concatenate([path.vertices for path in stick.get_paths()])
    inner = np.abs(vertices[:, 1]) < 1.0
    assert np.abs(vertices[inner, 0]).max() == pytest.approx(0.5)
    outline, transform = stick.get_clip_path().get_transformed_path_and_affine()
    contact = stick.axes.transData.inverted().transform(transform.transform(outline.vertices))
    np.testing.assert_allclose(contact, np.concatenate([path.vertices for path in slip.get_paths()]), atol=1e-9)


def test_table_columns_for_peak_load_and_chosen_increments(synthetic):
    steps = [synthetic.step(size, increment=number) for number, size in enumerate((1e-6, 3e-6, 2e-6), 1)]

    def columns(*which):
        console = Console(width=160, record=True, file=io.StringIO())
        console.print(summary_table(synthetic.result(*steps), which))
        (line,) = [line for line in console.export_text().splitlines() if "unit" in line]
        return [cell.strip() for cell in line.split("┃")[3:-1]]

    assert columns() == ["step 1, increment 2", "step 1, increment 3"]
    assert columns("1.1", "last") == ["step 1, increment 1", "step 1, increment 3"]


def test_table_of_many_load_steps_fits_into_the_terminal(synthetic):
    steps = [synthetic.step(1e-6 * number, number=number) for number in range(1, 41)]
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(summary_table(synthetic.result(*steps), width=100))
    lines = console.export_text().splitlines()
    (header,) = [line for line in lines if "unit" in line]
    assert [cell.strip() for cell in header.split("┃")[3:-1]] == ["step 1", "step 20", "step 40"]
    assert not any("…" in line for line in lines)
    assert "3 of 40 load steps are shown; `meeframe show --step N` shows another one" in lines


def test_history_of_several_increments(synthetic):
    steps = [synthetic.step(1e-6 * number, increment=number) for number in (1, 2)]
    failed = synthetic.step(9e-6, Status.CYCLING, increment=3)
    normal, across, _, charge, _, energy = figures(synthetic.result(*steps, failed))["history"].axes
    np.testing.assert_allclose(normal.lines[0].get_xydata(), [[1.0, 9.0], [2.0, 18.0]])
    assert (normal.get_xlabel(), normal.get_ylabel()) == ("approach [µm]", "normal force [N]")
    np.testing.assert_allclose(across.lines[0].get_xydata(), [[1.0, 0.9], [2.0, 1.8]])
    np.testing.assert_allclose(charge.lines[0].get_xydata(), [[9.0, 18.0], [18.0, 18.0]])
    assert (charge.get_xlabel(), charge.get_ylabel()) == ("normal force [N]", "charge [µC]")
    assert across.get_xlabel() == "increment", "the translation is constant"
    assert energy.get_ylabel() == "dissipated energy\nsince the beginning [nJ]"
    np.testing.assert_allclose(energy.lines[0].get_ydata(), [8.0, 24.0])
    assert all(tick == int(tick) for tick in energy.get_xticks())


@pytest.mark.full
def test_history_omits_inactive_directions(synthetic):
    """Motion and force along e1 only; with motion or force along e2, that direction has a curve, too."""

    def curves(motion, force):
        steps = []
        for number in (1, 2):
            step = synthetic.step(1e-6 * number, increment=number)
            traction = step.traction + np.abs(step.traction[:, 2:]) * [0.0, force, 0.0]
            loading = dataclasses.replace(step.loading, translation=np.array([1e-7 * number, motion]))
            steps.append(dataclasses.replace(step, loading=loading, traction=traction))
        axes = figures(synthetic.result(*steps))["history"].axes[1]
        assert axes.get_xlabel() == "translation [nm]"
        return len(axes.lines)

    assert (curves(0.0, 0.0), curves(0.0, 1e-9), curves(1e-8, 0.0), curves(0.0, 0.1)) == (1, 1, 2, 2)


def test_no_figures_without_steps(synthetic):
    assert figures(synthetic.result(planned=1)) == {}


def elastic(step):
    """Return the same result without electric and magnetic fields, friction and motions other than the approach."""
    nothing = np.zeros_like(step.potentials)
    return dataclasses.replace(
        step,
        loading=Loading(step.loading.approach),
        traction=step.traction * [0.0, 0.0, 1.0],
        potentials=nothing,
        fluxes=nothing,
        slip=nothing,
        dissipation=nothing[:, 0],
        region=np.where(step.touching, Region.SLIP, Region.OPEN),
    )


def print_summary(result) -> str:
    console = Console(width=160, record=True, file=io.StringIO())
    console.print(summary_table(result))
    return console.export_text()


def test_zero_quantities_are_omitted(synthetic):
    result = synthetic.result(*(elastic(synthetic.step(1e-6 * number, increment=number)) for number in (1, 2)))
    drawn = figures(result)
    assert set(drawn) == {"pressure", "sections", "history"}, "no stick and slip without friction"
    assert [len(drawn[name].axes) for name in ("sections", "history")] == [1, 2]
    text = print_summary(result)
    assert "contact area" in text
    assert not [word for word in ("charge", "flux", "potential", "stick", "energy", "tilt", "torque") if word in text]


def test_table_has_motions_that_were_free_or_are_not_zero(synthetic):
    lines = print_summary(synthetic.result(synthetic.step(1e-6))).splitlines()
    rows = {line.split("│")[1].strip(): line for line in lines if "│" in line}
    assert "1e-07" in rows["translation e1"]
    assert {"translation e2", "tilt e1", "tilt e2", "moment e1", "moment e2", "torque"} <= set(rows)
    assert "0.01" in rows["twist"]
    assert " 3 " in rows["electric potential of the indenter"]
    free = dataclasses.replace(elastic(synthetic.step(1e-6)), loading=Loading(1e-6, prescribed={"torque": np.zeros(1)}))
    text = print_summary(synthetic.result(free))
    assert "twist" in text
    assert "torque" in text
    assert "tilt" not in text


def test_table_shows_negligible_components_as_zero(synthetic):
    step = synthetic.step(1e-6)
    traction = np.abs(step.traction[:, 2:]) * [1e-13, 1e-3, -1.0]
    lines = print_summary(synthetic.result(dataclasses.replace(step, traction=traction))).splitlines()
    rows = {line.split("│")[1].strip(): line.split("│")[-2].strip() for line in lines if "│" in line}
    assert (rows["force x"], rows["force y"], rows["force z"]) == ("0", "0.009", "-9")


def test_missing_contact_is_reported(synthetic):
    step_in_contact, step = synthetic.step(1e-6), synthetic.step(0.0)
    separated = dataclasses.replace(step, region=np.zeros_like(step.region))
    assert not separated.traction.any()
    for name in ("pressure", "stick_slip"):
        figure = figures(synthetic.result(step_in_contact, separated), "last")[name]
        (axes,) = figure.axes  # no colour bar
        assert [text.get_text() for text in axes.texts] == ["no contact"]
        assert not axes.collections


@pytest.mark.parametrize("touches", [False, True])
def test_attraction_across_the_gap_is_drawn(synthetic, touches):
    """Attraction up to 1.5 mm, around a middle with or without contact; it vanishes farther away."""
    step = synthetic.step(1e-6)
    middle = ~synthetic.zone().points.any(axis=1)
    inside = step.touching
    traction = step.traction.copy()
    traction[:, 2] = np.where(inside, 2e6, 1e3)
    region = np.where(middle & touches, Region.SLIP, Region.OPEN)
    drawn = figures(synthetic.result(dataclasses.replace(step, traction=traction, region=region)))
    axes, bar = drawn["pressure"].axes
    assert not axes.texts
    assert bar.get_ylabel() == "contact pressure [MPa]"
    np.testing.assert_allclose([axes.get_xlim(), axes.get_ylim()], 2.0 * np.array([[-1.0, 1.0]] * 2))
    words = [text.get_text() for text in drawn["stick_slip"].axes[0].texts]
    assert words == ([] if touches else ["no contact"])


def test_round_off_is_not_drawn_as_history(synthetic):
    """A constant force varies in its last digits only; a free translation is zero up to round-off."""
    steps = []
    for number in range(1, 4):
        step = synthetic.step(1e-6, increment=number)
        noise = 1.0 + 1e-12 * (-1) ** number
        loading = dataclasses.replace(step.loading, translation=np.array([1e-7 * number, noise * 1e-20]))
        steps.append(dataclasses.replace(step, traction=step.traction * noise, loading=loading))
    normal, across, *_ = figures(synthetic.result(*steps))["history"].axes
    assert np.ptp(normal.get_ylim()) > 1e-2 * 9.0
    assert np.ptp(normal.get_xlim()) > 1e-2 * 1.0
    assert not normal.yaxis.get_major_formatter().get_useOffset()
    assert len(across.lines) == 1


def test_contact_edge_matches_hertz_on_a_coarse_grid(synthetic):
    """With Hertz's pressure and gap on nodes 1 mm apart, the line follows the circle for radii between nodes."""
    place = synthetic.zone()
    r = np.linalg.norm(place.points[:, :2], axis=1)
    for radius in (1.15e-3, 1.25e-3, 1.35e-3, 1.7e-3):
        s = np.maximum(r / radius, 1.0)
        gap = 1e-6 * ((s**2 - 2.0) * np.arccos(1.0 / s) + np.sqrt(s**2 - 1.0)) / np.pi
        pressure = 1e9 * np.sqrt(np.maximum(1.0 - (r / radius) ** 2, 0.0))
        step = dataclasses.replace(
            synthetic.step(1e-6),
            traction=pressure[:, None] * [0.0, 0.0, -1.0],
            initial_gap=gap,
            displacement=np.zeros((len(r), 3)),
            region=np.where(r < radius, Region.SLIP, Region.OPEN),
        )
        axes = figures(synthetic.result(step))["pressure"].axes[0]
        shading, line = axes.collections
        edge = np.linalg.norm(line.get_paths()[0].vertices, axis=1)
        assert edge.mean() == pytest.approx(radius * 1e3, abs=0.2)
        assert np.ptp(edge) < 0.25  # half way between nodes it is 0.56, and 0.39 for the largest radius
        # the shading ends at the line, beyond which axes have another colour: no contact is not zero pressure
        outline, transform = shading.get_clip_path().get_transformed_path_and_affine()
        clipped = np.linalg.norm(axes.transData.inverted().transform(transform.transform(outline.vertices)), axis=1)
        assert (clipped.min(), clipped.max()) == pytest.approx((edge.min(), edge.max()), abs=1e-9)
        assert np.abs(np.array(to_rgba(axes.get_facecolor())) - shading.to_rgba(0.0)).max() > 0.5
        assert to_rgba(axes.get_facecolor()) == to_rgba(NO_CONTACT)


def test_repr_of_results(synthetic):
    result = synthetic.result(synthetic.step(1e-6), planned=2)
    assert repr(result) == "Result('a title': unfinished, 1 of 2 increments, 25 nodes)"
    assert repr(result.steps[0]) == (
        "StepResult(step 1, increment 1, approach 1e-06 m: converged, 9 of 25 nodes in contact)"
    )
    assert repr(result.zone) == "Zone(25 nodes)"


def test_comparison_table_and_its_notes(synthetic):
    def text(step):
        names = ("dense-bem", "half-space")
        runs = [ComparedRun({"formulation": name}, synthetic.zone(), 1, (step,)) for name in names]
        console = Console(width=160, record=True, file=io.StringIO())
        console.print(comparison_table(Comparison("a title", "", {}, tuple(runs))))
        return console.export_text()

    words = ("charge", "magnetic flux", "largest |electric potential|", "difference in traction x")
    whole, plain = text(synthetic.step(1e-6)), text(elastic(synthetic.step(1e-6)))
    assert [word in whole for word in words] == [True] * 4
    assert [word in plain for word in words] == [False] * 4
    assert "difference in contact pressure" in plain
    assert "meeframe verify CASE.toml" in plain


def test_long_titles_have_several_lines(synthetic):
    result = synthetic.result(synthetic.step(1e-6))
    titled = dataclasses.replace(result, provenance=dataclasses.replace(result.provenance, title="words " * 30))
    *lines, what = figures(titled)["pressure"].axes[0].get_title().split("\n")
    assert " ".join(lines) == ("words " * 30).strip()
    assert max(map(len, lines)) < 60
    assert min(map(len, lines)) > 0.7 * max(map(len, lines)), "no line holds a single word"
    assert what == "contact pressure"
