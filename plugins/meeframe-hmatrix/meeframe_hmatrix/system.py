"""From the hierarchical system to the reduced system: truncated elimination, and the compliance of the contact zone."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Final, final

import numpy as np
from scipy.sparse.linalg import LinearOperator, gcrotmk

from meeframe.plugin import (
    MECHANICAL,
    N_MECHANICAL,
    POTENTIALS,
    THERMAL_FIELD,
    AnyArray,
    ApproximateInverse,
    Array,
    Body,
    CaseError,
    FieldwiseApply,
    Indices,
    InteriorFields,
    NodalFields,
    Persistence,
    PointFields,
    Progress,
    ReducedSystem,
    SurfaceMesh,
    TooLargeError,
    silent,
)
from meeframe.plugin.boundary_elements import InteriorRepresentation, Layout, Units, boundary_fields
from meeframe_hmatrix.arithmetic import (
    Factors,
    Form,
    SplitFactors,
    Truncation,
    apply_inverse,
    eliminate,
    solve_block,
    worker_pool,
)
from meeframe_hmatrix.assembly import System
from meeframe_hmatrix.blocks import Block, Split, leaves, multiply, shape, to_dense
from meeframe_hmatrix.clusters import ClusterTree
from meeframe_hmatrix.field_selection import merge_blocks, select_fields
from meeframe_hmatrix.packing import pack
from meeframe_hmatrix.product import Product, product_of
from meeframe_hmatrix.truncated_inverse import TruncatedInverse, truncated_inverse
from meeframe_hmatrix.truncation import precision

RESIDUAL_TOLERANCE: Final = 1e-10
RESTART_LENGTH, MAX_RESTARTS = 50, 4
"""Bounds of GMRES: iterations between restarts, and restarts."""
MAX_PRODUCTS: Final = 8
"""Largest number of stored products between fields of load and displacement."""
ARRAYS: Final = ("offset", "order", "to_load", "to_displacement", "node_compliance")
"""Stored arrays of a system besides its compliance."""

Fields = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class BoundarySystem:
    """The system, in the order of the tree, with its truncated factors.

    flux_unit: the unit of unknown fluxes.
    """

    system: System
    factors: Factors
    tree: ClusterTree
    layout: Layout
    units: Units
    mesh: SurfaceMesh
    flux_unit: float

    def unknowns(self, loads: Array) -> Array:
        """Return the unknowns, in the numbering of the layout, for loads (f n) in that of the tree.

        GMRES is preconditioned with the factors. Raises CaseError if it does not converge.
        """
        rhs = self.system.rhs + multiply(self.system.load_matrix, loads[:, None])[:, 0]
        solution = np.empty_like(rhs)
        solution[self.tree.unknowns] = self.solve(rhs)[0]
        return solution

    def solve(self, rhs: Array) -> tuple[Array, int]:
        """Return matrix^-1 @ rhs and the number of iterations. Raises CaseError if GMRES does not converge.

        Flexible GMRES (that of SciPy, which carries a vector over to the next restart) is used because factors in
        single precision are not linear to the last digit.
        """
        if not rhs.any():
            return np.zeros_like(rhs), 0
        if not np.isfinite(rhs).all():
            raise CaseError(
                f"{np.count_nonzero(~np.isfinite(rhs))} of {len(rhs)} right-hand sides of the boundary element system, "
                "from tractions of the contact zone and prescribed data, are not finite numbers"
            )
        iterations = 0

        def precondition(x: Array) -> Array:
            nonlocal iterations
            iterations += 1
            return apply_inverse(self.factors, x.reshape(-1, 1))[:, 0]

        size = (len(rhs), len(rhs))
        matrix = LinearOperator(size, lambda x: multiply(self.system.matrix, x.reshape(-1, 1))[:, 0], dtype=float)
        preconditioner = LinearOperator(size, precondition, dtype=float)
        solution, info = gcrotmk(
            matrix, rhs, rtol=RESIDUAL_TOLERANCE, maxiter=MAX_RESTARTS, M=preconditioner, m=RESTART_LENGTH, k=1
        )  # SciPy tests convergence only when a cycle begins
        if info and not np.linalg.norm(rhs - matrix @ solution) <= RESIDUAL_TOLERANCE * np.linalg.norm(rhs):  # NaN, too
            raise CaseError(
                f"the boundary element system is not solved after {iterations} iterations: it is nearly singular, or "
                "the tolerance of the formulation is too large; try a smaller tolerance"
            )
        return solution, iterations

    def fields(self, loads: Array) -> NodalFields:
        """Return the fields on the boundary for loads (n, f).

        Loads are in units of the system, the order of the layout and global axes.
        """
        flat = loads.ravel()
        unknowns = self.unknowns(flat[self.tree.loads])
        return boundary_fields(self.layout, self.units, self.mesh, unknowns, self.flux_unit * unknowns, flat)


def factorise(system: System, tolerance: float, progress: Progress) -> Factors:
    """Return the truncated factors of the matrix."""
    progress("elimination", 0.0)
    with truncation(tolerance) as settings:
        return eliminate(system.matrix, settings)


def condense(system: System, factors: Factors, tolerance: float, progress: Progress) -> Block:
    """Return the compliance of the contact zone by the factors of the matrix.

    It gives values (f n) there for loads (f n), both in the order of the tree and in units of the system.
    """
    progress("compliance", 0.0)
    assert isinstance(factors, SplitFactors)
    with truncation(tolerance) as settings:
        reduced = solve_block(factors, Form.LOWER, system.load_matrix, settings)
        assert isinstance(reduced, Split)
        compliance = solve_block(factors.second, Form.UPPER, reduced.children[1][0], settings)
    progress("compliance", 1.0)
    return compliance


@contextmanager
def truncation(tolerance: float) -> Iterator[Truncation]:
    """Provide a truncation in single precision if that is sufficient, else in double precision."""
    with worker_pool() as pool:
        yield Truncation(tolerance, precision(tolerance), pool)


@dataclass(frozen=True, eq=False)
class LazyBoundary:
    """System of the whole boundary, created on demand; copies in other processes create it again.

    Attributes
    ----------
    create
        Function that creates the system.
    cache
        The system once it has been created.
    """

    create: Callable[[], BoundarySystem]
    cache: list[BoundarySystem] = field(default_factory=list)

    def __call__(self) -> BoundarySystem:
        """Return the system."""
        if not self.cache:
            try:
                self.cache.append(self.create())
            except MemoryError:
                raise TooLargeError(
                    "the system is reduced again for the fields on the whole boundary, and does not fit into memory: "
                    "use a coarser mesh or a larger tolerance"
                ) from None
        return self.cache[0]

    def __getstate__(self) -> dict[str, Any]:
        return {"create": self.create, "cache": []}


@final
@dataclass(frozen=True, eq=False)
class HierarchicalSystem(ReducedSystem, FieldwiseApply, ApproximateInverse, Persistence, InteriorFields):
    """A reduced system whose compliance is a hierarchical matrix in the order of the cluster tree.

    Attributes
    ----------
    order
        (n,) node of each f rows of the compliance.
    to_load, to_displacement
        (n, f, f) from local frames to units of the system in global axes, and back.
    node_compliance
        (n, f, f) response of each node to its own load, in local frames and SI units.
    compliance
        The matrix of `condense`.
    boundary_system
        The system of the whole boundary; like products and inverses, it is computed again in other processes.
    representation
        The interior representation of the body.
    groups
        Groups of fields that the material couples, each with the fields whose loads act on it; the compliance between
        other fields is exactly zero.
    products
        The latest products, by their fields.
    inverses
        Approximate inverses, by their fields.
    """

    order: Indices
    to_load: Array
    to_displacement: Array
    node_compliance: Array
    compliance: Block
    boundary_system: LazyBoundary
    representation: InteriorRepresentation
    groups: tuple[tuple[Fields, Fields], ...]
    products: dict[tuple[Fields, Fields], Product] = field(default_factory=dict)
    inverses: dict[Fields, TruncatedInverse | None] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "products": {}, "inverses": {}}

    @property
    def boundary(self) -> BoundarySystem:
        """The system of the whole boundary, computed again if it has been released."""
        return self.boundary_system()

    def to_arrays(self) -> dict[str, AnyArray]:
        """Return the compliance and the data that do not follow from the body."""
        table, numbers = pack(self.compliance)
        return {name: getattr(self, name) for name in ARRAYS} | {"table": table, "numbers": numbers}

    def apply(self, load: Array) -> Array:
        """Return compliance(load), (n, f), for a load (n, f)."""
        fields = range(self.n_fields)
        return self.apply_fields(load, fields, fields)

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement in k fields by a matrix of the entries between these fields and the loaded ones."""
        if len(self.groups) == 1:
            return self._multiply(load, loaded, fields)
        displacement = np.zeros((len(load), len(fields)))
        for group, causes in self.groups:
            rows = [index for index, name in enumerate(fields) if name in group]
            columns = [index for index, name in enumerate(loaded) if name in causes]
            if rows and load[:, columns].any():
                group_loaded, group_fields = [loaded[index] for index in columns], [fields[index] for index in rows]
                displacement[:, rows] = self._multiply(load[:, columns], group_loaded, group_fields)
        return displacement

    def _multiply(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement in fields of one group for a load in fields that act on it."""
        key = tuple(loaded), tuple(fields)
        product = self.products.pop(key, None) or product_of(merge_blocks(self._between(*key)))
        self.products[key] = product  # the latest comes last
        for oldest in list(self.products)[:-MAX_PRODUCTS]:
            self.products.pop(oldest, None)
        displacement = np.empty((len(load), len(fields)))
        displacement[self.order] = product(load[self.order].ravel()).reshape(displacement.shape)
        return displacement

    def _between(self, loaded: Fields, fields: Fields) -> Block:
        """Return the compliance between some of the fields in local frames and SI units, in the order of the tree."""
        to_load, to_displacement = self.to_load[self.order], self.to_displacement[self.order]
        return select_fields(self.compliance, to_load[:, :, list(loaded)], to_displacement[:, list(fields)])

    def approximate_inverse(self, fields: Sequence[int]) -> TruncatedInverse | None:
        """Return an inverse with a large truncation error; None if truncation loses these fields."""
        key = tuple(fields)
        if key not in self.inverses:
            columns = list(key)
            unit = 1.0 / np.sqrt(np.einsum("naa->na", self.node_compliance).mean(axis=0)[columns])
            to_load, to_displacement = self.to_load[self.order], self.to_displacement[self.order]
            scaled = to_load[:, :, columns] * unit, unit[:, None] * to_displacement[:, columns]
            self.inverses[key] = truncated_inverse(select_fields(self.compliance, *scaled), unit, self.order)
        return self.inverses[key]

    def diagonal_blocks(self) -> Array:
        """Return the response of each node to its own load, (n, f, f)."""
        return self.node_compliance

    def diagonal(self, fields: Sequence[int]) -> Array:
        """Return the diagonals of `diagonal_blocks` in k fields, (n, k)."""
        return self.node_compliance[:, list(fields), list(fields)]

    def dense(self) -> Array | None:
        """Return None: the matrix is hierarchical."""
        return None

    def recover(self, load: Array) -> NodalFields:
        """Return the fields on the whole boundary for a load (n, f) on the contact zone."""
        return self.boundary.fields(np.einsum("nja,na->nj", self.to_load, load))

    def evaluate(self, load: Array, points: Array, progress: Progress = silent) -> PointFields:
        """Return the fields at points (m, 3) inside the body by the interior representation."""
        return self.representation.evaluate(self.recover(load), points, progress)


def coupled_groups(body: Body) -> tuple[tuple[Fields, Fields], ...]:
    """Return the groups of fields that a body couples, each with the fields whose loads act on it.

    Displacements are one group. A temperature with thermal moduli acts on others, which do not act on it.
    """
    stiffness, moduli = body.stiffness, body.thermal_moduli
    groups = [set(range(N_MECHANICAL))]
    for name in range(N_MECHANICAL, stiffness.shape[1]):
        joined = [group for group in groups if stiffness[:, sorted(group), name, :].any()]
        groups = [group for group in groups if group not in joined] + [{name}.union(*joined)]
    fields = [tuple(sorted(group)) for group in groups]
    if moduli is None:
        return tuple(zip(fields, fields, strict=True))
    heat, heated = body.fields.index(THERMAL_FIELD.name), np.flatnonzero(moduli.any(axis=0))
    causes = [(*group, heat) if {*group} & {*heated.tolist()} else group for group in fields]
    return tuple(zip(fields, causes, strict=True))


def extract_diagonal(compliance: Block, order: Indices) -> Array:
    """Return the diagonal blocks (n, f, f) of a compliance whose rows are those of nodes order (n,), f each."""
    n_fields = shape(compliance)[0] // len(order)
    blocks = np.empty((len(order), n_fields, n_fields))
    for leaf in leaves(compliance):
        start, stop = leaf.columns.start, leaf.columns.stop
        if leaf.rows.start - compliance.rows.start == start:
            nodes = order[start // n_fields : stop // n_fields]
            blocks[nodes] = np.einsum("iaib->iab", to_dense(leaf).reshape(len(nodes), n_fields, -1, n_fields))
    return blocks


def frames_to_units(frames: Array, units: Units) -> tuple[Array, Array]:
    """Return maps of local loads to units of the system in global axes, and of values there to displacements.

    Both are (n, f, f); potentials are negated in displacements.
    """
    n_fields = len(units.scaling.factors)
    unity, signs = np.ones(n_fields), np.ones(n_fields)
    signs[POTENTIALS] = -1.0
    rotation = np.tile(np.eye(n_fields), (len(frames), 1, 1))
    rotation[:, MECHANICAL, MECHANICAL] = frames
    to_load = rotation.transpose(0, 2, 1) * units.fluxes(unity)[:, None]
    to_displacement = signs[:, None] * rotation * units.values_si(unity)
    return to_load, to_displacement
