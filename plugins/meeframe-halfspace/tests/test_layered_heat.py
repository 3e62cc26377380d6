"""Layered half spaces with heat: response in space and on grids, and contact, against integrals and closed forms."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.layered_symbol import Sampling
from meeframe_halfspace.thermal_cells import PointHeat

import meeframe
from meeframe.common.errors import CaseError
from meeframe.contact.problem import Status
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import StepConductivity
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.layers import Interface, Layer, LayerStack, RigidBase
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.testing.capabilities import check_capabilities

UM, HEAT = 1e-6, 5
EXPANSION = np.array([[1.2e-5, 0.2e-5, -0.1e-5], [0.2e-5, 2e-5, 0.3e-5], [-0.1e-5, 0.3e-5, 0.8e-5]])
CONDUCTIVITY = np.array([[3.0, 0.4, -0.2], [0.4, 2.5, 0.5], [-0.2, 0.5, 4.0]])
CERAMIC, METAL = library_material("batio3", thermal=True), library_material("cofe2o4", thermal=True)
WITHOUT_EXPANSION = library_material("cofe2o4").with_heat(3.2)
PERFECT = StepConductivity(np.inf)


def heated(name: str, factor: float, angle: float) -> Material:
    pyroelectric, pyromagnetic = [2e-5, -1e-5, -7e-5 * factor], [1e-4, 2e-4, -3e-4]
    heat = factor * CONDUCTIVITY, EXPANSION / factor, None, pyroelectric, pyromagnetic, "strain"
    return library_material(name).with_heat(*heat).rotated(rotation_about([1.0, 2.0, 3.0], angle))


UPPER, LOWER = heated("pzt-4", 1.0, 0.7), heated("batio3-cofe2o4", 2.0, 1.9)
SUBSTRATE = heated("orthotropic-mee", 0.5, 0.3)
SPRINGS = Interface(3e17, 1e17, {"electric": 0.5, "thermal": 1e6})
TRICLINIC = LayerStack((Layer(UPPER, UM, SPRINGS), Layer(LOWER, 0.5 * UM)))
ON_BASE = LayerStack(TRICLINIC.layers, RigidBase(2 * UM))
FILM = LayerStack((Layer(CERAMIC, UM, Interface(electrode="grounded")),))


def body(layers: LayerStack, substrate: Material = SUBSTRATE, count: Any = (12, 9), width: Any = 4 * UM) -> Body:
    sides = np.broadcast_to(width, 2)
    mesh = half_space_mesh(4.0 * sides.max(), tuple(sides.tolist()), count, 1, Quad4())
    return Body.of(substrate, mesh, (), "contact", layers)


def random_heat(system: Any) -> Array:
    load = np.zeros_like(system.offset)
    load[:, HEAT] = np.random.default_rng(1).normal(size=len(load))
    return load


def assert_close(computed: Array, expected: Array, tolerance: float) -> None:
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(computed - expected) <= tolerance * scale).all(), np.abs(computed - expected).max(axis=0) / scale


def point_values(grid: Any, r: Array, theta: Array) -> tuple[Array, Array]:
    """Return the response of the top material and the difference from it at points (n,), (n, 5) each, scaled."""
    series, thermal = grid.table.difference, grid.response.thermal
    top, difference = np.zeros((len(r), 10)), np.zeros((10, len(r)))
    for number in range(10):
        heat = PointHeat(*thermal.point_entry(number), grid.reference_radii[number % 5])
        top[:, number] = heat.values(r * np.cos(theta), r * np.sin(theta))
    phases = np.outer(theta, series.terms.harmonics)
    waves = np.where(series.terms.sines == 1, np.sin(phases), np.cos(phases))
    np.add.at(difference, series.terms.entries, (series.coefficients_at(r) * waves).T)
    return top[:, :5] + top[:, 5:], (difference[:5] + difference[5:]).T


@pytest.mark.full
@pytest.mark.parametrize("layers", [TRICLINIC, ON_BASE], ids=["half space", "base"])
def test_difference_in_space_is_the_double_integral_over_waves(layers: LayerStack) -> None:
    """The difference of two points, without any level; and the level on a half space, at the reference radius."""
    one, radius = body(layers), 7 * UM
    formulation = HalfSpace(matrix_up_to=0, reference_radius=None if layers.base else radius)
    grid = formulation.reduce(one).grid_response
    sampling, count = Sampling(one, np.eye(3), is_heat=True), 64
    directions = sampling.symmetry.directions(count)
    edges = np.concatenate([[0.0], np.geomspace(1e-3 / UM, 20.0 / UM, 20)])
    x, w = np.polynomial.legendre.leggauss(16)
    half = 0.5 * np.diff(edges)
    k, weights = (edges[:-1, None] + half[:, None] * (1.0 + x)).ravel(), (half[:, None] * w).ravel()
    y = sampling.difference(sampling.symbol(directions.angles), directions, k)[..., 0]
    r, theta = np.array([0.3, 1.7, 6.0]) * UM, np.array([1.1, 4.0, -0.4])
    along = np.cos(np.pi * np.arange(count) / count - theta[:, None, None])
    waves = np.exp(1j * r[:, None, None] * k[:, None] * along)
    # the other half of the waves is conjugate; k dk / k^2 is integrable, as the waves of both points agree at k = 0
    integrals = np.einsum("k,pka,kaJ->pJ", weights / k, waves - waves[0], y, optimize=True).real
    expected = integrals / (2.0 * np.pi * count)
    _, difference = point_values(grid, r, theta)
    assert_close((difference - difference[0])[1:], expected[1:], 1e-8)
    if layers.base is None:
        at_radius = sum(point_values(grid, np.full(64, radius), np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)))
        assert (np.abs(at_radius.mean(axis=0)) <= 1e-8 * np.abs(difference).max(axis=0)).all()


@pytest.mark.full
@pytest.mark.parametrize("periodic", [False, True])
def test_layers_of_the_substrate_change_nothing(periodic: bool) -> None:
    formulation = HalfSpace(matrix_up_to=0, periodic=periodic)
    layers = LayerStack((Layer(SUBSTRATE, UM), Layer(SUBSTRATE, 0.5 * UM)))
    plain, layered = (formulation.reduce(body(one)) for one in (LayerStack(), layers))
    heat = random_heat(plain)
    assert_close(layered.apply(heat), plain.apply(heat), 1e-10)
    assert formulation.undetermined_levels(body(layers)) == formulation.undetermined_levels(body(LayerStack()))


@pytest.mark.full
@pytest.mark.parametrize(("base", "periodic"), [(None, True), (RigidBase(2 * UM), False)], ids=["half space", "base"])
def test_splitting_a_layer_changes_nothing(base: RigidBase | None, periodic: bool) -> None:
    formulation = HalfSpace(matrix_up_to=0, periodic=periodic)
    first, second = TRICLINIC.layers
    divided = Layer(UPPER, 0.3 * UM), Layer(UPPER, 0.7 * UM, first.interface), second
    system, other = (formulation.reduce(body(LayerStack(layers, base))) for layers in (TRICLINIC.layers, divided))
    heat = random_heat(system)
    assert_close(other.apply(heat), system.apply(heat), 1e-9)


@pytest.mark.full
@pytest.mark.parametrize(("base", "periodic"), [(None, False), (RigidBase(2 * UM), False), (None, True)])
def test_capabilities_agree(base: RigidBase | None, periodic: bool) -> None:
    layers = LayerStack((Layer(UPPER, UM, SPRINGS),), base)
    check_capabilities(HalfSpace(matrix_up_to=0, periodic=periodic).reduce(body(layers, count=(16, 13))))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("layers", "substrate"),
    [
        (LayerStack(FILM.layers, RigidBase(2 * UM)), METAL),
        (LayerStack((Layer(UPPER, UM, SPRINGS),), RigidBase(0.5 * UM)), LOWER),
    ],
    ids=["film", "triclinic"],
)
def test_free_and_periodic_grids_agree_on_a_rigid_base(layers: LayerStack, substrate: Material) -> None:
    """The response decays exponentially, so that images have no effect, and its level is determined.

    A Gaussian that is 8 spacings wide has waves that the periodic grid leaves out, of 1e-6.
    """
    one = body(layers, substrate, (127, 127), 63.5 * UM)  # a period of 64 um
    free, periodic = (HalfSpace(matrix_up_to=0, periodic=flag).reduce(one) for flag in (False, True))
    x, y = free.points[:, :2].T
    heat = np.zeros_like(free.offset)
    heat[:, HEAT] = np.exp(-(x**2 + y**2) / (2.0 * (4.0 * UM) ** 2))
    inner = np.hypot(x, y) < 8 * UM
    assert_close(periodic.apply(heat)[inner][:, 2:], free.apply(heat)[inner][:, 2:], 1e-4)
    assert HalfSpace().undetermined_levels(one) == ()


def hot_case(
    layers: Any, base: Any, radius: float, steps: list[Any], width: float, divisions: int, **formulation: Any
) -> Any:
    """Return the case of a hot sphere on barium titanate in perfect contact."""
    return meeframe.Case(
        material=CERAMIC,
        layers=layers,
        base=base,
        mesh=meeframe.mesh.half_space(width, divisions=divisions),
        formulation=HalfSpace(**formulation),
        indenter=meeframe.Sphere(radius),
        conductivity={"electric": PERFECT, "thermal": PERFECT},
        steps=steps,
    )


def last_row(case: Any) -> Any:
    table = case.solve(progress=False).to_dataframe()
    assert (table["status"] == "converged").all()
    return table.iloc[-1]


def test_contact_on_layers_of_the_substrate_is_that_on_a_half_space() -> None:
    steps = [meeframe.Step(normal_force=5e-3), meeframe.Step(temperature=60.0)]
    layers = [meeframe.Layer(CERAMIC, UM), meeframe.Layer(CERAMIC, 0.4 * UM)]
    one, other = (
        last_row(hot_case(some, None, 10 * UM, steps, 3 * UM, 16, reference_radius=1e-4, matrix_up_to=0))
        for some in ([], layers)
    )
    for name in ("approach", "heat", "charge"):
        assert one[name] == pytest.approx(other[name], rel=1e-9)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("temperature", [0.5, -0.5])
def test_thin_film_on_a_cold_rigid_base(temperature: float) -> None:
    """Sphere in short circuit with the base: the film is a set of columns, but for the border of the contact.

    With w = beta_33 theta h / 2 c_33 the heated column grows freely: P = pi R c_33 (g + w)^2 / h, and
    Q = pi R [p_3 theta (g + w) - e_33 (g^2 - w^2) / h]. Heat also spreads around the contact, as from a radius that is
    larger by 2 h ln 2 / pi. The growth is small, because it ends at the border over a length of about h.
    """
    thickness, approach, radius = 10 * UM, 7e-9, 2.5
    c33, e33 = CERAMIC.elastic[2, 2, 2, 2], CERAMIC.piezoelectric[2, 2, 2]
    beta, p3 = CERAMIC.thermal_moduli[2, 2], -CERAMIC.thermal_moduli[2, 3]
    growth = 0.5 * beta * temperature * thickness / c33
    contact = np.sqrt(2.0 * radius * (approach + growth))
    steps = [meeframe.Step(approach=approach), meeframe.Step(temperature=temperature)]
    case = hot_case([], meeframe.Base(thickness), radius, steps, 2.5 * contact, 100, matrix_up_to=0)
    table = case.solve(progress=False).to_dataframe()
    cold, hot = table.iloc[0], table.iloc[-1]
    raised = approach + growth
    force = np.pi * radius * c33 * (raised**2 - approach**2) / thickness
    charge = np.pi * radius * (p3 * temperature * raised + e33 * growth**2 / thickness)
    border = contact + 2.0 * np.log(2.0) / np.pi * thickness
    heat = -np.pi * border**2 * 2.5 * temperature / thickness
    order = thickness / contact  # of the effect of the border
    assert hot["normal_force"] - cold["normal_force"] == pytest.approx(force, rel=order)
    assert hot["charge"] - cold["charge"] == pytest.approx(charge, rel=order)
    assert hot["heat"] == pytest.approx(heat, rel=order)


@pytest.mark.full
def test_electrode_makes_results_independent_of_the_reference_radius() -> None:
    """The charge on a film with a grounded electrode below it, in contact with an earthed tip, has no free level."""
    electrode = meeframe.Interface(electrode="grounded")
    steps = [meeframe.Step(normal_force=5e-3), meeframe.Step(temperature=60.0)]
    layers = [meeframe.Layer(CERAMIC, UM, interface=electrode)]
    cases = [
        hot_case(layers, None, 10 * UM, steps, 3 * UM, 16, reference_radius=radius, matrix_up_to=0)
        for radius in (1e-5, 1e-3, None)
    ]
    rows = [last_row(case) for case in cases]
    assert {row["status"] for row in rows} == {"converged"}
    for row in rows[1:]:
        assert row["charge"] == pytest.approx(rows[0]["charge"], rel=1e-8)
        assert row["heat"] == pytest.approx(rows[0]["heat"], rel=1e-8)
    assert rows[1]["approach"] != pytest.approx(rows[0]["approach"], rel=1e-3)
    levels = HalfSpace().undetermined_levels(body(FILM, METAL))
    assert levels == (2, 4)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("film", "substrate", "is_reported"), [(CERAMIC, WITHOUT_EXPANSION, True), (WITHOUT_EXPANSION, CERAMIC, False)]
)
def test_cold_tip_on_a_film_is_reported_by_the_expansion_of_the_film(
    film: Material, substrate: Material, is_reported: bool
) -> None:
    """The heat flux at the edge of a perfect contact is singular, and so is the sinking of a film that expands."""
    steps = [meeframe.Step(normal_force=5e-3), meeframe.Step(temperature=-60.0)]
    layers = [meeframe.Layer(film, UM)]
    case = hot_case(layers, None, 10 * UM, steps, 3 * UM, 12, reference_radius=1e-3, matrix_up_to=0)
    step = replace(case, material=substrate).solve(progress=False)[-1]
    assert step.status is Status.CONVERGED
    assert ("perfect conduction of heat to a colder indenter" in step.message) == is_reported


def test_messages() -> None:
    with pytest.raises(CaseError, match=r"reference_radius = 0\.001 m with a rigid base has no effect"):
        HalfSpace(reference_radius=1e-3).check(body(ON_BASE))
