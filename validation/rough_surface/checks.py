"""Compare a rough rigid surface on an isotropic half space, frictionless and periodic, with Tamaas."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from case_files import totals_of
from half_space import converged
from isotropic import MODULUS, POISSON, STIFFNESS, YOUNG
from meeframe_halfspace import HalfSpace, SelfAffine
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, PrescribedResultant, contact_gap
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import Insulating, Signorini
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import ProjectedCG, StoppingCriteria, solve
from meeframe.study.validate import Check, Curve, Item, Map, Plot, Skip
from meeframe.system.reduced import ReducedSystem

TITLE = "Rough surface on an elastic half space, against Tamaas"
SOURCE = (
    "Frerot et al., Tamaas: a library for elastic-plastic contact of periodic rough surfaces, J. Open Source Softw. 5 "
    "(2020) 2121; algorithm of Polonsky and Keer, Wear 231 (1999) 206."
)
PERIOD = 1e-3
PRESSURES = (0.02, 0.08)
"""Mean pressure relative to E* times the root mean square slope."""
SLOPE = 0.1
Density = Literal["bilinear", "constant", "trigonometric"]


@dataclass(frozen=True, eq=False)
class Contact:
    """Pressure [Pa] and gap [m] on the grid, (n, n)."""

    pressure: Array
    gap: Array

    @property
    def area(self) -> float:
        """Fraction of the nodes under pressure."""
        return float((self.pressure > 0.0).mean())


def surface(samples: int, shortest: float) -> SelfAffine:
    """Return a self-affine surface with waves down to the length `shortest` [m]."""
    return SelfAffine(PERIOD, shortest, 0.8, rms_slope=SLOPE, roll_off=PERIOD / 2, seed=11, samples=samples)


def heights_of(rough: SelfAffine) -> Array:
    """Return the heights above the lowest point, (samples, samples) [m]."""
    return rough.surface() - rough.surface().min()


def reduced(samples: int, density: Density) -> ReducedSystem:
    """Return one period of the half space; trigonometric densities give sums of waves, as in Tamaas."""
    width = PERIOD * (samples - 1) / samples
    mesh = half_space_mesh(4.0 * PERIOD, width, samples - 1, 1, Quad4())
    formulation = HalfSpace(density, periodic=True, matrix_up_to=0)
    return formulation.reduce(Body(STIFFNESS, mesh, (), "contact"))


def ours(system: ReducedSystem, heights: Array, mean_pressure: float) -> Contact:
    """Press heights (n, n) [m] of a rigid surface on the half space with a mean pressure [Pa]."""
    press = np.zeros((len(system.points), 5))
    press[:, 2] = -1.0
    area = float(system.weights.sum())
    resultant = PrescribedResultant(press, press, system.weights, mean_pressure * area)
    place = np.lexsort((system.points[:, 1], system.points[:, 0]))  # nodes in the order of the heights
    gap = np.empty(len(place))
    gap[place] = heights.ravel()
    none = np.zeros((len(gap), 2))
    problem = ContactProblem(
        system, Signorini(), flux_channels(Insulating(), Insulating()), gap, none, none, (resultant,)
    )
    state = converged(solve(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-10))).state
    opening = contact_gap(problem, state.displacement, state.motion)[:, 2]
    shape = heights.shape
    return Contact((0.0 - state.load[:, 2])[place].reshape(shape), opening[place].reshape(shape))


def theirs(tamaas: Any, heights: Array, mean: float, constraint: str, tolerance: float = 1e-10) -> Contact:
    """Solve with Tamaas; mean: mean pressure [Pa] or gap [m], according to the constraint."""
    tamaas.set_log_level(tamaas.LogLevel.error)
    model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [PERIOD, PERIOD], list(heights.shape))
    model.E, model.nu = YOUNG, POISSON
    top = np.ascontiguousarray(-heights)
    kind = getattr(tamaas.PolonskyKeerRey, constraint)
    solver = tamaas.PolonskyKeerRey(model, top, tolerance, kind, kind)
    solver.max_iter = 10_000
    solver.solve(mean)
    pressure = np.array(model.traction, float).reshape(heights.shape)
    opening = np.array(model.displacement, float).reshape(heights.shape) - top
    return Contact(pressure, opening - opening.min())


def run(quick: bool) -> Iterator[Item]:
    """Compare pressures, area and force at the same mean gap, for two loads and two kinds of densities."""
    try:
        import tamaas
    except ImportError:
        yield Skip("Tamaas", "not installed; pip install tamaas (group references of meeframe's pyproject.toml)")
        return
    yield from _same_densities(tamaas, 64 if quick else 128)
    yield from _case_file(tamaas)
    yield from _bilinear(tamaas, 256 if quick else 512, PRESSURES[1:] if quick else PRESSURES)


def _same_densities(tamaas: Any, samples: int) -> Iterator[Item]:
    """Compare the same discrete problem, with eight samples in the shortest wave."""
    system, heights = reduced(samples, "trigonometric"), heights_of(surface(samples, 8 * PERIOD / samples))
    for share in PRESSURES:
        mean = share * MODULUS * SLOPE
        result, reference = ours(system, heights, mean), theirs(tamaas, heights, mean, "pressure")
        name = f"{samples} x {samples} nodes, mean pressure {share:g} E* h'"
        yield _pressures(name, result, reference, np.ones_like(result.pressure, bool))
        yield Check(
            f"{name}: largest pressure", float(result.pressure.max()), float(reference.pressure.max()), 0.01, "Pa"
        )
        yield Check(f"{name}: fraction of the area in contact", result.area, reference.area, 0.01)
        yield _at_same_gap(name, tamaas, heights, result, mean)
    places = (np.arange(samples) + 0.5) / samples * PERIOD * 1e3
    fields = {"meeframe": result.pressure.T / 1e9, "Tamaas": reference.pressure.T / 1e9}
    yield Map("Pressure", "x [mm]", "y [mm]", "GPa", places, places, fields)
    line = int(np.argmax(result.pressure.max(axis=1)))
    curves = (
        Curve("Tamaas", places, reference.pressure[line] / 1e9),
        Curve("meeframe", places, result.pressure[line] / 1e9, points=True),
    )
    yield Plot("Pressure on the line through its maximum", "y [mm]", "pressure [GPa]", curves)


def _case_file(tamaas: Any) -> Iterator[Check]:
    """Check the case file: the second load on 64 x 64 nodes, prescribed as a force."""
    reference = theirs(tamaas, heights_of(surface(64, PERIOD / 8)), PRESSURES[1] * MODULUS * SLOPE, "pressure")
    exact = {"force": PRESSURES[1] * MODULUS * SLOPE * PERIOD**2, "max_pressure": float(reference.pressure.max())}
    yield from totals_of(Path(__file__).with_name("periodic.toml"), exact)


def _bilinear(tamaas: Any, samples: int, shares: tuple[float, ...]) -> Iterator[Item]:
    """Compare the default densities of runs with Tamaas: two discretisations of the same contact on resolved waves.

    At the contact edge the pressure tends to zero like a square root, and the discretisations differ there: nodes
    within two spacings of it are excluded from the largest difference. Counted areas converge to first order.
    """
    systems = [reduced(count, "bilinear") for count in (samples // 2, samples)]
    heights = [heights_of(surface(count, PERIOD / 8)) for count in (samples // 2, samples)]
    for share in shares:
        mean = share * MODULUS * SLOPE
        pairs = [
            (ours(system, above, mean), theirs(tamaas, above, mean, "pressure"))
            for system, above in zip(systems, heights, strict=True)
        ]
        result, reference = pairs[-1]
        name = f"bilinear, {samples} x {samples} nodes, mean pressure {share:g} E* h'"
        difference = np.abs(result.pressure - reference.pressure) / reference.pressure.max()
        yield Check(f"{name}: pressures, r.m.s. difference relative to the peak", _rms(difference), 0.0, 0.01, "", True)
        yield _pressures(f"{name}, without contact edges", result, reference, _inner(result, reference))
        yield Check(
            f"{name}: largest pressure", float(result.pressure.max()), float(reference.pressure.max()), 0.01, "Pa"
        )
        ours_area, their_area = (2.0 * fine.area - coarse.area for coarse, fine in zip(*pairs, strict=True))
        yield Check(f"{name}: fraction of the area in contact, extrapolated", ours_area, their_area, 0.01)
        yield _at_same_gap(name, tamaas, heights[-1], result, mean)


def _pressures(name: str, result: Contact, reference: Contact, where: NDArray[np.bool_]) -> Check:
    difference = np.abs(result.pressure - reference.pressure)[where].max() / reference.pressure.max()
    return Check(f"{name}: pressures, largest difference relative to the peak", float(difference), 0.0, 0.01, "", True)


def _at_same_gap(name: str, tamaas: Any, heights: Array, result: Contact, mean: float) -> Check:
    at_gap = theirs(tamaas, heights, float(result.gap.mean()), "gap", 1e-8)  # slow under this constraint
    return Check(f"{name}: mean pressure at the same mean gap", mean, float(at_gap.pressure.mean()), 1e-3, "Pa")


def _inner(result: Contact, reference: Contact) -> NDArray[np.bool_]:
    """Return nodes whose neighbours up to the second are under pressure in both; the surface is periodic."""
    pressed = (result.pressure > 0.0) & (reference.pressure > 0.0)
    return minimum_filter(pressed, size=5, mode="wrap")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
