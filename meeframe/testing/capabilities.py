"""Conformance of the capabilities of a reduced system with its `apply`; see check_formulation."""

from itertools import product
from typing import Final

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from meeframe.fields import MECHANICAL, N_MECHANICAL, TANGENTIAL, Array, Indices
from meeframe.material.half_space import surface_compliance
from meeframe.mesh.regular import global_components
from meeframe.system.capabilities import (
    ApproximateInverse,
    Coarsening,
    EdgeResolution,
    FieldwiseApply,
    IndenterEdge,
    InteriorFields,
    LatticeStencil,
    MaterialFlow,
    Multigrid,
    Restriction,
    Subsystem,
    ZoneRecovery,
    apply_fields,
)
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.requirements import require
from meeframe.testing.zone_loads import ROUND_OFF, smooth_loads, typical_load, worst

MIN_COSINE: Final = 0.5
"""Smallest cosine between a load inside the zone and the approximate inverse of its displacement."""
INTERIOR: Final = 0.4
"""Fraction of the half widths of the zone within which approximate inverses are tested."""
SERIES_RATIO: Final = 3.0
"""Resistances to the fluxes in series with the compliance, in units of the response of a node to its own load."""
RADII: Final = (1, 4)
"""Radii of tested stencils, in places."""
SINGLE_PRECISION: Final = 1e-4
"""Largest relative error of operations in single precision."""
BOUNDS: Final = {"float64": ROUND_OFF, "float32": 1e-5}
"""Largest relative errors of displacements, by the precision of the load."""
RECTANGLES: Final = ((-0.2, 0.2), (-0.3, 0.5), (-1.0, -0.7), (-0.1, 0.1))
"""Tested parts of the zone, in half widths along both axes; one of them is at a corner."""
CANCELLATION_RATIO: Final = 0.1
"""Displacements below this fraction of a typical one may be sums that cancel, as couplings of two similar bodies."""
CONTACT: Final = 0.6
"""Half axes of the elliptic contact with which edge corrections are tested, in half widths of the zone."""
AREA_ERROR: Final = 0.1
"""Largest relative error of the area in contact from area fractions; half a spacing at the edge is more."""
RESULTANT_ERROR: Final = 0.01
"""Largest relative error of the resultant of a circular punch with an edge correction."""
COARSE_ERROR: Final = 0.2
"""Largest difference of responses to a smooth load on a coarser division, relative to the largest displacement."""
INTERIOR_STEP: Final = 1e-3
"""Step of the differences of interior values, in widths of the zone."""
DEPTHS: Final = (0.15, 0.3)
"""Depths [widths of the zone] from which interior values are extrapolated to the surface."""
SURFACE_ERROR: Final = 0.1
"""Largest relative error of the extrapolated values."""
INTERIOR_ERROR: Final = 0.2
"""Largest relative error of differences of interior values; gradients of finite elements jump between elements."""


def check_capabilities(system: ReducedSystem) -> None:
    """Check every capability that a reduced system has against its `apply`.

    Raises
    ------
    AssertionError
        With the property that fails.
    """
    check_fieldwise_apply(system)
    check_approximate_inverse(system)
    check_prolongation(system)
    check_stencil(system)
    check_restriction(system)
    check_edge_correction(system)
    check_interior_fields(system)
    check_zone_recovery(system)
    multigrid = system.capability(Multigrid)
    if multigrid is not None:
        check_coarsening(system, multigrid.coarsen())


def field_choices(n_fields: int) -> tuple[tuple[int, ...], ...]:
    """Return choices of fields that solvers may ask for, in any order."""
    last, *_ = potentials = tuple(reversed(range(N_MECHANICAL, n_fields)))
    return (2,), (0, 1), (last, 1), potentials, (0, 1, 2), tuple(range(n_fields))


def loaded_choices(n_fields: int) -> tuple[tuple[int, ...], ...]:
    """Return choices of fields that may be loaded alone, in any order."""
    last, *_ = potentials = tuple(reversed(range(N_MECHANICAL, n_fields)))
    return (2,), (0, 1, 2), potentials, (2, 0), (last,), tuple(range(n_fields))


