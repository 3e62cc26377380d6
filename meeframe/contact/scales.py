"""Characteristic magnitudes of a contact problem, the units of its residual."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.free_motion import balanced_projection, motions
from meeframe.contact.generated_heat import thermal_channel
from meeframe.contact.nested import Coarse, coarse_problem, has_similar_area, is_similar, is_uniform
from meeframe.contact.problem import ContactProblem, PrescribedResultant, indenter_field, indenter_position
from meeframe.fields import ELECTRIC, MECHANICAL, N_MECHANICAL, NORMAL, POTENTIALS, Array
from meeframe.laws.base import attraction, resolve
from meeframe.system.capabilities import Multigrid, apply_load
from meeframe.system.reduced import ReducedSystem

Mask = NDArray[np.bool_]

MIN_DEPTH_RATIO: Final = 4e-5
"""Least depth as a fraction of the free indenter's way to the body; round-off of the gap limits smaller depths."""
MAX_REPRESENTATIVE_NODES: Final = 5_000
"""Number of nodes that suffice to estimate the magnitude of a compliance."""
_LEAST_POTENTIAL: Final = 1e-20
"""Least unit of a potential, as a fraction of the one whose energy equals that of the pressure."""
_LEAST_DROP: Final = 1e-4
"""Least unit of a drop, as a fraction of the expected one: states may converge to one without potentials."""
_SLIDING: Final = 1e6
"""Trial tangential traction, in pressures, under which any surface slides."""
MAX_FOUNDATION_STEPS: Final = 3
"""Number of estimates of the free indenter's motion, each with the compliance of the previous contact area."""


@dataclass(frozen=True, eq=False)
class Scales:
    """Characteristic magnitudes, computed from the problem's data, homogeneous in units, moduli and lengths.

    Attributes
    ----------
    compliance : Array
        (fields, fields), largest displacement of field J under a uniform unit load of field K over the nodes that the
        indenter overlaps.
    displacement : Array
        (fields,), expected magnitudes of the displacement and the potentials, positive.
    load : Array
        (fields,), expected magnitudes of the tractions and flux densities, positive.
    totals : Array
        (m,), expected magnitudes of the prescribed resultants, positive.
    drop : Array
        (channels,), expected magnitudes of the part of the potentials that the conductance of the contact transmits,
        positive: all of it for a perfect conductor, little for a poor one.
    """

    compliance: Array
    displacement: Array
    load: Array
    totals: Array
    drop: Array

    @property
    def normal_compliance(self) -> float:
        """Normal displacement under uniform unit pressure [m/Pa], a bound of the largest eigenvalue."""
        return float(self.compliance[NORMAL, NORMAL])

    @property
    def pressure(self) -> float:
        """Characteristic contact pressure [Pa]."""
        return float(self.load[2])

    def transmitted_drop(self, share: Array, load: Array, flux: Array, potential: Array) -> Array:
        """Return the unit (channels,) in which violations of the flux laws by a state count.

        It is the drop that the contact is expected to transmit, or less if the state transmits less: its fluxes then
        count in units of the largest of them, its drops in units of its potentials, or of those that its tractions
        alone would cause in any direction: other loads, or a second body, may cancel them.

        Parameters
        ----------
        share : Array
            (n, channels), share of a drop that each node transmits in series with the body.
        load : Array
            (n, fields), tractions and flux densities.
        flux : Array
            (n, channels), conducted flux densities.
        potential : Array
            (channels,), largest magnitudes of the potentials of body and indenter.

        Returns
        -------
        Array
            Positive potentials.
        """
        compliance = np.diag(self.compliance)[POTENTIALS]
        caused = largest(load[:, MECHANICAL]) * self.compliance[POTENTIALS, MECHANICAL].sum(axis=1)
        largest_drop = np.fmin(self.displacement[POTENTIALS], np.fmax(potential, caused))
        transmitted = np.fmax(share * largest_drop, compliance * np.abs(flux)).max(axis=0, initial=0.0)
        return np.where((share > 0.0).any(axis=0), np.clip(transmitted, _LEAST_DROP * self.drop, self.drop), self.drop)


