"""Small cases that together use all formulations, laws, solvers, indenters and kinds of load, plugins included.

The tables of a case are those of a case file; only the second body has a neutral key (see frozen_access). Indenters
are off the axes of symmetry and loads are oblique, so that few values are zero by symmetry.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

Tables = dict[str, Any]

TOLERANCE = 1e-12
"""Tolerance of the residual, in all cases except those that state another one."""


@dataclass(frozen=True)
class FrozenCase:
    """A case of the record.

    about: what it covers; tables: of the case file; kind: how it is run; options: for the kind; study: tables of the
    study file of a sweep; files: functions that write the files that the case reads, by file name; before: tables of
    a case that is run into the folder "before" first; allowed: largest difference from the record, relative to the
    scale of a quantity.
    """

    about: str
    tables: Tables
    kind: Literal["solve", "run", "compare", "sweep", "verify"] = "solve"
    options: Any = None
    study: Tables | None = None
    files: Mapping[str, Callable[[Path], None]] | None = None
    before: Tables | None = None
    allowed: float = 1e-9


HIERARCHICAL_TOLERANCE = 1e-4
"""Tolerance of hierarchical matrices, whose truncation selects other terms on other processors."""

# --- tables of cases -----------------------------------------------------------------------------------------------

ISOTROPIC = {"name": "isotropic", "young_modulus": "210 GPa", "poisson_ratio": 0.3}
MEE = {"name": "batio3-cofe2o4"}
ORTHOTROPIC = {"name": "orthotropic-mee"}
TILTED = {"name": "batio3-cofe2o4", "rotation": {"axis": [1, 2, -1], "angle": "45 deg"}}

GROUND = {"displacement": [0, 0, 0], "electric_potential": 0, "magnetic_potential": 0}
BASE = [{"group": "base", **GROUND}]
SIDES = [
    *BASE,
    {"group": ["side_x-", "side_x+", "side_y-", "side_y+"], "electric_potential": 0, "magnetic_potential": 0},
]

SPHERE = {"name": "sphere", "radius": "100 mm", "x": "0.13 mm", "y": "-0.21 mm"}
PERFECT = {"name": "step", "kappa": float("inf")}
BY_PRESSURE = {"name": "power-law", "reference_conductivity": "20 uF/m^2", "reference_pressure": "1 GPa"}
MAGNETIC_BY_PRESSURE = {"name": "saturating", "largest_conductivity": "0.5 H/m^2", "saturation_pressure": "2 GPa"}
"""Both grow continuously from zero, so the solution is unique."""

PRESS = [{"approach": "20 um"}, {"approach": "40 um"}]
DRAG = {"approach": "40 um", "translation": ["9 um", "4 um"], "increments": 2}
LIFT = {"approach": "25 um", "translation": ["6 um", "5 um"]}
PRESS_AND_DRAG = [{"approach": "40 um", "increments": 2}, DRAG]
LOOP = [*PRESS, DRAG, LIFT]


def solver(name: str = "auto", tolerance: float = TOLERANCE, **keys: Any) -> Tables:
    return {"name": name, "tolerance": tolerance, **keys}


def half_space(divisions: int = 13, width: str = "5 mm", **formulation: Any) -> Tables:
    """Return a body of Table 1 by fast Fourier transforms, under a sphere."""
    return {
        "material": MEE,
        "mesh": {"type": "half-space", "contact_width": width, "divisions": divisions},
        "formulation": {"name": "half-space", **formulation},
        "indenter": SPHERE,
        "solver": solver(),
        "steps": PRESS,
    }


def plane(element: str = "quad4", divisions: int = 6, rings: int = 3, **formulation: Any) -> Tables:
    """Return a half space of Table 1 by boundary elements, under a sphere."""
    return {
        **half_space(),
        "mesh": {
            "type": "half-space",
            "half_width": "40 mm",
            "contact_width": "5 mm",
            "divisions": divisions,
            "rings": rings,
            "element": element,
        },
        "formulation": {"name": "dense-bem", "quadrature_tolerance": 1e-4, **formulation},
    }


def block(element: str = "quad4", divisions: int = 6, rings: int = 2, layers: int = 1, **formulation: Any) -> Tables:
    """Return a block of Table 1 by boundary elements, under a sphere."""
    mesh = {
        "half_width": "50 mm",
        "height": "120 mm",
        "contact_width": "5 mm",
        "divisions": divisions,
        "rings": rings,
        "layers": layers,
        "element": element,
    }
    named = {"name": "dense-bem", "quadrature_tolerance": 1e-4} if "name" not in formulation else {}
    return {**plane(), "mesh": mesh, "boundary": SIDES, "formulation": {**named, **formulation}}


def frictional(law: Tables, *, steps: Sequence[Tables] = PRESS_AND_DRAG, **changes: Any) -> Tables:
    """Return a half space under a contact law, pressed and dragged."""
    return {**half_space(), "contact": {"law": law}, "steps": list(steps), **changes}


def conducting(electric: Tables, magnetic: Tables | None = None, potential: str = "2 kV", **changes: Any) -> Tables:
    """Return a half space under conductivity laws."""
    laws = {"electric": electric} if magnetic is None else {"electric": electric, "magnetic": magnetic}
    indenter = {**SPHERE, "electric_potential": potential}
    if magnetic is not None:
        indenter["magnetic_potential"] = "5 A"
    return {**half_space(width="6 mm"), "conductivity": laws, "indenter": indenter, **changes}


COULOMB = {"name": "isotropic-coulomb", "mu": 0.3}
ELLIPTIC = {"name": "orthotropic-coulomb", "mu1": 0.2, "mu2": 0.5, "angle": "35 deg"}
PUNCH = {"name": "flat-punch", "radius": "1.37 mm", "x": "0.11 mm", "y": "-0.07 mm"}


def write_map(file: Path) -> None:
    """Write heights of an undulating surface in micrometres at a spacing of 0.25 mm, rows along y."""
    x, y = np.meshgrid(np.arange(29) * 0.25 - 3.4, np.arange(29) * 0.25 - 3.6)
    np.save(file, 8.0 * np.cos(1.1 * x + 0.3) * np.cos(0.9 * y - 0.2) - 2.0 * (x**2 + 1.3 * y**2))


def write_heights(file: Path) -> None:
    """Write rows x, y, height of an indenter's underside in millimetres."""
    x, y = np.meshgrid(np.linspace(-3, 3, 25), np.linspace(-3, 3, 25), indexing="ij")
    z = (x - 0.1) ** 2 / 190 + (y + 0.2) ** 2 / 230 + 1e-3 * np.sin(2 * x) * np.cos(1.5 * y)
    np.savetxt(file, np.column_stack([x.ravel(), y.ravel(), z.ravel()]), fmt="%.17g")


