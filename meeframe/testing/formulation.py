"""Conformance of a formulation and its reduced system with their contract (meeframe.system.reduced)."""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from meeframe.common.errors import MeeframeError
from meeframe.elements import Quad4
from meeframe.fields import MECHANICAL, N_FIELDS, POTENTIALS, Array
from meeframe.formulations.base import Formulation, PersistentFormulation, stored_arrays
from meeframe.material import library_material, rotation_about
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.mesh import block_mesh, find_contact_zone
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.solvers import SemismoothNewton, solve
from meeframe.system.capabilities import EdgeResolution
from meeframe.system.reduced import ReducedSystem
from meeframe.system.rolling import CellShift
from meeframe.testing.capabilities import check_capabilities, check_edge_resultants
from meeframe.testing.closed_forms import Sphere, indent
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.manufactured import ExactField, LinearField, prescribe
from meeframe.testing.requirements import check_frozen, explained, require
from meeframe.testing.search import search_for
from meeframe.testing.zone_loads import ROUND_OFF, shapes, smooth_loads, typical_load, worst

_GROUPS = ("top", "side_x-", "side_x+", "side_y-", "side_y+")


def check_formulation(
    formulation: Formulation,
    body: Body | None = None,
    field: ExactField | None = None,
    tolerance: float = 1e-3,
    asymmetry: float = 0.05,
) -> None:
    """Check a formulation: form, linear fields, reciprocity, energy, recovery, capabilities and an indentation.

    Without a body and a field, a block of rotated orthotropic material under a linear field is used, and the
    indentation of a large block is compared with the closed form of a half space (`check_indentation`). Formulations
    for other bodies need both.

    Parameters
    ----------
    formulation : Formulation
        The formulation.
    body : Body, optional
        Body with a contact zone.
    field : ExactField, optional
        Exact solution of the body under the tractions that the field has on the zone.
    tolerance : float
        Largest error of the values, relative to the largest value.
    asymmetry : float
        Largest asymmetry of the work of one smooth load on the displacement of another, relative to their own
        works.

    Raises
    ------
    AssertionError
        If a property is violated.
    """
    check_frozen(formulation)
    if body is None or field is None:
        check_indentation(formulation)
        body, field = _patch()
    with explained(formulation):
        system = formulation.reduce(body)
        check_form(system, body)
        check_linear(formulation, body, system)
        check_capabilities(system)
        check_persistence(formulation, body, system)
        check_edges(formulation, system)
        check_translation(formulation, system)
        if body.mesh.semi_infinite:
            check_edge_resultants(system, body.stiffness)
        check_exact(system, field, tolerance)
        check_reciprocity(system, asymmetry)
        search_for(_loads(system.n_fields), lambda example: check_energy(system, *example), examples=60)
        check_recovery(system, body, tolerance)
        check_refusals(formulation, body)


def _loads(n_fields: int) -> st.SearchStrategy[tuple[tuple[float, ...], int]]:
    """Return a strategy that draws the fields of a load and the number of its shape."""
    amount = st.sampled_from([0.0, 1.0, -1.0]) | st.floats(-1.0, 1.0, allow_subnormal=False)
    fields = st.sampled_from([tuple(row) for row in np.eye(n_fields).tolist()]) | st.tuples(*[amount] * n_fields)
    return st.tuples(fields, st.integers(0, 4))


def check_form(system: ReducedSystem, body: Body) -> None:
    """Shapes, finite numbers; points, frames and weights of the body's contact zone."""
    zone = find_contact_zone(body.mesh, body.contact_group or "")
    n, size = len(system.points), np.ptp(zone.points, axis=0).max()
    shapes = {"points": (n, 3), "frames": (n, 3, 3), "weights": (n,), "offset": (n, body.fields.size)}
    for name, shape in shapes.items():
        array = getattr(system, name)
        require(array.shape == shape and np.isfinite(array).all(), f"{name} is not finite {shape}", array.shape)
    deviation = np.abs(system.frames @ system.frames.transpose(0, 2, 1) - np.eye(3)).max()
    orthonormal = bool(deviation < 1e-12 and (np.linalg.det(system.frames) > 0.0).all())
    require(orthonormal, "frames are not orthonormal and right-handed, so that tractions are rotated", deviation)
    nearest = np.linalg.norm(system.points[:, None] - zone.points, axis=2).argmin(axis=1)
    outward = float(np.einsum("ni,ni->n", system.frames[:, 2], zone.frames[nearest, 2]).min())
    require(outward > 0.5, "a frame's third axis is not the outward normal: pressure would pull", outward)
    low, high = system.points.min(axis=0) - zone.points.min(axis=0), zone.points.max(axis=0) - system.points.max(axis=0)
    inside = bool(min(low.min(), high.min()) > -1e-9 * size)
    require(inside, "a point lies outside the contact zone", (low, high))
    area = abs(system.weights.sum() / zone.weights.sum() - 1.0)
    require(area < 1e-3, "the weights do not add up to the area of the zone, so that forces are wrong", area)
    for name, connectivity in system.cells:
        valid = bool((connectivity >= 0).all() and (connectivity < n).all())
        require(valid, f"cells of type {name} refer to points that do not exist", connectivity)