def check_fieldwise_apply(system: ReducedSystem) -> None:
    """Check that `apply_fields` is `apply` of a load in some fields, and `diagonal` that of `diagonal_blocks`."""
    fieldwise = system.capability(FieldwiseApply)
    if fieldwise is None:
        return
    unit = typical_load(system)
    load = np.random.default_rng(3).normal(size=system.offset.shape) * unit
    for loaded in loaded_choices(system.n_fields):
        alone, block = np.zeros_like(load), load[:, list(loaded)]
        alone[:, list(loaded)] = block
        displacement = system.apply(alone)
        # of each field; displacements that cancel are compared with a typical one
        largest = np.maximum(np.abs(displacement).max(axis=0), CANCELLATION_RATIO / unit)
        for fields, (precision, bound) in product(field_choices(system.n_fields), BOUNDS.items()):
            argument = block.astype(precision)
            copy = argument.copy()
            result = fieldwise.apply_fields(argument, loaded, fields)
            what, expected = f"apply_fields of loads {precision} in fields {loaded}", displacement[:, list(fields)]
            require(result.shape == expected.shape, f"{what} in fields {fields} is not (n, k)", result.shape)
            require(np.array_equal(argument, copy), "apply_fields changes its argument", len(load))
            error = float((np.abs(result - expected).max(axis=0) / largest[list(fields)]).max())
            require(error < bound, f"{what} is not apply in fields {fields}: solvers would fail", error)
    blocks = system.diagonal_blocks()
    for fields in field_choices(system.n_fields):
        expected = blocks[:, list(fields), list(fields)]
        result = fieldwise.diagonal(fields)
        fits = result.shape == expected.shape and worst(result, expected) < ROUND_OFF
        require(fits, f"diagonal in fields {fields} is not that of diagonal_blocks", result.shape)


def check_approximate_inverse(system: ReducedSystem) -> None:
    """Check that `approximate_inverse` is linear and approximately recovers loads inside the zone.

    So does `series_inverse`, with resistances to the fluxes, and `inverse_with_friction`, with those of nodes.
    """
    approximate, flow = system.capability(ApproximateInverse), system.capability(MaterialFlow)
    if flow is not None:
        distinct = np.array_equal(np.sort(flow.flow_lines, axis=None), np.arange(len(system.points)))
        require(distinct, "flow_lines do not have each node once: slips would add up wrongly", flow.flow_lines.shape)
    if approximate is None:
        return
    inside = np.asarray((np.abs(_normalized_positions(system)) < INTERIOR).all(axis=1))
    loads = np.random.default_rng(4).normal(size=(2, *system.offset.shape)) * typical_load(system) * inside[:, None]
    resistances = SERIES_RATIO * np.diagonal(system.diagonal_blocks().mean(axis=0))
    resistance = resistances[0] * np.random.default_rng(5).integers(0, 2, len(system.points))
    for fields in field_choices(system.n_fields):
        chosen = list(fields)
        alone = np.zeros_like(loads)
        alone[:, :, chosen] = loads[:, :, chosen]
        displacements = np.array([system.apply(load)[:, chosen] for load in alone])
        series = np.where(np.array(chosen) < N_MECHANICAL, 0.0, resistances[chosen])
        causes, unit = alone[:, :, chosen], typical_load(system)[chosen]
        friction = np.outer(resistance, np.isin(chosen, TANGENTIAL)) * causes
        by_friction = None if flow is None else flow.inverse_with_friction(fields, resistance)
        for name, inverse, sums in (
            ("approximate_inverse", approximate.approximate_inverse(fields), displacements),
            ("series_inverse", approximate.series_inverse(fields, series), displacements + series * causes),
            ("inverse_with_friction", by_friction, displacements + friction),
        ):
            if inverse is None:
                continue
            what, copy = f"{name} in fields {fields}", sums.copy()
            result = np.array([inverse(each) for each in sums])
            fits = result.shape == sums.shape and bool(np.isfinite(result).all())
            require(fits, f"{what} gives no finite loads (n, k)", result.shape)
            require(np.array_equal(sums, copy), f"{what} changes its argument", len(sums))
            error = worst(inverse(2.0 * sums[0] - 3.0 * sums[1]), 2.0 * result[0] - 3.0 * result[1])
            require(error < SINGLE_PRECISION, f"{what} is not linear: Krylov iterations would fail", error)
            pairs = zip(result[:, inside] / unit, causes[:, inside] / unit, strict=True)
            cosine = min(
                float((one * other).sum() / np.sqrt((one**2).sum() * (other**2).sum())) for one, other in pairs
            )
            require(cosine > MIN_COSINE, f"{what} does not return the loads that cause the displacement", cosine)