# --- the cases -----------------------------------------------------------------------------------------------------

FORMULATIONS = {
    "dense-bem-quad4": FrozenCase(
        "block, bilinear quadrilaterals, Coulomb friction, finite conduction of both fields, prescribed tractions",
        {
            **block(),
            "boundary": [
                *BASE,
                {"group": "side_x+", "traction": ["free", "2 MPa", "1 MPa"], "electric_flux": "1e-6 C/m^2"},
            ],
            "contact": {"law": COULOMB},
            "conductivity": {"electric": {"name": "step", "kappa": 2e-6}, "magnetic": {"name": "step", "kappa": 0.05}},
            "steps": PRESS_AND_DRAG,
        },
    ),
    "dense-bem-quad8": FrozenCase("block, serendipity quadrilaterals", block("quad8", 3)),
    "dense-bem-quad9": FrozenCase(
        "block, biquadratic quadrilaterals, Coulomb friction",
        {**block("quad9", 3), "contact": {"law": COULOMB}, "steps": PRESS_AND_DRAG},
    ),
    "dense-bem-tri3": FrozenCase(
        "plane, linear triangles, Coulomb friction",
        {**plane("tri3", 5, 2), "contact": {"law": COULOMB}, "steps": PRESS_AND_DRAG},
    ),
    "dense-bem-tri6": FrozenCase("plane, quadratic triangles", plane("tri6", 3, 2)),
    "dense-bem-orthotropic": FrozenCase(
        "block of Table 3 on a turned axis, orthotropic friction along friction axes around a line",
        {
            **block(divisions=5),
            "material": {"name": "orthotropic-mee", "rotation": {"axis": [2, -1, 1], "angle": "30 deg"}},
            "contact": {"law": ELLIPTIC, "axes": {"around": [0, 0, 1], "centre": ["1 mm", "4 mm", 0]}},
            "steps": PRESS_AND_DRAG,
        },
    ),
    "hmatrix-bem": FrozenCase(
        "block, hierarchical matrices, Coulomb friction",
        {
            **block(divisions=8, rings=3, layers=2, name="hmatrix-bem", tolerance=HIERARCHICAL_TOLERANCE),
            "contact": {"law": COULOMB},
            "steps": PRESS_AND_DRAG,
        },
        allowed=0.1 * HIERARCHICAL_TOLERANCE,
    ),
    "hmatrix-bem-conducting": FrozenCase(
        "block, hierarchical matrices, perfect conduction, pressed by a force",
        {
            **block(divisions=8, rings=3, layers=2, name="hmatrix-bem", tolerance=HIERARCHICAL_TOLERANCE),
            "conductivity": {"electric": PERFECT, "magnetic": {"name": "step", "kappa": 0.05}},
            "indenter": {**SPHERE, "electric_potential": "2 kV"},
            "steps": [{"normal_force": "20 kN"}],
        },
        allowed=0.1 * HIERARCHICAL_TOLERANCE,
    ),
    "skfem-tensor": FrozenCase(
        "block by finite elements on a tensor grid, Coulomb friction",
        {**block(divisions=6, name="skfem", growth=2.5), "contact": {"law": COULOMB}, "steps": PRESS_AND_DRAG},
    ),
    "skfem-shells": FrozenCase(
        "block by quadratic finite elements in shells, perfect conduction",
        {
            **block("quad9", 3, name="skfem", growth=3.0, grid="shells"),
            "conductivity": {"electric": PERFECT, "magnetic": PERFECT},
        },
    ),
    "half-space-matrix-free": FrozenCase(
        "free half space without a matrix, Coulomb friction",
        {**half_space(50, matrix_up_to=0), "contact": {"law": COULOMB}, "steps": PRESS_AND_DRAG},
    ),
    "half-space-fine": FrozenCase(
        "grid fine enough for every acceleration of the half space, friction and conduction",
        {
            **half_space(125),
            "contact": {"law": COULOMB},
            "conductivity": {"electric": BY_PRESSURE},
            "indenter": {**SPHERE, "electric_potential": "2 kV"},
            "steps": [{"approach": "40 um", "translation": ["6 um", "3 um"]}],
        },
    ),
    "half-space-fine-frictionless": FrozenCase(
        "the same grid without friction, insulated, pressed by a force",
        {**half_space(125), "steps": [{"normal_force": "9 kN"}]},
    ),
    "half-space-constant-density": FrozenCase(
        "free half space of Table 3 on a turned axis, piecewise constant density",
        {**half_space(density="constant"), "material": TILTED, "contact": {"law": COULOMB}, "steps": PRESS_AND_DRAG},
    ),
    "half-space-periodic": FrozenCase(
        "periodic half space under a rough surface, prescribed force, conjugate gradients",
        {
            **half_space(31, "1.9375 mm", periodic=True, matrix_up_to=0),
            "indenter": {
                "name": "self-affine",
                "period": "2 mm",
                "samples": 32,
                "rms_height": "2 um",
                "hurst": 0.8,
                "roll_off": "1 mm",
                "shortest": "0.25 mm",
                "seed": 7,
            },
            "steps": [{"normal_force": "300 N"}],
        },
    ),
    "half-space-periodic-friction": FrozenCase(
        "periodic half space, trigonometric density, waves of the interface, friction, pressed by a force",
        {
            **half_space(15, "1.875 mm", periodic=True, density="trigonometric"),
            "indenter": {"name": "rectangular-punch", "half_width_x": "5 mm", "half_width_y": "5 mm"},
            "contact": {
                "law": {
                    "name": "signorini-gap",
                    "amplitude": "2 um",
                    "wavelength_1": "2 mm",
                    "wavelength_2": "2 mm",
                    "phase_1": 0.3,
                    "phase_2": -0.7,
                    "mu": 0.2,
                }
            },
            "steps": [{"normal_force": "1 kN"}, {"tangential_force": ["120 N", "40 N"]}],
        },
    ),
    "resolved-edges-sphere": FrozenCase(
        "free half space, contact edge between the nodes, conducting sphere at a potential",
        {
            **half_space(21, edges="resolved"),
            "conductivity": {"electric": PERFECT, "magnetic": PERFECT},
            "indenter": {**SPHERE, "electric_potential": "-10 kV", "magnetic_potential": "20 A"},
            "steps": [{"approach": "40 um"}],
        },
    ),
    "resolved-edges-fine": FrozenCase(
        "fine grid, contact edge between the nodes, conducting cone, friction",
        {
            **half_space(60, edges="resolved"),
            "contact": {"law": COULOMB},
            "conductivity": {"electric": PERFECT},
            "indenter": {
                "name": "cone",
                "angle": "1.2 deg",
                "x": "0.1 mm",
                "y": "0.07 mm",
                "electric_potential": "-5 kV",
            },
            "steps": [{"approach": "40 um", "translation": ["6 um", "3 um"]}],
        },
    ),
    "resolved-edges-punch": FrozenCase(
        "free half space, contact edge between the nodes, flat punch with friction, force, then drag",
        {
            **half_space(17, edges="resolved"),
            "indenter": PUNCH,
            "contact": {"law": COULOMB},
            "steps": [{"normal_force": "8 kN"}, {"tangential_force": ["0.9 kN", "0.5 kN"]}],
        },
    ),
}