def check_linear(formulation: Formulation, body: Body, system: ReducedSystem) -> None:
    """Check that apply is linear, pure and agrees with diagonal_blocks and dense; data affect the offset only."""
    random = np.random.default_rng(0)
    n = len(system.points)
    loads = random.normal(size=(3, n, system.n_fields)) * typical_load(system)
    original = loads.copy()
    responses = np.array([system.apply(load) for load in loads])
    require(np.array_equal(loads, original), "apply changes its argument, so that solvers lose their state", n)
    again = system.apply(loads[0])
    require(np.array_equal(again, responses[0]), "apply depends on earlier calls", worst(again, responses[0]))
    combined = system.apply(2.0 * loads[0] - 3.0 * loads[1])
    error = worst(combined, 2.0 * responses[0] - 3.0 * responses[1])
    require(error < ROUND_OFF, "apply is not linear: Newton's steps would be wrong", error)
    _check_blocks(system)
    matrix = system.dense()
    if matrix is not None:
        n_fields = system.n_fields
        fits = matrix.shape == (n, n_fields, n, n_fields)
        require(fits, "dense is not (n, fields, n, fields)", matrix.shape)
        error = worst(np.einsum("namb,mb->na", matrix, loads[0]), responses[0])
        require(error < ROUND_OFF, "dense is not the matrix of apply: solvers that use either differ", error)
    still = formulation.reduce(replace(body, conditions=tuple(replace(c, data=0.0 * c.data) for c in body.conditions)))
    scale = np.abs(system.offset).max(axis=0)
    error = float((np.abs(still.offset).max(axis=0) / np.where(scale > 0.0, scale, 1.0)).max())
    require(error < ROUND_OFF, "the offset is not zero though all prescribed data are", error)
    error = worst(still.apply(loads[0]), responses[0])
    require(error < ROUND_OFF, "the compliance depends on the prescribed data, so that it is not linear", error)


def check_persistence(formulation: Formulation, body: Body, system: ReducedSystem) -> None:
    """Check that the arrays of a system give the same system again, bit for bit."""
    arrays = stored_arrays(formulation, system)
    if arrays is None or not isinstance(formulation, PersistentFormulation):
        return
    again = formulation.from_arrays(body, arrays)
    for name in ("points", "frames", "weights", "offset"):
        same = np.array_equal(getattr(again, name), getattr(system, name))
        require(same, f"{name} changes when restored from arrays", name)
    load = np.random.default_rng(0).normal(size=system.offset.shape) * typical_load(system)
    response, expected = again.apply(load), system.apply(load)
    require(np.array_equal(response, expected), "apply changes when restored from arrays", worst(response, expected))
    same = np.array_equal(again.diagonal_blocks(), system.diagonal_blocks())
    require(same, "diagonal_blocks change when restored from arrays", len(load))


def check_edges(formulation: Formulation, system: ReducedSystem) -> None:
    """Check that systems of a formulation resolve edges if and only if `resolves_edges` says so."""
    resolves = system.capability(EdgeResolution) is not None
    message = (
        "resolves_edges does not tell whether systems have EdgeResolution: two bodies would be resolved differently"
    )
    require(resolves == formulation.resolves_edges(), message, resolves)