def check_stencil(system: ReducedSystem) -> None:
    """Check that `stencil` is `apply` of unit loads inside the lattice, each of whose places has one node."""
    capability = system.capability(LatticeStencil)
    if capability is None:
        return
    for radius in RADII:
        stencil = capability.stencil(radius)
        if stencil is None:
            continue
        lattice, size = stencil.lattice, np.array(stencil.lattice.shape)
        fits = np.array_equal(np.sort(lattice, axis=None), np.arange(len(system.points))) and (size > 2 * radius).all()
        require(bool(fits), "the lattice of a stencil has not each node once, or is too small for it", lattice.shape)
        offsets = np.indices((2 * radius + 1, 2 * radius + 1)).reshape(2, -1).T - radius
        unit = typical_load(system)
        # a node on the border may have a smaller share of the load
        places = [np.array([radius, radius]), size // 2, size - 1 - radius]
        for place in places + [np.array([0, 0])] * stencil.periodic:
            i, j = ((place + offsets) % size).T
            for field in range(system.n_fields):
                load = np.zeros_like(system.offset)
                load[lattice[tuple(place)], field] = unit[field]
                expected = system.apply(load)[lattice[i, j]]
                result = unit[field] * stencil.responses.reshape(len(offsets), system.n_fields, -1)[:, :, field]
                error = worst(result * unit, expected * unit)
                what = f"stencil of loads in field {field} at {tuple(place.tolist())}"
                require(error < SINGLE_PRECISION, f"{what} is not apply", error)


def check_coarsening(system: ReducedSystem, coarse: Coarsening) -> None:
    """Check that a coarser system has nodes of the finer one, the same offset and area, and a similar response."""
    nodes, there = coarse.nodes, coarse.system
    distinct = len(np.unique(nodes)) == len(nodes) == len(there.points) < len(system.points)
    require(distinct, "nodes of a coarser system are not distinct nodes of the finer system", len(nodes))
    for name in ("points", "frames", "offset"):
        here, expected = (
            array.reshape(len(nodes), -1) for array in (getattr(there, name), getattr(system, name)[nodes])
        )
        error = worst(here, expected)
        require(error < ROUND_OFF, f"{name} of a coarser system are not those of its nodes", error)
    load = smooth_loads(there)[0] * _fading(there)[:, None]
    fine = coarse.prolong(load)
    require(fine.shape == system.offset.shape, "prolong gives no loads (n, fields)", fine.shape)
    error = worst(fine[nodes], load)
    require(error < ROUND_OFF, "prolong changes values at the common nodes", error)
    size = system.weights @ np.abs(fine)
    error = float((np.abs(system.weights @ fine - there.weights @ load) / size).max())
    require(error < COARSE_ERROR, "weights of a coarser system give other resultants", error)
    flow, compared = there.capability(MaterialFlow), np.ones(len(nodes), bool)
    if flow is not None:
        compared[flow.flow_lines[0]] = False  # displacements before the material enters are unknown
    error = worst(there.apply(load)[compared], system.apply(fine)[nodes][compared])
    require(error < COARSE_ERROR, "a coarser system responds differently: it would give poor initial states", error)


def check_prolongation(system: ReducedSystem) -> None:
    """Check that `prolong` is linear, preserves values and precision, and that `restrict` is its adjoint."""
    approximate = system.capability(ApproximateInverse)
    if approximate is None:
        return
    rng, count, weights = np.random.default_rng(6), len(system.points), system.weights / system.weights.max()
    some = rng.permutation(count)[: count // 3 + 1]
    for nodes in (np.arange(0, count, 3), np.arange(count), some, np.array([count // 2]), np.arange(0)):
        prolongation = approximate.prolongation(nodes)
        if prolongation is None:
            continue
        values, other = rng.normal(size=(2, len(nodes))).astype(np.float32)
        test: Array = rng.normal(size=count).astype(np.float32)
        copies = values.copy(), test.copy()
        prolonged, restricted = prolongation.prolong(values), prolongation.restrict(test)
        unchanged = np.array_equal(values, copies[0]) and np.array_equal(test, copies[1])
        require(unchanged, "a prolongation changes its argument", len(nodes))
        fits = prolonged.shape == (count,) and restricted.shape == (len(nodes),)
        require(fits, "a prolongation returns values of the wrong shape", (prolonged.shape, restricted.shape))
        is_single = prolonged.dtype == restricted.dtype == np.float32
        require(is_single, "a prolongation changes the precision, so that solvers slow down", prolonged.dtype)
        if not len(nodes):
            require(not prolonged.any(), "a prolongation from no nodes is not zero", len(nodes))
            continue
        error = worst(prolonged[nodes], values)
        require(error < SINGLE_PRECISION, "a prolongation changes the values at its nodes", error)
        both = prolongation.prolong(2.0 * values - 3.0 * other)
        error = worst(both, 2.0 * prolonged - 3.0 * prolongation.prolong(other))
        require(error < SINGLE_PRECISION, "a prolongation is not linear: Krylov iterations would fail", error)
        work = float((weights * prolonged) @ test), float((weights[nodes] * values) @ restricted)
        error = abs(work[0] - work[1]) / float((weights * np.abs(prolonged)) @ np.abs(test))
        require(error < SINGLE_PRECISION, "restrict of a prolongation is not the adjoint of prolong", error)


def check_restriction(system: ReducedSystem) -> None:
    """Check that parts of the zone contain the requested nodes and respond to loads there as the whole zone does."""
    restriction = system.capability(Restriction)
    if restriction is None:
        return
    nodes, positions = np.arange(len(system.points)), _normalized_positions(system)
    single = [nodes[np.abs(positions - (x, y)).sum(axis=1).argmin()][None] for x in (-1, 0, 1) for y in (-1, 0, 1)]
    for requested in (
        *(nodes[((positions >= low) & (positions <= high)).all(axis=1)] for low, high in RECTANGLES),
        *single,
    ):
        subsystem = restriction.restrict(requested)
        if subsystem is not None:
            check_subsystem(system, subsystem, requested)
    require(restriction.restrict(nodes[:0]) is None, "restrict returns a subsystem for no nodes", 0)


def check_subsystem(system: ReducedSystem, subsystem: Subsystem, requested: Indices) -> None:
    """Check that a part contains the requested nodes (k,), with their data, and responds as the whole zone does."""
    nodes, there = subsystem.nodes, subsystem.system
    distinct = len(np.unique(nodes)) == len(nodes) == len(there.points) < len(system.points)
    require(distinct, "nodes of a subsystem are not distinct nodes of the system", len(nodes))
    require(bool(np.isin(requested, nodes).all()), "a subsystem lacks some of the requested nodes", len(nodes))
    for name in ("points", "frames", "offset", "weights"):
        same = np.array_equal(getattr(there, name), getattr(system, name)[nodes])
        require(same, f"{name} of a subsystem are not those of its nodes", len(nodes))
    load = np.zeros_like(system.offset)
    load[nodes] = np.random.default_rng(5).normal(size=(len(nodes), load.shape[1])) * typical_load(system)
    error = worst(there.apply(load[nodes]), system.apply(load)[nodes])
    require(
        error < ROUND_OFF, "a subsystem responds differently from the system: another problem would be solved", error
    )
    blocks, expected = there.diagonal_blocks(), system.diagonal_blocks()[nodes]
    error = worst(blocks.reshape(len(nodes), -1), expected.reshape(len(nodes), -1))
    require(error < ROUND_OFF, "diagonal_blocks of a subsystem are not those of its nodes", error)
    check_fieldwise_apply(there)


def check_edge_correction(system: ReducedSystem) -> None:
    """Check shapes, area fractions and dissipativity of edge corrections, with and without an indenter's edge."""
    resolution = system.capability(EdgeResolution)
    if resolution is None:
        return
    positions = _normalized_positions(system)
    r = np.linalg.norm(positions, axis=1) / CONTACT
    pressure = np.sqrt(np.maximum(1.0 - r**2, 0.0)) * typical_load(system)[2]
    n, n_fields = system.offset.shape
    far = IndenterEdge(np.full(n, np.inf), np.zeros((n, 2)), np.full(n, np.inf))
    radius, punch_edge, punch_pressure = _circular_punch(system)
    ellipse = np.pi * np.prod(CONTACT * _half_widths(system))
    alone, unchanged, punch = (
        resolution.edge_correction(load, edge)
        for load, edge in ((pressure, None), (pressure, far), (punch_pressure, punch_edge))
    )
    same = np.array_equal(alone.extra_compliance, unchanged.extra_compliance)
    require(same, "an indenter's edge far away changes the correction", n)
    for result, load, area in ((alone, pressure, ellipse), (punch, punch_pressure, np.pi * radius**2)):
        extra, fraction = result.extra_compliance, result.area_fraction
        fits = extra.shape == (n, n_fields, n_fields) and fraction.shape == (n,) and bool(np.isfinite(extra).all())
        require(fits, "edge_correction gives no finite arrays (n, fields, fields) and (n,)", extra.shape)
        require(bool(((fraction >= 0.0) & (fraction <= 1.0)).all()), "an area fraction is not in [0, 1]", fraction)
        inside = load > 0.5 * load.max()
        require(bool((fraction[inside] > 0.0).all()), "a node under pressure has no area in contact", fraction)
        error = float(abs(system.weights @ fraction / area - 1.0))
        require(error < AREA_ERROR, "area fractions do not add up to the area inside the contact edge", error)
        require(bool(extra.any()), "no node responds more to its load at the contact edge", n)
        unit = typical_load(system)
        scaled = unit[:, None] * extra * unit
        lowest = float(np.linalg.eigvalsh(scaled + scaled.transpose(0, 2, 1)).min())
        require(lowest >= -ROUND_OFF * np.abs(scaled).max(), "extra compliance gains energy from a load", lowest)


def check_edge_resultants(system: ReducedSystem, stiffness: Array) -> None:
    """Check an edge correction against the resultants of circular punches on a half space, in one field at a time.

    The compliance of `apply`, corrected at the edge of a circle, gives the load of a unit displacement of that circle.
    Its resultant is 4 R / Y in closed form, with R the radius and Y the mean surface compliance of the field over all
    directions (the density 1 / sqrt(R^2 - r^2) displaces the circle uniformly).

    Parameters
    ----------
    system : ReducedSystem
        System of a homogeneous half space with a plane zone.
    stiffness : Array
        Extended stiffness of the half space, (3, fields, fields, 3), SI units.

    Raises
    ------
    AssertionError
        If a resultant differs by more than RESULTANT_ERROR.
    """
    resolution = system.capability(EdgeResolution)
    if resolution is None:
        return
    radius, edge, pressure = _circular_punch(system)
    correction = resolution.edge_correction(pressure, edge)
    nodes = np.flatnonzero(correction.area_fraction > 0.0)
    frame, n_fields = system.frames[0], system.n_fields
    angles = np.linspace(0.0, np.pi, 64, endpoint=False)
    directions = np.outer(np.cos(angles), frame[0]) + np.outer(np.sin(angles), frame[1])
    to_local = np.eye(n_fields)
    to_local[MECHANICAL, MECHANICAL] = frame
    compliance = (to_local @ surface_compliance(stiffness, frame[2], directions) @ to_local.T).real.mean(axis=0)
    for field in range(n_fields):
        matrix = np.diag(correction.extra_compliance[nodes, field, field])
        for column, node in enumerate(nodes):
            load = np.zeros((len(system.points), 1))
            load[node] = 1.0
            matrix[:, column] += apply_fields(system, load, (field,), (field,))[nodes, 0]
        resultant = float(system.weights[nodes] @ np.linalg.solve(matrix, np.ones(len(nodes))))
        error = abs(resultant * abs(compliance[field, field]) / (4.0 * radius) - 1.0)
        require(error < RESULTANT_ERROR, f"edge correction: the resultant of a circular punch in field {field}", error)


def _circular_punch(system: ReducedSystem) -> tuple[float, IndenterEdge, Array]:
    """Return the radius [m] of a circular punch at the centre of the zone, its edge and its pressure (n,) [Pa]."""
    positions = _normalized_positions(system) * _half_widths(system)
    radius, r = float(CONTACT * _half_widths(system).min()), np.linalg.norm(positions, axis=1)
    outward = np.divide(positions, r[:, None], out=np.zeros_like(positions), where=r[:, None] > 0.0)
    density = 1.0 / np.sqrt(np.maximum(1.0 - (r / radius) ** 2, 1e-3))
    pressure = np.where(r < radius, density, 0.0) * typical_load(system)[2]
    local = np.einsum("nai,ni->na", system.frames[:, :2, :2], outward)
    return radius, IndenterEdge(radius - r, local, np.where(r < radius, np.inf, 0.0)), pressure


def check_zone_recovery(system: ReducedSystem) -> None:
    """Check that `recover` returns displacement and load of the zone, in global axes, if it claims to."""
    if system.capability(ZoneRecovery) is None:
        return
    load = np.random.default_rng(5).normal(size=system.offset.shape) * typical_load(system)
    displacement, recovered = system.offset + system.apply(load), system.recover(load)
    displacement[:, N_MECHANICAL:] *= -1.0
    require(np.array_equal(recovered.points, system.points), "recover has other points than the zone", len(load))
    for what, values, local in (("values", recovered.values, displacement), ("fluxes", recovered.fluxes, load)):
        expected = local.copy()
        expected[:, MECHANICAL] = global_components(system.frames, local[:, MECHANICAL])
        error = float((np.abs(values - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())
        require(error < ROUND_OFF, f"{what} of recover are not those of the zone", error)


def check_interior_fields(system: ReducedSystem) -> None:
    """Check that fields inside the body are affine in the load, and that gradients are those of the values."""
    interior = system.capability(InteriorFields)
    if interior is None:
        return
    middle = int(np.linalg.norm(_normalized_positions(system), axis=1).argmin())
    width = float(np.ptp(system.points, axis=0).max())
    inwards = system.frames[middle].T @ np.array([0.037, -0.053, -0.3])
    point, step = system.points[middle] + width * inwards, INTERIOR_STEP * width
    points = point + step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    load = smooth_loads(system)[0]
    argument = load.copy()
    once = interior.evaluate(load, points)
    none, twice = (interior.evaluate(factor * load, points[:1]) for factor in (0.0, 2.0))
    require(np.array_equal(load, argument), "evaluate changes its load", len(load))
    n_points, n_fields = len(points), system.n_fields
    shapes = once.values.shape, once.gradients.shape, once.fluxes.shape
    fits = shapes == ((n_points, n_fields), (n_points, n_fields, 3), (n_points, 3, n_fields))
    require(fits, "evaluate gives no values (m, fields), gradients (m, fields, 3), fluxes (m, 3, fields)", shapes)
    unit = typical_load(system)
    for name, scale in (("values", unit), ("gradients", unit[:, None]), ("fluxes", 1.0 / unit)):
        first, second = ((getattr(each, name)[:1] - getattr(none, name)) * scale for each in (once, twice))
        error = float(np.abs(second - 2.0 * first).max() / np.abs(first).max())
        require(error < SINGLE_PRECISION, f"{name} inside the body are not affine in the load", error)
    slopes = (once.values[1:4] - once.values[4:]).T / (2.0 * step)
    scaled, expected = slopes * unit[:, None], once.gradients[0] * unit[:, None]
    error = float(np.abs(scaled - expected).max() / np.abs(expected).max())
    require(error < INTERIOR_ERROR, "gradients inside the body are not the derivatives of the values", error)
    error = _surface_error(system, interior, load, middle)
    require(error < SURFACE_ERROR, "values inside the body do not tend to those of recover at its surface", error)


def _surface_error(system: ReducedSystem, interior: InteriorFields, load: Array, node: int) -> float:
    """Return the relative error of the values at a node by cubic extrapolation from DEPTHS below it."""
    normal = system.frames[node, 2]
    depths = float(np.ptp(system.points, axis=0).max()) * np.array(DEPTHS)
    inside = interior.evaluate(load, system.points[node] - depths[:, None] * normal)
    slopes = -np.einsum("mfi,i->mf", inside.gradients, normal)
    extrapolated = CubicHermiteSpline(depths, inside.values, slopes)(0.0)
    surface = system.recover(load)  # of the first of two bodies, as the interior fields
    expected = surface.values[np.linalg.norm(surface.points - system.points[node], axis=1).argmin()]
    unit = typical_load(system)
    return float(np.abs((extrapolated - expected) * unit).max() / np.abs(expected * unit).max())


def _fading(system: ReducedSystem) -> Array:
    """Return a function (n,) that is one in the middle of the zone and zero at its border."""
    shape: Array = (1.0 - _normalized_positions(system) ** 2).prod(axis=1)
    return shape


def _normalized_positions(system: ReducedSystem) -> Array:
    """Return positions of the nodes along the first two axes, (n, 2), from -1 to 1."""
    low, high = system.points.min(axis=0), system.points.max(axis=0)
    positions: Array = (2.0 * system.points - low - high)[:, :2] / (high - low)[:2]
    return positions


def _half_widths(system: ReducedSystem) -> Array:
    """Return the half widths of the zone along the first two axes, (2,) [m]."""
    widths: Array = np.ptp(system.points, axis=0)[:2] / 2.0
    return widths