CONTACT_LAWS = {
    "coulomb-loop": FrozenCase(
        "isotropic Coulomb friction, pressed, dragged and lifted", frictional(COULOMB, steps=LOOP)
    ),
    "orthotropic-coulomb": FrozenCase(
        "orthotropic Coulomb friction along a direction, medium of Table 3",
        frictional(ELLIPTIC, contact={"law": ELLIPTIC, "axes": {"direction": [2, 1, 0]}}, material=ORTHOTROPIC),
    ),
    "full-stick": FrozenCase(
        "infinite friction", frictional({"name": "isotropic-coulomb", "mu": float("inf")}, steps=PRESS)
    ),
    "tresca": FrozenCase(
        "constant friction limit",
        {**half_space(9), "contact": {"law": {"name": "tresca", "limit": "150 MPa"}}, "steps": PRESS_AND_DRAG},
    ),
    "capped-coulomb": FrozenCase(
        "capped friction limit", frictional({"name": "capped-coulomb", "mu": 0.3, "limit": "300 MPa"})
    ),
    "regularised-coulomb": FrozenCase(
        "smooth friction", frictional({"name": "regularised-coulomb", "mu": 0.3, "slip_length": "0.5 um"})
    ),
    "slip-weakening": FrozenCase(
        "friction that weakens along the slip path",
        frictional(
            {"name": "slip-weakening", "mu_static": 0.4, "mu_kinetic": 0.2, "slip_distance": "20 um"},
            steps=[*PRESS, {"approach": "40 um", "translation": ["12 um", "5 um"], "increments": 4}],
        ),
    ),
    "rate-and-pressure": FrozenCase(
        "friction by speed and pressure",
        frictional(
            {
                "name": "rate-and-pressure",
                "mu_static": 0.4,
                "mu_kinetic": 0.2,
                "reference_speed": "1 mm/s",
                "reference_pressure": "1 GPa",
                "pressure_exponent": 0.9,
            },
            steps=[
                {"approach": "40 um", "increments": 2, "duration": "1 s"},
                {**DRAG, "duration": "20 ms"},
                {"translation": ["20 um", "9 um"], "duration": "5 ms"},
            ],
        ),
    ),
    "archard": FrozenCase(
        "wear by the slip of friction",
        frictional(
            COULOMB,
            contact={"law": COULOMB, "wear": {"name": "archard", "coefficient": "5e-11 1/Pa"}},
            steps=[*PRESS_AND_DRAG, {"translation": ["5 mm", 0], "max_pressure_change": 0.3}],
        ),
    ),
    "non-associated-coulomb": FrozenCase(
        "slip normal to another ellipse",
        frictional({"name": "non-associated-coulomb", "mu1": 0.4, "mu2": 0.2, "slip_ratio": 1}),
    ),
    "superelliptic-coulomb": FrozenCase(
        "friction limit near a rhombus",
        frictional({"name": "superelliptic-coulomb", "mu1": 0.4, "mu2": 0.2, "exponent": 1.3}),
    ),
    "compliant": FrozenCase(
        "compliant interface with friction",
        frictional(
            {
                "name": "compliant",
                "reference_pressure": "1 GPa",
                "reference_closure": "5 um",
                "exponent": 2,
                "mu": 0.3,
            }
        ),
    ),
    "dmt": FrozenCase(
        "van der Waals attraction, pressed and drawn off",
        frictional(
            {"name": "dmt", "work_of_adhesion": "600 J/m^2", "equilibrium_distance": "20 um", "mu": 0.3},
            steps=[{"approach": "20 um"}, {"translation": ["4 um", "1 um"]}, {"approach": "-20 um", "increments": 2}],
        ),
    ),
    "dmt-coulomb": FrozenCase(
        "adhesive offset of the friction limit",
        frictional({"name": "dmt-coulomb", "mu": 0.2, "adhesive_pressure": "300 MPa"}),
    ),
    "dugdale": FrozenCase(
        "attraction of limited range, drawn off by a force",
        frictional(
            {"name": "dugdale", "work_of_adhesion": "2 kJ/m^2", "adhesive_stress": "100 MPa", "transition": 0.5},
            steps=[{"approach": "20 um"}, {"normal_force": 0}, {"normal_force": "-400 N"}],
        ),
    ),
    "signorini-gap": FrozenCase(
        "waves of the interface under a rectangular punch askew",
        frictional(
            {"name": "signorini-gap", "amplitude": "2 um", "wavelength_1": "5 mm", "phase_1": 0.2, "mu": 0.2},
            indenter={
                "name": "rectangular-punch",
                "half_width_x": "1.9 mm",
                "half_width_y": "1.4 mm",
                "rotation": "17 deg",
            },
            steps=[{"approach": "12 um", "increments": 2}],
        ),
    ),
}