@memoize_by_identity
def problem_scales(problem: ContactProblem) -> Scales:
    """Return the scales of a problem.

    This takes one application of the compliance per field, more if the indenter moves freely.

    The overlap of the indenter with the unloaded surface sets the displacements; where the indenter is free, they are
    those of an elastic foundation under the prescribed forces. Prescribed potentials and charges, and the pressures
    that they cause, set the others where a law conducts. Pressures are at least as large as the initial attraction. An
    interface that yields by itself is in series with the body. The compliance of large bodies is measured on a coarser
    division, where that resolves the overlap; the overlap itself is that of all nodes.
    """
    motion, offset = _foundation_motion(problem), problem.system.offset
    above = indenter_field(problem, 2, motion)
    overlap = offset[:, NORMAL] - above
    loaded = _overlapping_nodes(overlap)
    below = loaded & np.isfinite(problem.gap)
    depth = max(_overlap_depth(overlap), MIN_DEPTH_RATIO * largest(above[below] - problem.gap[below]))
    compliance = _uniform_response(problem.system, loaded)
    pressure = _pressure(problem, overlap, depth, compliance[NORMAL, NORMAL])
    prescribed_flux = _prescribed_flux(problem, loaded)
    fields, self_compliance = range(problem.fields.size)[POTENTIALS], np.diag(compliance)[POTENTIALS]
    drop = np.array([largest(offset[:, field] - indenter_field(problem, field, motion)) for field in fields])
    generated = _frictional_heat(problem, pressure, motion)
    generated += _joule_heat(problem, pressure, drop, prescribed_flux, self_compliance)
    prescribed_flux += generated
    potential = np.maximum(drop, prescribed_flux * self_compliance)
    is_conducting = np.array([channel.is_conducting for channel in problem.channels]) | (generated > 0.0)
    share = _transmitted(problem, pressure, potential, self_compliance)
    flux = np.where(is_conducting, np.maximum(prescribed_flux, share * drop / self_compliance), 0.0)
    pressure = float(np.max([pressure, *(compliance[NORMAL, POTENTIALS] * flux / compliance[NORMAL, NORMAL])]))
    induced = compliance[POTENTIALS, NORMAL] * pressure
    load = np.array([*(pressure,) * N_MECHANICAL, *np.maximum(flux, induced / self_compliance)])
    displacement = np.maximum([largest(column) for column in offset.T], compliance @ load)
    tangential_motion = [largest(indenter_field(problem, axis, motion)) for axis in range(2)]
    displacement[:2] = np.maximum(displacement[:2], tangential_motion)
    displacement[POTENTIALS] = np.maximum(displacement[POTENTIALS], potential)
    transmitted = np.maximum(share * displacement[POTENTIALS], prescribed_flux * self_compliance)
    # the potential of a body without charge falls to a fraction in each increment, down to what numbers can represent
    least = _LEAST_POTENTIAL * np.sqrt(pressure * depth * self_compliance)
    for magnitudes, bound in ((displacement[POTENTIALS], least), (load[POTENTIALS], least / self_compliance)):
        np.maximum(magnitudes, bound, out=magnitudes, where=magnitudes > 0.0)
    np.maximum(transmitted, share * least, out=transmitted, where=transmitted > 0.0)
    load = _positive(load)
    # prescribed totals are those of fluxes that the contact conducts, which are small through poor conductors
    conducted = np.array([*load[MECHANICAL], *_positive(transmitted / self_compliance)])
    totals = [
        max(abs(resultant.total), _resultant_scale(resultant, loaded, conducted))
        for resultant in problem.prescribed_resultants
    ]
    return Scales(
        compliance, _positive(displacement), load, _positive(np.array(totals)), _positive(np.array(transmitted))
    )


def largest_potentials(problem: ContactProblem, motion: Array, relative_displacement: Array) -> Array:
    """Return the largest magnitudes (channels,) of the potentials of body and indenter.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    motion : Array
        (m,), free motions of the indenter.
    relative_displacement : Array
        (n, fields), position of the indenter relative to the body.

    Returns
    -------
    Array
        Magnitudes, not negative.
    """
    fields = range(problem.fields.size)[POTENTIALS]
    positions = ((indenter_field(problem, k, motion), relative_displacement[:, k]) for k in fields)
    return np.array([max(largest(position), largest(position - relative)) for position, relative in positions])


def motion_scales(problem: ContactProblem, scales: Scales) -> Array:
    """Return the characteristic amounts (m,) of the free motions.

    With these amounts their modes attain the characteristic displacements.
    """
    unit_displacement = [
        max(largest(resultant.mode[:, k]) / scales.displacement[k] for k in resultant.mode_fields)
        for resultant in problem.prescribed_resultants
    ]
    return 1.0 / np.array(unit_displacement)


