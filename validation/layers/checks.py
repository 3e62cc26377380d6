"""Check layers: waves, thin and thick films, graded media, coated half spaces, finite elements."""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from meeframe_halfspace import HalfSpace
from meeframe_skfem import FiniteElements
from study import DIVISIONS, QUANTITIES, STACKS, compare, of_numbers

import meeframe
from meeframe.fields import ELECTRIC, MAGNETIC, Array
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.material.layers import Layer, LayerStack, RigidBase
from meeframe.material.surface_symbol import SurfaceSymbol
from meeframe.results.resultants import Resultants
from meeframe.study.reports.extrapolation import of_order
from meeframe.study.validate import Check, Curve, Item, Plot, Skip
from meeframe.testing.axisymmetric_layers import AxisymmetricLayers
from meeframe.testing.closed_forms import Sphere, indent
from meeframe.testing.closed_forms_layers import (
    SphereOnPowerLaw,
    column_force,
    incompressible_layer_force,
    isotropic_layer_compliance,
)

TITLE = "Layers: films, coatings, graded media"
SOURCE = (
    "Burmister, J. Appl. Phys. 16 (1945) 89; Johnson, Contact Mechanics (1985), section 5.8; Jaffar, Int. J. Mech. "
    "Sci. 31 (1989) 229; Giannakopoulos and Suresh, Int. J. Solids Struct. 34 (1997) 2393; Fredholm equations of "
    "meeframe.testing.axisymmetric_layers; finite elements of docs/validation/layers.json, which "
    "validation/layers/regenerate.py computes."
)
NUMBERS = Path(__file__).parents[2] / "docs" / "validation" / "layers.json"
THICKNESS, RADIUS, RATIOS = 1e-6, 1e-2, (10.0, 20.0)
"""Thickness of films and radius of the sphere [m]; contact radii over thicknesses, or the other way round."""
SHEAR, POISSON = 8e10, 0.3
SUBSTRATES = {"rigid base": None, "softer half space": (8e8, 0.1), "stiffer half space": (4e12, 0.45)}
"""Shear modulus [Pa] and Poisson's ratio below an isotropic film."""
WAVE_NUMBERS = np.geomspace(1e-4, 40.0, 25)
"""Wave numbers times the thickness."""
PERFECT = meeframe.StepConductivity(np.inf)
CONDUCTING = {"electric": PERFECT, "magnetic": PERFECT}
FILM_VALUES = ("force, insulating", "potential, insulating", "force, grounded", "charge, grounded")
UNITS = ("m", "m", "V", "A")
PZT = library_material("pzt-4")


def run(quick: bool) -> Iterator[Item]:
    """Check all; if `quick`, a graded medium on a coarser grid, and one of three stacks."""
    yield from waves()
    yield from one_material()
    yield from thin_elastic_layers()
    yield from piezoelectric_films()
    yield from coated()
    yield from graded(24 if quick else 48)
    yield from sliding(quick)
    yield from stacks(quick)


def isotropic(shear: float, nu: float) -> Material:
    """Return an isotropic material of a shear modulus [Pa] and Poisson's ratio."""
    return Material.isotropic(2.0 * shear * (1.0 + nu), nu)


def waves() -> Iterator[Check]:
    """Check the compliance of an isotropic film for waves, in all mechanical entries, against closed forms."""
    film = isotropic(SHEAR, POISSON)
    for name, substrate in SUBSTRATES.items():
        layers = LayerStack((Layer(film, THICKNESS),)) if substrate else LayerStack((), RigidBase(THICKNESS))
        below = isotropic(*substrate) if substrate else film
        symbol = SurfaceSymbol.of(below.stiffness, layers, np.eye(3), np.zeros(1))
        computed = symbol.evaluate(WAVE_NUMBERS / THICKNESS)[:, 0] * np.outer(symbol.factors, symbol.factors)
        exact = isotropic_layer_compliance(WAVE_NUMBERS, (SHEAR, POISSON), substrate)
        scale = np.abs(list(exact.values())).max(axis=0)
        errors = [np.abs(computed[:, row, column] - values) / scale for (row, column), values in exact.items()]
        words = f"waves, isotropic film on a {name}: compliance, largest difference relative to the largest entry"
        yield Check(words, float(np.max(errors)), 0.0, 1e-12, "", True)


