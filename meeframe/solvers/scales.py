"""Characteristic magnitudes of a contact problem: what its residual is measured in."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meeframe.core.contact import ContactProblem
from meeframe.core.fields import ELECTRIC, MAGNETIC, N_FIELDS, Array

POTENTIALS = (ELECTRIC, MAGNETIC)


@dataclass(frozen=True, eq=False)
class Scales:
    """Characteristic magnitudes, from the data of the problem alone and homogeneous in units, moduli and lengths.

    compliance: (5, 5) largest displacement of field J under a uniform unit load of field K over the nodes that the
    indenter overlaps; displacement, load: (5,) expected magnitudes, positive.
    """

    compliance: Array
    displacement: Array
    load: Array

    @property
    def normal_compliance(self) -> float:
        """Normal displacement under uniform unit pressure [m/Pa]: a bound of the largest eigenvalue."""
        return float(self.compliance[2, 2])

    @property
    def pressure(self) -> float:
        """Characteristic contact pressure [Pa]."""
        return float(self.load[2])


def problem_scales(problem: ContactProblem) -> Scales:
    """Scales of a problem: five applications of the compliance.

    The overlap of the indenter with the unloaded surface sets the displacements; prescribed potentials set the others,
    and the pressures they cause, where a law conducts under pressure.
    """
    overlap = problem.system.offset[:, 2] - problem.gap
    depth = _depth(overlap)
    compliance = _uniform_response(problem, overlap > 0.0 if (overlap > 0.0).any() else np.isfinite(overlap))
    pressure = depth / compliance[2, 2]
    potential = np.abs(problem.system.offset[:, 3:] + problem.potentials).max(axis=0, initial=0.0)
    laws = (problem.electric_law, problem.magnetic_law)
    conducts = [law.conductivity(np.array([-pressure]))[0] > 0.0 for law in laws]
    flux = np.where(conducts, potential / compliance[POTENTIALS, POTENTIALS], 0.0)
    pressure = max(pressure, *(compliance[2, 3:] * flux / compliance[2, 2]))
    load = np.array([pressure, pressure, pressure, 0.0, 0.0])
    induced = compliance[3:, 2] * pressure
    load[3:] = np.maximum(flux, induced / compliance[POTENTIALS, POTENTIALS])
    displacement = np.abs(problem.system.offset).max(axis=0, initial=0.0)
    displacement = np.maximum(displacement, compliance @ load)
    displacement[:2] = np.maximum(displacement[:2], np.abs(problem.translation).max(axis=0, initial=0.0))
    displacement[3:] = np.maximum(displacement[3:], potential)
    return Scales(compliance, _positive(displacement), _positive(load))


def _depth(overlap: Array) -> float:
    """Deepest overlap, or failing that the largest distance, or failing that one: then every state is exactly zero."""
    finite = overlap[np.isfinite(overlap)]
    return float(finite.max(initial=0.0)) or float(np.abs(finite).max(initial=0.0)) or 1.0


def _uniform_response(problem: ContactProblem, loaded: NDArray[np.bool_]) -> Array:
    compliance = np.empty((N_FIELDS, N_FIELDS))
    for field in range(N_FIELDS):
        load = np.zeros_like(problem.system.offset)
        load[loaded, field] = 1.0
        compliance[:, field] = np.abs(problem.system.apply(load)).max(axis=0, initial=0.0)
    return compliance


def _positive(magnitudes: Array) -> Array:
    """Magnitudes with ones for zeros: a quantity without a scale is exactly zero."""
    return np.where(magnitudes > 0.0, magnitudes, 1.0)