@memoize_by_identity
def _foundation_motion(problem: ContactProblem) -> Array:
    """Return the free motions (m,) on an elastic foundation as compliant as the body under a uniform pressure."""
    motion = np.zeros(len(problem.prescribed_resultants))
    numbers = motions(problem)
    if numbers.size == 0:
        return motion
    coarse = coarse_problem(problem) if len(problem.gap) > MAX_REPRESENTATIVE_NODES else None
    if coarse is not None:
        coarse_motion = _foundation_motion(coarse.problem)
        if _same_overlap(problem, coarse, coarse_motion):
            return coarse_motion
    loaded = _overlapping_nodes(np.where(np.isfinite(problem.gap), 0.0, -np.inf))
    for _ in range(MAX_FOUNDATION_STEPS):
        system, nodes = coarse_representative(problem.system, loaded)
        load = np.zeros_like(system.offset)
        load[nodes, NORMAL] = 1.0
        r = 1.0 / float(np.abs(apply_load(system, load, (2,))).max())
        gap = (indenter_position(problem, motion) - problem.system.offset)[:, MECHANICAL]
        motion[numbers] += balanced_projection(problem, np.zeros_like(gap), gap, (r, r)).motion
        loaded = _overlapping_nodes(_overlap(problem, motion))
    return motion


def _same_overlap(problem: ContactProblem, coarse: Coarse, motion: Array) -> bool:
    """Return whether the overlap, after a motion (m,), agrees in area and depth with that of the coarser division."""
    (area, volume), (coarse_area, coarse_volume) = (
        (float(division.system.weights @ (overlap > 0.0)), float(division.system.weights @ np.maximum(overlap, 0.0)))
        for division, overlap in ((division, _overlap(division, motion)) for division in (problem, coarse.problem))
    )
    return is_similar(area, coarse_area) and is_similar(volume, coarse_volume)


def _overlap(problem: ContactProblem, motion: Array) -> Array:
    """Return the overlap (n,) [m] of the unloaded body and the indenter after a motion (m,).

    It is -inf where there is no indenter above.
    """
    overlap: Array = problem.system.offset[:, NORMAL] - indenter_field(problem, 2, motion)
    return overlap


def _overlapping_nodes(overlap: Array) -> Mask:
    """Return the nodes (n,) that the indenter overlaps.

    All nodes below it are returned if there are none, and all nodes if it is above none.
    """
    loaded = np.asarray(overlap > 0.0 if (overlap > 0.0).any() else np.isfinite(overlap))
    return loaded if loaded.any() else np.ones_like(loaded)


def _prescribed_flux(problem: ContactProblem, loaded: Mask) -> Array:
    """Return mean flux densities (channels,) of prescribed totals over the nodes (n,) that are loaded."""
    flux = np.zeros(len(problem.channels))
    for resultant in problem.prescribed_resultants:
        if resultant.electromagnetic:
            measure = np.abs(resultant.measure[loaded, POTENTIALS]).sum(axis=0)
            flux += np.divide(abs(resultant.total), measure, out=np.zeros_like(flux), where=measure > 0.0)
    return flux


def _frictional_heat(problem: ContactProblem, pressure: float, motion: Array) -> Array:
    """Return the heat flux (channels,) that friction generates at a pressure [Pa] in the slip of the indenter."""
    generated = np.zeros(len(problem.channels))
    channel = thermal_channel(problem)
    if channel is None or not problem.friction_heat:
        return generated
    slip = float(np.linalg.norm([largest(indenter_field(problem, axis, motion)) for axis in range(2)]))
    traction = np.tile([_SLIDING * pressure, 0.0, -pressure], (len(problem.gap), 1))
    sliding = resolve(problem.contact_law, traction, np.zeros_like(traction), (1.0, 1.0))
    generated[channel] = problem.friction_heat * largest(sliding[:, 0]) * slip
    return generated


def _joule_heat(problem: ContactProblem, pressure: float, drop: Array, flux: Array, self_compliance: Array) -> Array:
    """Return the heat (channels,) that a current generates at a pressure [Pa], a drop and a prescribed flux."""
    generated = np.zeros(len(problem.channels))
    channel, electric = thermal_channel(problem), ELECTRIC - N_MECHANICAL
    if channel is None or not problem.joule_heat:
        return generated
    potential = np.maximum(drop, flux * self_compliance)
    share = _transmitted(problem, pressure, potential, self_compliance)
    current = np.maximum(flux, share * drop / self_compliance)
    generated[channel] = problem.joule_heat * ((1.0 - share) * potential * current)[electric]
    return generated