CONDUCTION_LAWS = {
    "step": FrozenCase(
        "finite conduction of both fields",
        conducting({"name": "step", "kappa": 2e-6}, {"name": "step", "kappa": 0.05}),
    ),
    "perfect": FrozenCase("perfect electric conduction, insulated magnetically", conducting(PERFECT)),
    "step-biactive": FrozenCase(
        "finite conduction of both fields, medium of Table 3: biactive nodes with contact fractions between 0 and 1",
        conducting(
            {"name": "step", "kappa": 2e-6},
            {"name": "step", "kappa": 0.05},
            potential="1 kV",
            material=ORTHOTROPIC,
            mesh=half_space()["mesh"],
        ),
    ),
    "power-law": FrozenCase(
        "conduction by a power of the pressure",
        conducting(BY_PRESSURE, potential="20 kV"),
    ),
    "saturating": FrozenCase(
        "conduction that saturates, with friction",
        conducting(
            {"name": "saturating", "largest_conductivity": "50 uF/m^2", "saturation_pressure": "2 GPa"},
            potential="20 kV",
            contact={"law": COULOMB},
        ),
    ),
    "thresholded": FrozenCase(
        "conduction beyond a threshold",
        conducting(
            {"name": "thresholded", "contact_conductivity": "20 uF/m^2", "threshold": "500 MPa", "ramp": "500 MPa"},
            potential="20 kV",
        ),
    ),
    "across-gap": FrozenCase(
        "conduction across the gap, before contact and in it",
        conducting(
            {"name": "across-gap", "gap_constant": "1 vacuum_permittivity", "residual_gap": "1 um"},
            {
                "name": "across-gap",
                "gap_constant": "1 vacuum_permeability",
                "contact_conductivity": "20 H/m^2",
                "residual_gap": "1 um",
            },
            steps=[{"approach": "-20 um"}, {"approach": "40 um", "increments": 2}],
        ),
    ),
    "breakdown": FrozenCase(
        "conduction across the gap with discharge",
        conducting(
            {
                "name": "breakdown",
                "gap_constant": "1 vacuum_permittivity",
                "breakdown_field": "30 MV/m",
                "breakdown_conductivity": "20 uF/m^2",
                "residual_gap": "1 um",
            },
            steps=[{"approach": "-20 um"}, {"approach": "40 um", "increments": 2}],
        ),
    ),
    "robin": FrozenCase(
        "conduction everywhere, an electrode for the magnetic field",
        conducting({"name": "robin", "kappa": "20 uF/m^2"}, {"name": "robin", "kappa": float("inf")}),
    ),
}

