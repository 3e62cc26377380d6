"""A rough rigid surface on an isotropic half space, frictionless and periodic: against Tamaas, an independent code."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from half_space import converged
from isotropic import MODULUS, POISSON, STIFFNESS, YOUNG
from meeframe_halfspace import HalfSpace, SelfAffine

from meeframe.core.body import Body
from meeframe.core.contact import ContactProblem, Freedom, contact_gap
from meeframe.core.fields import Array
from meeframe.core.formulation import ReducedSystem
from meeframe.elements import Quad4
from meeframe.geometry import half_space_mesh
from meeframe.laws import Insulating, Signorini
from meeframe.solvers import Limits, ProjectedCG, solve
from meeframe.study.validate import Check, Curve, Item, Map, Plot, Skip

TITLE = "Rough surface on an elastic half space, against Tamaas"
SOURCE = (
    "Frerot et al., Tamaas: a library for elastic-plastic contact of periodic rough surfaces, J. Open Source Softw. 5 "
    "(2020) 2121; algorithm of Polonsky and Keer, Wear 231 (1999) 206."
)
PERIOD = 1e-3
PRESSURES = (0.02, 0.08)
"""Mean pressure over E* times the root mean square slope."""
SLOPE = 0.1


@dataclass(frozen=True, eq=False)
class Contact:
    """Pressure and gap on the grid, (n, n) [Pa], [m]."""

    pressure: Array
    gap: Array

    @property
    def area(self) -> float:
        """Share of the nodes that are pressed."""
        return float((self.pressure > 0.0).mean())


def surface(samples: int) -> SelfAffine:
    """With 8 samples in the shortest wave."""
    return SelfAffine(PERIOD, 8 * PERIOD / samples, 0.8, rms_slope=SLOPE, roll_off=PERIOD / 2, seed=11, samples=samples)


def reduced(samples: int) -> ReducedSystem:
    """One period of the half space; its responses are sums of waves, as in the other code."""
    width = PERIOD * (samples - 1) / samples
    mesh = half_space_mesh(4.0 * PERIOD, width, samples - 1, 1, Quad4())
    formulation = HalfSpace("trigonometric", periodic=True, matrix_up_to=0)
    return formulation.reduce(Body(STIFFNESS, mesh, (), "contact"))


def ours(system: ReducedSystem, heights: Array, mean_pressure: float) -> Contact:
    """Heights (n, n) above the lowest point of the rigid surface [m], pressed on until that mean pressure [Pa]."""
    press = np.zeros((len(system.points), 5))
    press[:, 2] = -1.0
    area = float(system.weights.sum())
    freedom = Freedom(press, system.weights[:, None] * press, mean_pressure * area)
    place = np.lexsort((system.points[:, 1], system.points[:, 0]))  # nodes in the order of the heights
    gap = np.empty(len(place))
    gap[place] = heights.ravel()
    none = np.zeros((len(gap), 2))
    problem = ContactProblem(system, Signorini(), Insulating(), Insulating(), gap, none, none, (freedom,))
    state = converged(solve(problem, ProjectedCG(), Limits(tolerance=1e-10))).state
    opening = contact_gap(problem, state.displacement, state.motion)[:, 2]
    shape = heights.shape
    return Contact((0.0 - state.load[:, 2])[place].reshape(shape), opening[place].reshape(shape))


def theirs(tamaas: Any, heights: Array, mean: float, constraint: str) -> Contact:
    """The same by Tamaas; mean: of the pressure [Pa] or of the gap [m], whichever the constraint is."""
    tamaas.set_log_level(tamaas.LogLevel.error)
    model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [PERIOD, PERIOD], list(heights.shape))
    model.E, model.nu = YOUNG, POISSON
    top = np.ascontiguousarray(-heights)
    kind = getattr(tamaas.PolonskyKeerRey, constraint)
    solver = tamaas.PolonskyKeerRey(model, top, 1e-10, kind, kind)
    solver.max_iter = 10_000
    solver.solve(mean)
    pressure = np.array(model.traction, float).reshape(heights.shape)
    opening = np.array(model.displacement, float).reshape(heights.shape) - top
    return Contact(pressure, opening - opening.min())


def run(quick: bool) -> Iterator[Item]:
    """Two loads; pressures, area, and the force at the same mean gap."""
    try:
        import tamaas
    except ImportError:
        yield Skip("Tamaas", "not installed; pip install tamaas (group judges of meeframe's pyproject.toml)")
        return
    samples = 64 if quick else 128
    system, rough = reduced(samples), surface(samples)
    heights = rough.surface() - rough.surface().min()
    for share in PRESSURES:
        mean = share * MODULUS * SLOPE
        found, judge = ours(system, heights, mean), theirs(tamaas, heights, mean, "pressure")
        name = f"{samples} x {samples} nodes, mean pressure {share:g} E* h'"
        difference = np.abs(found.pressure - judge.pressure)
        peak = float(judge.pressure.max())
        yield Check(
            f"{name}: pressures, largest difference over the peak", difference.max() / peak, 0.0, 0.01, "", True
        )
        yield Check(f"{name}: largest pressure", float(found.pressure.max()), peak, 0.01, "Pa")
        yield Check(f"{name}: share of the area in contact", found.area, judge.area, 0.01)
        at_gap = theirs(tamaas, heights, float(found.gap.mean()), "gap")
        yield Check(f"{name}: mean pressure at the same mean gap", mean, float(at_gap.pressure.mean()), 1e-3, "Pa")
    places = (np.arange(samples) + 0.5) / samples * PERIOD * 1e3
    fields = {"meeframe": found.pressure.T / 1e9, "Tamaas": judge.pressure.T / 1e9}
    yield Map("Pressure", "x [mm]", "y [mm]", "GPa", places, places, fields)
    line = int(np.argmax(found.pressure.max(axis=1)))
    curves = (
        Curve("Tamaas", places, judge.pressure[line] / 1e9),
        Curve("meeframe", places, found.pressure[line] / 1e9, points=True),
    )
    yield Plot("Pressure on the line through its largest value", "y [mm]", "pressure [GPa]", curves)