def solved(**keys: Any) -> meeframe.Result:
    """Return the result of a case under a sphere. Raises RuntimeError if it does not converge."""
    parts = {"formulation": HalfSpace(matrix_up_to=0), "indenter": meeframe.Sphere(RADIUS)}
    result = meeframe.Case(**parts | keys).solve(progress=False)
    if result.status != "converged":
        raise RuntimeError(result[-1].message)
    return result


def one_material() -> Iterator[Check]:
    """Check layers of the substrate's material against the homogeneous half space."""
    material = library_material("batio3-cofe2o4").rotated(rotation_about([1, 2, 3], np.radians(40.0)))
    stack = LayerStack((Layer(material, THICKNESS), Layer(material, 0.4 * THICKNESS)))
    symbol = SurfaceSymbol.of(material.stiffness, stack, np.eye(3), np.array([0.0, 0.4, 1.9]))
    difference = np.abs(symbol.difference(WAVE_NUMBERS / THICKNESS)).max() / np.abs(symbol.top).max()
    yield Check(
        "waves, triclinic layers of one material: difference from the half space",
        float(difference),
        0.0,
        1e-12,
        "",
        True,
    )
    keys = {
        "material": material,
        "mesh": meeframe.mesh.half_space(1.6e-6, 16),
        "indenter": meeframe.Sphere(1e-5),
        "contact": meeframe.IsotropicCoulomb(0.3),
        "conductivity": CONDUCTING,
        "steps": [meeframe.Step(approach=40e-9), meeframe.Step(translation=[8e-9, 0.0], electric_potential=1.0)],
    }
    one, other = (solved(layers=layers, **keys)[-1] for layers in ([], [meeframe.Layer(material, 3e-7)] * 2))
    for name, first, second in (("tractions", one.traction, other.traction), ("fluxes", one.fluxes, other.fluxes)):
        error = float((np.abs(second - first).max(axis=0) / np.abs(first).max(axis=0)).max())
        words = f"friction and conduction on triclinic layers of one material: {name}, largest difference"
        yield Check(words, error, 0.0, 1e-9, "", True)


def pressed(
    material: Any, approach: float, width: float, cells: int, conducting: bool = False, **keys: Any
) -> tuple[meeframe.Result, Resultants]:
    """Return the result and the totals for cells across a width that is close to that of the contact [m]."""
    divisions = 2 * round(0.6 * cells)
    result = solved(
        material=material,
        mesh=meeframe.mesh.half_space(width / cells * divisions, divisions),
        steps=[meeframe.Step(approach=approach)],
        conductivity=CONDUCTING if conducting else {},
        **keys,
    )
    return result, meeframe.resultants(result.zone, result[-1])


def at_centre(result: meeframe.Result) -> float:
    """Return the electric potential at the centre of the contact [V]."""
    return float(result[-1].potentials[np.hypot(*result.zone.points[:, :2].T).argmin(), 0])


def limit(values: Array, order: float) -> float:
    """Return the limit of values at RATIOS from the order of their difference from it."""
    return of_order([1.0 / ratio for ratio in RATIOS], values.tolist(), order)


def thin_elastic_layers() -> Iterator[Check]:
    """Check forces on layers bonded to a rigid base in the limit of wide contacts."""
    nu, modulus = 0.5 - 1e-7, 2.0 * SHEAR * (1.0 - POISSON) / (1.0 - 2.0 * POISSON)
    for name, poisson, factor, exact in (
        ("compressible", POISSON, 2.0, partial(column_force, modulus)),
        ("incompressible", nu, 4.0, partial(incompressible_layer_force, SHEAR)),
    ):
        forces = []
        for ratio in RATIOS:
            approach, width = (ratio * THICKNESS) ** 2 / (factor * RADIUS), 2.0 * ratio * THICKNESS
            _, totals = pressed(isotropic(SHEAR, poisson), approach, width, 96, base=meeframe.Base(THICKNESS))
            forces.append(totals.normal_force / exact(THICKNESS, RADIUS, approach))
        words = f"thin {name} layer on a rigid base: force over its limit, a/h = 10 and 20 extrapolated"
        yield Check(words, limit(np.array(forces), 2.0), 1.0, 5e-3)


