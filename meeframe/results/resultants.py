"""Resultants of an increment over the contact zone: forces, moments, total fluxes, areas and maxima."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.scales import largest
from meeframe.fields import Array
from meeframe.mesh.measures import corners, vector_areas
from meeframe.mesh.regular import GridCells, global_components
from meeframe.results.records import Region, StepResult, Zone, named_scalar

_BLOCK: Final = 2**16
"""Number of nodes whose forces are summed at once."""
_WEIGHT_ROUND_OFF: Final = 1e-12
"""Difference of nodal weights that counts as round-off, as a fraction of the largest weight."""


@dataclass(frozen=True, eq=False)
class Resultants:
    """Resultants and maxima of an increment over the contact zone.

    The total fluxes and the largest absolute potentials are also attributes by their names, such as `charge` [C],
    `magnetic_flux` [Wb] and `max_abs_electric_potential` [V].

    Attributes
    ----------
    force : Array
        Force of the indenter on the body in global axes, (3,) [N].
    normal_force : float
        Force against the axis of the indenter, positive in compression [N].
    tangential_force : Array
        Force along the axes e1 and e2 of the indenter, (2,) [N].
    moment : Array
        Moment about e1 and e2 through the reference point of the indenter, (2,) [N m].
    torque : float
        Moment about the axis of the indenter [N m].
    scalars : dict of str to float
        Integrals of the outward fluxes and largest absolute potentials of the body, by name.
    dissipated_energy : float
        Work of friction in the increment [J].
    worn_volume : float
        Volume that both surfaces together have lost to wear since the beginning [m^3].
    contact_area, stick_area, slip_area : float
        Sums over the elements of their area times the fraction of their nodes in contact, in stick or in slip
        [m^2].
    max_pressure, max_tension : float
        Largest compressive and tensile normal traction, >= 0 [Pa].
    """

    force: Array
    normal_force: float
    tangential_force: Array
    moment: Array
    torque: float
    scalars: Mapping[str, float]
    dissipated_energy: float
    worn_volume: float
    contact_area: float
    stick_area: float
    slip_area: float
    max_pressure: float
    max_tension: float

    def __getattr__(self, name: str) -> float:
        return named_scalar(self, name)


def resultants(zone: Zone, step: StepResult) -> Resultants:
    """Return the resultants and maxima over the contact zone.

    Areas are summed over elements, because the weights of nodes are not areas: those of the corners of quad8 are
    negative, those of tri6 zero. Nodes at a resolved contact edge count with their area fraction. That of open
    nodes is divided between stick and slip as that of the others there is.

    Parameters
    ----------
    zone : Zone
        Nodes of the contact zone.
    step : StepResult
        An increment.

    Returns
    -------
    Resultants
        Forces, moments, total fluxes, areas and maxima.
    """
    return _resultants(step, zone)


@memoize_by_identity
def _resultants(step: StepResult, zone: Zone) -> Resultants:
    normal = step.traction[:, 2]
    scalars, potentials = step.fields.scalars, [largest(potential) for potential in step.potentials.T]
    total, products = np.zeros(3), np.zeros((3, 3))
    for first in range(0, len(normal), _BLOCK):  # blocks of nodes take little memory
        nodes = slice(first, first + _BLOCK)
        # one memory layout, on which last digits depend, whether the step is solved or read
        traction, points = np.ascontiguousarray(step.traction[nodes]), np.ascontiguousarray(zone.points[nodes])
        forces = zone.weights[nodes, None] * global_components(zone.frames[nodes], traction)
        total += forces.sum(axis=0)
        products += (points - step.loading.reference).T @ forces
    # products of all components: the moment is their antisymmetric part
    moment = np.array(
        [products[1, 2] - products[2, 1], products[2, 0] - products[0, 2], products[0, 1] - products[1, 0]]
    )
    # no -0.0
    force, about = (step.loading.axes @ each + 0.0 for each in (total, moment))
    totals = [float(zone.weights @ np.ascontiguousarray(flux) + 0.0) for flux in step.fluxes.T]
    return Resultants(
        force=total,
        normal_force=float(0.0 - force[2]),
        tangential_force=force[:2],
        moment=about[:2],
        torque=float(about[2]),
        scalars={scalar.resultant: total for scalar, total in zip(scalars, totals, strict=True)}
        | {f"max_abs_{scalar.value_name}": value for scalar, value in zip(scalars, potentials, strict=True)},
        dissipated_energy=float(zone.weights @ step.dissipation),
        worn_volume=float(zone.weights @ step.wear),
        contact_area=_area(zone, step, step.touching),
        stick_area=_area(zone, step, step.region == Region.STICK),
        slip_area=_area(zone, step, step.region == Region.SLIP),
        max_pressure=float(np.maximum(-normal.min(), 0.0) + 0.0),
        max_tension=float(np.maximum(normal.max(), 0.0) + 0.0),
    )


def _area(zone: Zone, step: StepResult, chosen: NDArray[np.bool_]) -> float:
    areas = _areas(zone)
    if step.area_fraction is None:
        return float(areas.sum(where=chosen))
    covered, at_edge = areas * step.area_fraction, step.area_fraction < 1.0
    touching, still_open = (covered[at_edge & nodes].sum() for nodes in (step.touching, ~step.touching))
    share = covered[at_edge & chosen].sum() / touching if touching > 0.0 else 0.0
    return float(covered[chosen].sum() + share * still_open)


@memoize_by_identity
def _areas(zone: Zone) -> Array:
    """Return the areas of the elements, distributed evenly over their nodes, (n,) [m^2]."""
    # rectangles share their areas evenly
    # nodes alone for test systems and plugins, and for a periodic surface, whose elements lack the last row and column
    if (
        not zone.cells
        or isinstance(zone.cells, GridCells)
        or np.ptp(zone.weights) <= _WEIGHT_ROUND_OFF * np.max(zone.weights)
    ):
        return zone.weights
    areas = np.zeros(len(zone.points))
    for (_, nodes), outline in zip(zone.cells, corners(zone.cells), strict=True):
        element_areas = np.linalg.norm(vector_areas(zone.points[outline]), axis=1)
        shares = np.repeat(element_areas / nodes.shape[1], nodes.shape[1])
        areas += np.bincount(nodes.ravel(), shares, len(areas))
    # straight sides miss a little of curved elements: all of them together have the area of the zone
    areas *= zone.weights.sum() / areas.sum()
    return areas