SOLVERS = {
    f"solver-{name}": FrozenCase(
        f"{name} on finite conduction and friction, with a matrix",
        {
            **half_space(9),
            "contact": {"law": COULOMB},
            "conductivity": {"electric": BY_PRESSURE},
            "indenter": {**SPHERE, "electric_potential": "2 kV"},
            "solver": solver(name),
            "steps": PRESS_AND_DRAG,
        },
    )
    for name in ("newton", "uzawa", "uzawa-bb", "uzawa-nesterov")
} | {
    "solver-projected-cg": FrozenCase(
        "recorded with conjugate gradients, which accept no conduction any more: no matrix, no friction, conduction",
        {
            **half_space(60, matrix_up_to=0),
            "conductivity": {"electric": BY_PRESSURE},
            "indenter": {**SPHERE, "electric_potential": "2 kV"},
            "solver": solver("newton"),
        },
    ),
    "solver-auto-matrix-free": FrozenCase(
        "auto without a matrix on friction and conduction, pressed by a force",
        {
            **half_space(48, matrix_up_to=0),
            "contact": {"law": COULOMB},
            "conductivity": {"electric": BY_PRESSURE},
            "indenter": {**SPHERE, "electric_potential": "2 kV"},
            "steps": [{"normal_force": "5 kN"}, {"force_ratio": 0.2, "direction": "25 deg"}],
        },
    ),
}