def check_translation(formulation: Formulation, system: ReducedSystem) -> None:
    """Check that a load moved by a cell moves the displacement by a cell if `supports_rolling` says so."""
    if not formulation.supports_rolling():
        return
    for axis in system.frames[0, :2]:
        shift = CellShift.of(system.points, system.frames, axis, formulation.is_periodic())
        inner = shift.grid[2:-2, 2:-2]
        load = np.zeros_like(system.offset)
        load[inner] = np.random.default_rng(0).normal(size=(*inner.shape, system.n_fields)) * typical_load(system)
        response, displacement = system.apply(shift.load(load)), shift.values(system.apply(load))
        error = worst(response[~shift.entering], displacement[~shift.entering])
        require(error < 1e-9, "supports_rolling, but the compliance is not the same along the grid", error)


def check_exact(system: ReducedSystem, field: ExactField, tolerance: float) -> None:
    """Check that offset + compliance(load of an exact field) is that field: signs, frames, units and data are right."""
    load = _to_local(system, field.fluxes(system.points, system.frames[:, 2]))
    exact = _to_local(system, field.values(system.points))
    exact[:, POTENTIALS] *= -1.0
    computed = system.offset + system.apply(load)
    error = np.abs(computed - exact).max(axis=0) / np.abs(exact).max(axis=0)
    potentials = "-phi", "-psi", *(f"potential of field {field}" for field in range(N_FIELDS, system.n_fields))
    names = "u.e1", "u.e2", "u.nu", *potentials
    worst = int(error.argmax())
    require(bool(error[worst] <= tolerance), f"an exact field is not reproduced in {names[worst]}", error)


def check_reciprocity(system: ReducedSystem, asymmetry: float) -> None:
    """Check the reciprocal theorem of Betti, and that every load does positive work on its displacement."""
    loads = smooth_loads(system)
    responses = np.array([system.apply(load) for load in loads])
    works = np.einsum("n,knf,knf->k", system.weights, loads, responses)
    require(bool((works > 0.0).all()), "a load gains energy: contact on such a body has no solution", works)
    # the potentials' sign in the reduced system makes the coupling of mechanical and other fields antisymmetric
    signs = np.ones(system.n_fields)
    signs[POTENTIALS] = -1.0
    work = np.einsum("n,f,knf,lnf->kl", system.weights, signs, loads, responses)
    error = float((np.abs(work - work.T) / np.sqrt(np.outer(works, works))).max())
    require(error <= asymmetry, "the reciprocal theorem does not hold", error)


def check_energy(system: ReducedSystem, fields: tuple[float, ...], shape: int) -> None:
    """Check that a load of all fields, in one of the shapes of `shapes`, does positive work on its displacement."""
    load = np.outer(shapes(system)[shape], fields) * typical_load(system)
    work = float(np.einsum("n,nf,nf->", system.weights, load, system.apply(load)))
    message = f"a load gains energy, so that contact on such a body has no solution: fields {fields}, shape {shape}"
    require(work > 0.0 or not load.any(), message, f"work {work:.2e}")


def check_recovery(system: ReducedSystem, body: Body, tolerance: float) -> None:
    """Check that recover returns the load and its displacement on the zone, and prescribed values on supports."""
    load = smooth_loads(system)[0]
    fields = system.recover(load)
    shape = (len(fields.points), system.n_fields)
    require(fields.values.shape == fields.fluxes.shape == shape, "recover gives no (p, f) fields", fields.values.shape)
    expected = system.offset + system.apply(load)
    expected[:, POTENTIALS] *= -1.0
    distance = np.linalg.norm(system.points[:, None] - fields.points, axis=2)
    nearest_point, tolerance_of_position = distance.argmin(axis=1), 1e-9 * np.ptp(system.points, axis=0).max()
    require(
        bool((distance.min(axis=1) <= tolerance_of_position).all()),
        "recover has no point at a node of the zone",
        distance.min(),
    )
    error = worst(_to_local(system, fields.values[nearest_point]), expected)
    require(error <= tolerance, "recover has other values on the zone than the compliance", error)
    scale = np.abs(fields.values).max(axis=0)
    for condition in body.conditions:
        points = body.mesh.points[body.mesh.group_points(condition.group)]
        near = np.linalg.norm(points[:, None] - fields.points, axis=2)
        on_boundary, nearest = near.min(axis=1) <= tolerance_of_position, near.argmin(axis=1)
        data = np.broadcast_to(condition.data, len(points))
        if condition.kind == "value":
            deviation = np.abs(fields.values[nearest, condition.field] - data)[on_boundary].max(initial=0.0)
            message = f"recover misses the prescribed field {condition.field} of {condition.group!r}"
            require(bool(deviation <= tolerance * scale[condition.field]), message, deviation)