def _transmitted(problem: ContactProblem, pressure: float, potential: Array, self_compliance: Array) -> Array:
    """Return the share (channels,) in [0, 1] of a drop that the conductance in contact transmits to the body.

    It is that of a conductor of the largest conductivity under a pressure [Pa] and a drop (channels,), in series with
    the body; one where the law states none, as below a threshold, or insulates.
    """
    n, share = len(problem.gap), np.ones(len(problem.channels))
    for k, law in enumerate(channel.law for channel in problem.channels):
        # by its class: checks of values that instances record concern states alone
        kappa = type(law).conductivity(law, np.full(n, -pressure), np.zeros(n), np.full(n, potential[k]))
        highest = float(np.nan_to_num(kappa, nan=np.inf, posinf=np.inf).max(initial=0.0))
        if 0.0 < highest < np.inf:
            share[k] = 1.0 / (1.0 + 1.0 / (highest * self_compliance[k]))
    return share


def _pressure(problem: ContactProblem, overlap: Array, depth: float, compliance: float) -> float:
    """Return the pressure that body and interface bear together at a depth [m] [Pa].

    Where nothing overlaps (n,) it is the attraction alone. compliance: that of the body [m/Pa].
    """
    law = problem.contact_law
    attractive_pressure = float(attraction(law, -overlap).max(initial=0.0))
    if attractive_pressure > 0.0 and not (overlap > 0.0).any():
        return attractive_pressure
    count = 1 if is_uniform(law, len(overlap)) else len(overlap)
    gap = np.tile([0.0, 0.0, -depth], (count, 1))
    traction = resolve(law, gap / compliance, gap, (1.0 / compliance, 1.0 / compliance))
    return max(float(-traction[:, NORMAL].min(initial=0.0)), attractive_pressure) or depth / compliance


def _overlap_depth(overlap: Array) -> float:
    """Return the deepest overlap, or else the largest distance, or else one, as every state is then exactly zero."""
    finite = overlap[np.isfinite(overlap)]
    return float(finite.max(initial=0.0)) or float(np.abs(finite).max(initial=0.0)) or 1.0


def coarse_representative(system: ReducedSystem, loaded: Mask) -> tuple[ReducedSystem, Mask]:
    """Return a division coarse enough to be measured fast, with the loaded nodes (n,) that it retains.

    These represent a similar area.
    """
    while len(loaded) > MAX_REPRESENTATIVE_NODES:
        multigrid = system.capability(Multigrid)
        coarse = None if multigrid is None else multigrid.coarsen()
        if coarse is None or not has_similar_area(system, loaded, coarse):
            break
        system, loaded = coarse.system, loaded[coarse.nodes]
    return system, loaded


def _uniform_response(system: ReducedSystem, loaded: Mask) -> Array:
    system, loaded = coarse_representative(system, loaded)
    return _response_on_nodes(system, loaded.tobytes())


@memoize_by_identity
def _response_on_nodes(system: ReducedSystem, loaded_bytes: bytes) -> Array:
    """Return the largest displacements (fields, fields) under uniform unit loads.

    loaded_bytes: mask of the nodes. The result is memoized because increments under the same normal load use the same
    nodes.
    """
    loaded = np.frombuffer(loaded_bytes, bool)
    compliance = np.empty((system.n_fields, system.n_fields))
    for field in range(system.n_fields):
        load = np.zeros_like(system.offset)
        load[loaded, field] = 1.0
        compliance[:, field] = np.abs(system.apply(load)).max(axis=0, initial=0.0)
    return compliance


def _resultant_scale(resultant: PrescribedResultant, loaded: Mask, load: Array) -> float:
    """Return the sum of the magnitudes that a load (fields,) on nodes (n,) contributes to a resultant."""
    return sum(float(np.abs(resultant.measure_of(k, loaded)).sum() * load[k]) for k in resultant.density_fields)


def largest(values: Array) -> float:
    """Return the largest magnitude; nan if there is one among the values, 0 for an empty array."""
    return abs(float(np.maximum(values.max(initial=0.0), -values.min(initial=0.0))))


def _positive(magnitudes: Array) -> Array:
    """Return the magnitudes with zeros replaced by ones: a quantity without a scale is exactly zero."""
    return np.where(magnitudes > 0.0, magnitudes, 1.0)