FUNDAMENTAL_SOLUTIONS = {
    "residue": FrozenCase(
        "fundamental solution by residues, turned material",
        {**plane(divisions=4, rings=1, fundamental_solution="residue"), "material": TILTED},
    ),
    "line-integral": FrozenCase(
        "fundamental solution by line integrals",
        {**plane(divisions=3, rings=1, fundamental_solution="line-integral"), "steps": [{"approach": "40 um"}]},
    ),
    "isotropic": FrozenCase(
        "isotropic fundamental solution, friction",
        {
            **plane(fundamental_solution="isotropic"),
            "material": ISOTROPIC,
            "contact": {"law": COULOMB},
            "steps": PRESS_AND_DRAG,
        },
    ),
}

INDENTERS = {
    "flat-punch-moments": FrozenCase(
        "flat punch under force, moment and torque: all motions but the translation are free",
        {
            **half_space(),
            "indenter": PUNCH,
            "contact": {"law": COULOMB},
            "steps": [{"normal_force": "8 kN"}, {"moment": ["1.1 N m", "-0.7 N m"], "torque": "0.9 N m"}],
        },
    ),
    "cylinder": FrozenCase(
        "cylinder across the axes, exact profile, flat ends, tilted and twisted",
        {
            **half_space(),
            "indenter": {
                "name": "cylinder",
                "radius": "80 mm",
                "direction": "20 deg",
                "profile": "exact",
                "half_length": "1.9 mm",
                "x": "0.1 mm",
            },
            "contact": {"law": COULOMB},
            "steps": [{"approach": "15 um"}, {"approach": "15 um", "tilt": [1e-3, -5e-4], "twist": 2e-3}],
        },
    ),
    "cone": FrozenCase(
        "cone, insulated",
        {**half_space(), "indenter": {"name": "cone", "angle": "1.2 deg", "x": "0.1 mm", "y": "0.07 mm"}},
    ),
    "paraboloid": FrozenCase(
        "paraboloid turned and tilted, orthotropic medium",
        {
            **half_space(),
            "material": ORTHOTROPIC,
            "indenter": {
                "name": "paraboloid",
                "radius_x": "90 mm",
                "radius_y": "140 mm",
                "rotation": "30 deg",
                "tilt_1": 0.002,
            },
        },
    ),
    "height-map": FrozenCase(
        "measured surface, levelled, cubic interpolation",
        {
            **half_space(),
            "indenter": {
                "name": "height-map",
                "file": "surface.npy",
                "unit": "1 um",
                "spacing": ["0.25 mm", "0.25 mm"],
                "levelled": True,
                "interpolation": "cubic",
            },
            "steps": [{"normal_force": "3 kN"}],
        },
        files={"surface.npy": write_map},
    ),
    "heights": FrozenCase(
        "heights from a file, linear interpolation",
        {**half_space(), "indenter": {"name": "heights", "file": "heights.txt", "unit": "1 mm"}},
        files={"heights.txt": write_heights},
    ),
}