def film_values(approach: float, free_width: float, grounded_width: float) -> Array:
    """Return the values FILM_VALUES of a sphere on a PZT-4 film on a grounded base, (4,); widths of the contacts."""
    free, totals = pressed("pzt-4", approach, free_width, 48, base=meeframe.Base(THICKNESS))
    _, grounded = pressed("pzt-4", approach, grounded_width, 48, True, base=meeframe.Base(THICKNESS))
    return np.array([totals.normal_force, at_centre(free), grounded.normal_force, grounded.charge])


def thin_film(ratio: float) -> Array:
    """Return the values of a film of independent columns for a contact radius over thickness, and their limits."""
    c, e, eps = PZT.elastic[2, 2, 2, 2], PZT.piezoelectric[2, 2, 2], PZT.permittivity[2, 2]
    width, approach = 2.0 * ratio * THICKNESS, (ratio * THICKNESS) ** 2 / (2.0 * RADIUS)
    unit = column_force(1.0, THICKNESS, RADIUS, approach)
    limits = np.array([unit * (c + e**2 / eps), -e / eps * approach, unit * c, -unit * e])
    return np.asarray(film_values(approach, width, width) / limits)


def thick_film(ratio: float) -> Array:
    """Return the values for a thickness over contact radius, relative to those of a half space."""
    approach, xi = (THICKNESS / ratio) ** 2 / RADIUS, axisymmetric_compliance(PZT.stiffness)
    free, grounded = (indent(xi, Sphere(RADIUS), approach, *given) for given in ((None, None), (0.0, 0.0)))
    potential = float(free.electric_potential(np.zeros(1))[0])
    exact = np.array([free.force, potential, grounded.force, grounded.charge])
    widths = 2.0 * free.contact_radius, 2.0 * grounded.contact_radius
    return np.asarray(film_values(approach, *widths) / exact)


def piezoelectric_films() -> Iterator[Check]:
    """Check a piezoelectric film on a grounded base in the thin and in the thick limit."""
    for name, film, ratio, order in (("thin", thin_film, "a/h", 2.0), ("thick", thick_film, "h/a", 1.0)):
        values = np.stack([film(one) for one in RATIOS])
        for value, column in zip(FILM_VALUES, values.T, strict=True):
            words = f"{name} PZT-4 film on a grounded base, {value} over its limit, {ratio} = 10 and 20 extrapolated"
            yield Check(words, limit(column, order), 1.0, 5e-3)


def coated() -> Iterator[Check]:
    """Check a sphere on BaTiO3 on CoFe2O4 against integral equations."""
    film, substrate, radius, approach = library_material("batio3"), library_material("cofe2o4"), 1e-5, 40e-9
    stack = LayerStack((Layer(film, THICKNESS),))
    for name, potentials in (("insulating", {}), ("grounded", {ELECTRIC: 0.0, MAGNETIC: 0.0})):
        exact = AxisymmetricLayers(substrate.stiffness, stack, potentials).press_sphere_by(radius, approach)
        result, totals = pressed(
            substrate,
            approach,
            2.0 * exact.radius,
            48,
            bool(potentials),
            layers=[meeframe.Layer(film, THICKNESS)],
            indenter=meeframe.Sphere(radius),
            formulation=HalfSpace(matrix_up_to=0, edges="resolved" if potentials else "nodes"),
        )
        words = f"sphere on BaTiO3 on CoFe2O4, a/h = 0.63, {name}"
        yield Check(f"{words}: force", totals.normal_force, exact.force, 1e-3, "N")
        if potentials:
            yield Check(f"{words}: charge", totals.charge, exact.fluxes[ELECTRIC], 5e-3, "C")
        else:
            yield Check(f"{words}: potential at the centre", at_centre(result), float(exact.centre[1]), 1e-3, "V")