def check_refusals(formulation: Formulation, body: Body) -> None:
    """Check that check raises an error, which users can resolve, for bodies that reduce cannot treat."""
    formulation.check(body)
    first = body.conditions[0]
    wrong = {
        "an unknown contact zone": replace(body, contact_group="nowhere"),
        "an unknown face group": replace(body, conditions=(*body.conditions, replace(first, group="nowhere"))),
        "a field prescribed twice": replace(body, conditions=(*body.conditions, first)),
        "a condition on the contact zone": replace(
            body, conditions=(*body.conditions, BoundaryCondition(body.contact_group or "", 2, "flux"))
        ),
    }
    for name, other in wrong.items():
        try:
            formulation.check(other)
            if other.contact_group == body.contact_group:
                raise AssertionError(f"check accepts {name}: the error would appear late or not at all")
            formulation.reduce(other)
        except MeeframeError:
            continue
        raise AssertionError(f"reduce accepts {name}")


def check_indentation(formulation: Formulation, body: Body | None = None, tolerance: float = 0.05) -> None:
    """Check the force on a rigid sphere against the closed form for a half space (eq. 33), within a tolerance.

    Parameters
    ----------
    formulation : Formulation
        The formulation.
    body : Body, optional
        Body that is transversely isotropic about x3, with a flat zone in x3 = 0 about the origin, 5 mm wide, and large
        compared with it; by default a block.
    tolerance : float, optional
        Relative tolerance of the force.
    """
    body = body or _block()
    approach, radius = 3e-5, 0.1
    system = formulation.reduce(body)
    check_form(system, body)
    x, y, _ = system.points.T
    problem = indentation_problem(system, (x**2 + y**2) / (2.0 * radius), approach)
    solution = solve(problem, SemismoothNewton())
    force = -float(system.weights @ solution.state.load[:, 2])
    exact = indent(axisymmetric_compliance(body.stiffness), Sphere(radius), approach).force
    error = abs(force / exact - 1.0)
    message = (
        f"a sphere pressed {approach:g} m deep needs {force:g} N, on a half space {exact:g} N in closed form; relative "
        f"error (allowed: {tolerance:g})"
    )
    require(error <= tolerance, message, f"{error:.3g}")


def _block() -> Body:
    mesh = block_mesh(0.05, 0.12, 0.005, 8, 4, 3, Quad4())
    conditions = tuple(BoundaryCondition("base", field, "value") for field in range(N_FIELDS))
    return Body(library_material("batio3-cofe2o4").stiffness, mesh, conditions, "contact")


def _patch() -> tuple[Body, ExactField]:
    """Return a block of a rotated orthotropic material and a linear field.

    Values are prescribed on its base, fluxes on its other faces.
    """
    stiffness = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
    mesh = block_mesh(0.5, 0.8, 0.5, 3, 1, 2, Quad4())
    field = LinearField.random(stiffness, seed=5)
    body = prescribe(mesh, field, stiffness, {"base": "vvvvv", **dict.fromkeys(_GROUPS, "fffff")})
    return replace(body, contact_group="contact"), field


def _check_blocks(system: ReducedSystem) -> None:
    blocks = system.diagonal_blocks()
    n, n_fields = system.offset.shape
    require(blocks.shape == (n, n_fields, n_fields), "diagonal_blocks is not (n, fields, fields)", blocks.shape)
    # fields have their own units: displacements of unit energy under loads of unit energy
    size = np.sqrt(np.abs(np.einsum("naa->na", blocks)))
    for node in {0, n // 2, n - 1}:
        for number in range(n_fields):
            load = np.zeros((n, n_fields))
            load[node, number] = 1.0
            response = system.apply(load)[node]
            error = float((np.abs(response - blocks[node, :, number]) / (size[node] * size[node, number])).max())
            require(error < ROUND_OFF, f"diagonal_blocks is not what node {node} answers to itself", error)


def _to_local(system: ReducedSystem, extended: Array) -> Array:
    """Return extended vectors (n, fields), given in global axes, in the local frames."""
    local = extended.copy()
    local[:, MECHANICAL] = np.einsum("nai,ni->na", system.frames, extended[:, MECHANICAL])
    return local