CONTROL = {
    "force-control": FrozenCase(
        "normal and tangential force, forth and back",
        frictional(
            COULOMB,
            steps=[
                {"normal_force": "5 kN", "increments": 2},
                {"tangential_force": ["0.9 kN", "0.4 kN"], "increments": 2},
                {"tangential_force": ["-0.5 kN", "0.1 kN"]},
                {"normal_force": "4 kN"},
            ],
        ),
    ),
    "charge-control": FrozenCase(
        "prescribed charge and magnetic flux, then potentials",
        conducting(
            BY_PRESSURE,
            MAGNETIC_BY_PRESSURE,
            steps=[
                {"approach": "40 um", "charge": "2e-9 C", "magnetic_flux": "1e-5 Wb"},
                {"charge": "-1e-9 C", "magnetic_potential": "3 A"},
            ],
        ),
    ),
    "floating-potentials": FrozenCase(
        "perfect conductor without charge and flux, friction, block by boundary elements",
        {
            **block(),
            "contact": {"law": COULOMB},
            "conductivity": {"electric": PERFECT, "magnetic": PERFECT},
            "steps": [{"approach": "40 um", "charge": 0, "magnetic_flux": 0}],
        },
    ),
}

SECOND = {"material": ORTHOTROPIC, "mesh": half_space()["mesh"], "formulation": {"name": "half-space"}}