def graded(cells: int) -> Iterator[Item]:
    """Check a sphere on a half space whose Young's modulus grows with the depth to the power 0.4."""
    k, radius, approaches = 0.4, 1e-5, (10e-9, 20e-9)
    glass = {"name": "isotropic", "young_modulus": 7e10, "poisson_ratio": 0.3}
    grading = {"law": "power", "exponent": k, "tolerance": 3e-3}
    result = solved(
        material=glass,
        layers=[meeframe.Layer(glass, 2e-5, grading=grading)],
        mesh=meeframe.mesh.half_space(1.2e-6, cells),
        indenter=meeframe.Sphere(radius),
        steps=[meeframe.Step(approach=approach) for approach in approaches],
    )
    totals = [meeframe.resultants(result.zone, step) for step in result]
    first, second = (SphereOnPowerLaw(k, radius, approach) for approach in approaches)
    words = "sphere on a half space with E ~ z^0.4"
    growth = np.log(totals[1].normal_force / totals[0].normal_force)
    exponent = float(growth / np.log(second.contact_radius / first.contact_radius))
    yield Check(f"{words}: exponent of the force over the contact radius", exponent, 3.0 + k, 0.02, "", True)
    area = np.pi * second.contact_radius**2
    yield Check(f"{words}: contact area", totals[1].contact_area, area, 0.02, "m^2")
    r, pressure = np.hypot(*result.zone.points[:, :2].T), -result[-1].traction[:, 2]
    exact = second.pressure(r, totals[1].normal_force)
    inner = r < 0.95 * second.contact_radius
    error = float(np.abs(pressure - exact)[inner].max() / exact.max())
    yield Check(f"{words}: pressure, largest difference relative to the peak", error, 0.0, 0.02, "", True)
    yield _section(words, r, pressure, second, totals[1].normal_force)


def _section(words: str, r: Array, pressure: Array, exact: SphereOnPowerLaw, force: float) -> Plot:
    order = np.argsort(r)
    fine = np.linspace(0.0, r.max(), 400)
    curves = (
        Curve("closed form", fine * 1e6, exact.pressure(fine, force) / 1e9),
        Curve("nodes", r[order] * 1e6, pressure[order] / 1e9, True),
    )
    return Plot(f"{words}: pressure", "r [µm]", "pressure [GPa]", curves)


def slid(formulation: Any, divisions: int, width: float = 4e-6) -> float:
    """Return the charge [C] of a grounded sphere that slides on a film, of quadratic elements."""
    result = solved(
        material="cofe2o4",
        layers=[meeframe.Layer("batio3", THICKNESS, interface=meeframe.Interface(electrode="grounded"))],
        base=meeframe.Base(3e-6),
        mesh=meeframe.mesh.half_space(width, divisions, half_width=12e-6, rings=2, element="quad9"),
        formulation=formulation,
        indenter=meeframe.Sphere(1e-5),
        contact=meeframe.IsotropicCoulomb(0.8),
        conductivity={"electric": PERFECT},
        steps=[meeframe.Step(approach=120e-9), meeframe.Step(translation=[300e-9, 0.0])],
    )
    return float(meeframe.resultants(result.zone, result[-1]).charge)


def sliding(quick: bool) -> Iterator[Check]:
    """Check the charge of a slider, singular at the contact edge, on coarse meshes against a fine grid."""
    exact = slid(HalfSpace(matrix_up_to=0), 48 if quick else 96)
    words = "slider on BaTiO3 with a grounded electrode, charge"
    resolved = slid(HalfSpace(matrix_up_to=0, edges="resolved"), 8, 3e-6)
    yield Check(f"{words}, 17 x 17 nodes, edges resolved", resolved, exact, 6e-3, "C")
    yield Check(f"{words}, 19 x 19 nodes", slid(HalfSpace(matrix_up_to=0), 9), exact, 0.025, "C")
    if not quick:
        yield Check(f"{words}, finite elements, 11 x 11 nodes", slid(FiniteElements(growth=2.5), 5), exact, 0.025, "C")


def stacks(quick: bool) -> Iterator[Item]:
    """Check means under a given load against finite elements; if not `quick`, solve one mesh of these again."""
    if not NUMBERS.exists():
        yield Skip("finite elements", f"{NUMBERS} does not exist; run the cases in a clone of the repository")
        return
    stored = {name: of_numbers(one) for name, one in json.loads(NUMBERS.read_text("utf-8")).items()}
    for number, name in enumerate(list(STACKS)[:1] if quick else STACKS):
        meshes = DIVISIONS[:1] if number == 0 and not quick else ()
        found = compare(name, meshes)
        values = zip(QUANTITIES, UNITS, found.means, stored[name].limits, strict=True)
        for quantity, unit, mean, exact in values:
            yield Check(f"{name}: {quantity}, extrapolated finite elements", float(mean), float(exact), 0.01, unit)
        for count, again, before in zip(meshes, found.element_means, stored[name].element_means, strict=False):
            change = float(np.abs(again / before - 1.0).max())
            yield Check(
                f"{name}: change of stored finite elements, {count} along the load", change, 0.0, 1e-6, "", True
            )
