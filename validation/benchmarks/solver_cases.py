"""Contact problems for the comparison of solvers: all conditions and conductivities, friction, drag and forces.

The problems are spheres on half spaces of both materials of the paper, with all couplings
(meeframe.testing.contact_cases).
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from meeframe.contact.problem import ContactProblem, PrescribedResultant
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.material import Material, library_material
from meeframe.testing.contact_cases import APPROACH, SphereCase

MATERIALS = ("batio3-cofe2o4", "orthotropic-mee")
FORCES = dict(zip(MATERIALS, (2e4, 450.0), strict=True))
"""Normal forces P [N], about those of the prescribed approach."""
PAPER_STEPS = {"batio3-cofe2o4": (5e12, 5e12), "orthotropic-mee": (5e11, 3e11)}
"""r_nu and r_tau of section 7 [Pa/m]; Table 1 has no r_tau."""
LIMITING = {"EMII": (0.0, 0.0), "ECMII": (np.inf, 0.0), "EIMCI": (0.0, np.inf), "EMCI": (np.inf, np.inf)}
FINITE = {f"kappa 1e{exponent:+d}": (10.0**exponent, 10.0**exponent) for exponent in (-4, -2, 0, 2)}
CONDITIONS = LIMITING | FINITE
"""Electric and magnetic conductivities, relative to the inverse response of a node to its flux."""
LAWS: list[ContactLaw] = [
    Signorini(),
    IsotropicCoulomb(0.6),
    IsotropicCoulomb(5.0),
    OrthotropicCoulomb(0.06, 0.6, 0.3),
]
Problem = Callable[[], ContactProblem]


def cases(cells: int = 16) -> Iterator[tuple[str, str, Problem]]:
    """Yield name, material and factory of each problem."""
    for name in MATERIALS:
        for condition in CONDITIONS:
            for law in LAWS:
                yield f"{name}, {condition}, {law}", name, partial(sphere, name, condition, law, cells)
        for condition in ("EMII", "EMCI", "kappa 1e+0"):
            for law in (IsotropicCoulomb(0.3), OrthotropicCoulomb(0.5, 5.0, 0.8)):
                for drag in (0.0, 2.0):
                    label = f"{name}, {condition}, {law}, dragged by {drag:g} approaches"
                    yield label, name, partial(sphere, name, condition, law, cells, drag)
        for label, make in FORCED.items():
            yield f"{name}, {label}", name, partial(make, name, cells)


def sphere(name: str, condition: str, law: ContactLaw, cells: int = 16, drag: float = 0.5) -> ContactProblem:
    """Return a sphere pressed in by the approach and dragged by `drag` times the approach."""
    material = library_material(name)
    own = np.abs(np.diag(_plain(material, cells).problem().system.diagonal_blocks()[0]))[3:]
    laws = [_conductivity(factor / response) for factor, response in zip(CONDITIONS[condition], own, strict=True)]
    return SphereCase(material, law, *laws, cells, drag).problem()


def reference(cells: int) -> ContactProblem:
    """Return the problem of the speed comparison: Table 1, insulated, mu = 0.6."""
    return sphere(MATERIALS[0], "EMII", IsotropicCoulomb(0.6), cells)


def _plain(material: Material, cells: int) -> SphereCase:
    return SphereCase(material, Signorini(), Insulating(), Insulating(), cells)


def _conductivity(kappa: float) -> ConductivityLaw:
    return StepConductivity(float(kappa)) if kappa > 0.0 else Insulating()


def _released(problem: ContactProblem, resultants: dict[str, float]) -> ContactProblem:
    """Return a problem with an indenter just above the surface and prescribed resultants.

    resultants: totals of "press", "x", "y" [N], "pitch" [N m], "electric" [C] and "magnetic" [Wb].
    """
    x = problem.system.points[:, 0]
    axes = {"x": (0, 1.0), "y": (1, 1.0), "press": (2, -1.0), "pitch": (2, -x), "electric": (3, -1.0)}
    axes["magnetic"] = (4, -1.0)
    prescribed_resultants = []
    for key, total in resultants.items():
        column, motion = axes[key]
        mode = np.zeros_like(problem.system.offset)
        mode[:, column] = motion
        sign = -1.0 if column > 2 else 1.0
        prescribed_resultants.append(PrescribedResultant(mode, sign * mode, problem.system.weights, total))
    lift = 1.1 * APPROACH if "press" in resultants else 0.0
    return replace(problem, gap=problem.gap + lift, prescribed_resultants=tuple(prescribed_resultants))


def _force(name: str, cells: int) -> ContactProblem:
    return _released(
        sphere(name, "EMII", IsotropicCoulomb(0.6), cells, 0.0), {"press": FORCES[name], "x": 0.0, "y": 0.0}
    )


def _nearly_sliding(name: str, cells: int) -> ContactProblem:
    problem = sphere(name, "EMII", IsotropicCoulomb(0.6), cells, 0.0)
    return _released(problem, {"press": FORCES[name], "x": 0.9 * 0.6 * FORCES[name], "y": 0.0})


def _tilted(name: str, cells: int) -> ContactProblem:
    problem = sphere(name, "EMCI", IsotropicCoulomb(0.6), cells, 0.2)
    return _released(problem, {"press": FORCES[name], "pitch": 5e-5 * FORCES[name]})


def _floating(name: str, cells: int) -> ContactProblem:
    problem = sphere(name, "kappa 1e+2", IsotropicCoulomb(0.6), cells)
    return _released(problem, {"electric": 0.0, "magnetic": 0.0})


FORCED = {
    "EMII, mu = 0.6, P given": _force,
    "EMII, mu = 0.6, P and F = 0.9 mu P given": _nearly_sliding,
    "EMCI, mu = 0.6, P and a moment given": _tilted,
    "kappa 1e+2, mu = 0.6, floating conductors": _floating,
}