TWO_BODIES = {
    "two-half-spaces": FrozenCase(
        "two half spaces by fast Fourier transforms, friction along axes, finite conduction",
        {
            **half_space(),
            "material": TILTED,
            "second_body": SECOND,
            "contact": {"law": ELLIPTIC, "axes": {"direction": [1, 2, 0]}},
            "conductivity": {"electric": BY_PRESSURE, "magnetic": MAGNETIC_BY_PRESSURE},
            "indenter": {**SPHERE, "electric_potential": "1 kV", "magnetic_potential": "-5 A"},
            "steps": PRESS_AND_DRAG,
        },
    ),
    "rolling": FrozenCase(
        "two half spaces that roll, a few cells and steadily, with spin, friction along axes and finite conduction",
        {
            **half_space(),
            "material": TILTED,
            "second_body": SECOND,
            "contact": {"law": COULOMB, "axes": {"around": [0, 0, 1]}},
            "conductivity": {"electric": BY_PRESSURE},
            "indenter": {**SPHERE, "electric_potential": "1 kV"},
            "steps": [
                {"approach": "30 um", "increments": 2},
                {"rolling": {"direction": [0, -1], "distance": "1 mm", "creepage": [2e-3, 1e-3], "spin": "0.3 1/m"}},
                {"rolling": {"steady": True, "creepage": [2e-3, 1e-3]}},
            ],
        },
    ),
    "two-half-spaces-matrix-free": FrozenCase(
        "two half spaces without a matrix, friction",
        {
            **half_space(48, matrix_up_to=0),
            "second_body": {
                **SECOND,
                "mesh": half_space(48)["mesh"],
                "formulation": {"name": "half-space", "matrix_up_to": 0},
            },
            "contact": {"law": COULOMB},
            "steps": PRESS_AND_DRAG,
        },
    ),
    "two-resolved-edges": FrozenCase(
        "two half spaces, contact edge between the nodes, perfect conduction",
        {
            **half_space(17, edges="resolved"),
            "second_body": {
                **SECOND,
                "material": ISOTROPIC,
                "mesh": half_space(17)["mesh"],
                "formulation": {"name": "half-space", "edges": "resolved"},
            },
            "conductivity": {"electric": PERFECT},
            "indenter": {**SPHERE, "electric_potential": "5 kV"},
            "steps": [{"approach": "40 um"}],
        },
    ),
    "bem-and-fem": FrozenCase(
        "a half space by boundary elements and a block by finite elements, friction along axes",
        {
            **plane(divisions=5, rings=2),
            "second_body": {
                "material": {**MEE, "rotation": {"axis": [0, 1, 0], "angle": "20 deg"}},
                "mesh": block(divisions=5)["mesh"],
                "boundary": BASE,
                "formulation": {"name": "skfem", "growth": 3.0},
            },
            "contact": {"law": ELLIPTIC, "axes": {"direction": [1, -1, 0]}},
            "steps": PRESS_AND_DRAG,
        },
    ),
}

RESTARTED = frictional({"name": "slip-weakening", "mu_static": 0.4, "mu_kinetic": 0.2, "slip_distance": "20 um"})

STUDIES = {
    "results-folder": FrozenCase(
        "a run whose results are written and read again",
        {**frictional(COULOMB), "output": {"figures": False, "vtu": False}},
        kind="run",
    ),
    "restart": FrozenCase(
        "a run continued from the folder of another one, with a memory of slip",
        {
            **RESTARTED,
            "restart": {"from": "before"},
            "steps": [{"translation": ["14 um", "9 um"], "increments": 2}, {"approach": "30 um"}],
        },
        before={**RESTARTED, "output": {"figures": False, "vtu": False}},
    ),
    "sweep": FrozenCase(
        "a sweep over friction and conditions, with nodal fields",
        frictional(COULOMB, steps=[{"approach": "40 um", "increments": 2}]),
        kind="sweep",
        study={
            "title": "frozen",
            "case": "case.toml",
            "fields": ["pressure"],
            "axes": {
                "contact.law.mu": [0.1, 0.3],
                "condition": {
                    "EMII": {},
                    "finite": {"conductivity.electric": {"name": "step", "kappa": 2e-6}},
                },
            },
        },
    ),
    "compare": FrozenCase(
        "a comparison of formulations, laws and solvers",
        plane(divisions=5, rings=2),
        kind="compare",
        options={
            "formulation": ["dense-bem", "half-space"],
            "contact-law": ["signorini", "{name = 'isotropic-coulomb', mu = 0.2}"],
            "solver": ["newton"],
        },
    ),
    "verify": FrozenCase(
        "a verification by two formulations on three meshes",
        {**plane(divisions=8, rings=4), "steps": [{"approach": "40 um"}]},
        kind="verify",
        options=["dense-bem", "half-space"],
    ),
}

CASES: Mapping[str, FrozenCase] = {
    **FORMULATIONS,
    **CONTACT_LAWS,
    **CONDUCTION_LAWS,
    **SOLVERS,
    **FUNDAMENTAL_SOLUTIONS,
    **INDENTERS,
    **CONTROL,
    **TWO_BODIES,
    **STUDIES,
}
