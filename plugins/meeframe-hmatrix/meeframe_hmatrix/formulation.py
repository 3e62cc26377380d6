"""The hierarchical boundary element formulation: body in, reduced system out."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, final

import numpy as np
from pydantic import Field

from meeframe.plugin import (
    ONE_BLAS_THREAD,
    AnyArray,
    Body,
    CaseError,
    FundamentalSolution,
    PersistentFormulation,
    Progress,
    Quantity,
    ReducedSystem,
    TooLargeError,
    check_quantities,
    checked_arguments,
    find_contact_zone,
    silent,
    usable_memory,
)
from meeframe.plugin.boundary_elements import (
    Accuracy,
    InteriorRepresentation,
    Layout,
    Tabulated,
    Units,
    anisotropy,
    bind_body,
    check_expansion,
    check_material,
    collocate,
    find_patches,
    lay_out,
)
from meeframe.plugin.surfaces import bending_warnings, check_contact_zone, check_mesh
from meeframe_hmatrix.assembly import assemble
from meeframe_hmatrix.blocks import shape
from meeframe_hmatrix.clusters import cluster_tree
from meeframe_hmatrix.integrals import flux_unit, tabulate_integrals
from meeframe_hmatrix.packing import pack, unpack
from meeframe_hmatrix.system import (
    ARRAYS,
    BoundarySystem,
    HierarchicalSystem,
    LazyBoundary,
    condense,
    coupled_groups,
    extract_diagonal,
    factorise,
    frames_to_units,
)

BLOCK_TOLERANCE_RATIO = 0.1
"""Relative error of each block in the Frobenius norm, in terms of the tolerance: errors add up (measured)."""
QUADRATURE_TOLERANCE_RATIO = 0.1
"""Relative error of each integral over an element, likewise: with the default tolerance that of dense-bem."""
BENDING_TOLERANCE, MAX_TRUNCATED_SLENDERNESS = 1e-6, 12.0
"""With this tolerance slender rods are bent as by dense-bem; with the default one rods of twelve widths are, and of 30
are not (validation/slender_rods)."""
NUMBERS_PER_DIGIT = 900.0
"""Numbers stored for each unknown, digit of the tolerance and halving of a thousand unknowns (measured, generous)."""


@final
@checked_arguments
@dataclass(frozen=True)
class HierarchicalBEM(PersistentFormulation):
    """Collocation boundary elements of dense-bem in hierarchical matrices, with truncated elimination.

    Attributes
    ----------
    tolerance : float
        Approximate relative error of displacements due to all approximations: element integrals, blocks in assembly and
        elimination. The smallest value is that of the tabulated kernel.
    fundamental_solution : FundamentalSolution
        Fundamental solution.
    edge_angle : float
        Tractions are discontinuous where normals of neighbouring elements differ by more than this angle [rad].
    leaf_size : int
        Largest number of mesh points in a leaf of the cluster tree. A smaller number costs more time for each block, a
        larger one more memory; the default is the fastest measured.
    """

    tolerance: Annotated[float, Quantity("", ge=1e-8, lt=0.01)] = 1e-4
    fundamental_solution: FundamentalSolution = field(default_factory=Tabulated)
    edge_angle: Annotated[float, Quantity("rad", gt=0, lt=np.pi)] = np.pi / 6
    leaf_size: Annotated[int, Field(ge=1)] = 36

    def __post_init__(self) -> None:
        check_quantities(self)
        if not isinstance(self.leaf_size, int) or self.leaf_size < 1:
            raise CaseError(f"hmatrix-bem: leaf_size = {self.leaf_size!r}; allowed: whole numbers from 1")

    def check(self, body: Body) -> None:
        """Check mesh, boundary conditions, material and memory.

        Parameters
        ----------
        body : Body
            The body.

        Raises
        ------
        MeshError
            If the mesh is not a closed surface with outward normals.
        CaseError
            If boundary conditions contradict each other, touch the contact zone or leave a field undetermined, if there
            is no contact zone, or if heat acts on the other fields of a semi-infinite body.
        TooLargeError
            If the matrices would not fit into this machine's memory.
        MaterialError
            If the fundamental solution does not apply, or the material is too near to inadmissible.
        """
        if body.contact_group is None:
            raise CaseError("this body has no contact zone to condense to")
        check_expansion(body)
        check_mesh(body.mesh)
        check_contact_zone(body.mesh, body.contact_group)
        layout, _ = self._layout(body)
        _check_memory(layout.n_unknowns, self.tolerance)
        check_material(self.fundamental_solution, body)
        anisotropy(body.scaled_stiffness)

    def couples_heat(self) -> bool:
        """Return True: the temperature may act on the other fields of the body."""
        return True

    def warnings(self, body: Body) -> tuple[str, ...]:
        """Return warnings about slender parts, whose bending may be inaccurate.

        Parameters
        ----------
        body : Body
            A body that `check` accepts.

        Returns
        -------
        tuple of str
            The warnings.
        """
        if self.tolerance <= BENDING_TOLERANCE:
            return bending_warnings(body)
        return bending_warnings(
            body, MAX_TRUNCATED_SLENDERNESS, f"take a tolerance of {BENDING_TOLERANCE:.0e} or less, "
        )

    def reduce(self, body: Body, progress: Progress = silent) -> ReducedSystem:
        """Assemble, eliminate and condense to the contact zone.

        Parameters
        ----------
        body : Body
            The body.
        progress : callable, optional
            Function that is called with the name of a stage and the fraction of it that is done.

        Returns
        -------
        ReducedSystem
            The system, with a compliance in hierarchical matrices.

        Raises
        ------
        CaseError
            If the system is singular; also as `check`.
        MeshError, TooLargeError, MaterialError
            As `check`.
        """
        progress("fundamental solution", 0.0)
        self.check(body)
        boundary = self.boundary(body, progress)
        compliance = condense(boundary.system, boundary.factors, BLOCK_TOLERANCE_RATIO * self.tolerance, progress)
        zone = find_contact_zone(body.mesh, body.contact_group or "")
        order = boundary.tree.loads[:: body.fields.size] // body.fields.size
        to_load, to_displacement = frames_to_units(zone.frames, boundary.units)
        node_compliance = np.einsum("naj,njk,nkb->nab", to_displacement, extract_diagonal(compliance, order), to_load)
        values = boundary.layout.value_column[boundary.layout.zone]
        constant, _ = boundary.solve(boundary.system.rhs)
        offset = np.einsum("naj,nj->na", to_displacement, constant[boundary.tree.unknown_rank[values]])
        boundary_system = LazyBoundary(partial(self.boundary, body), [boundary])
        compliance = unpack(*pack(compliance))  # in memory as a system from arrays
        groups = coupled_groups(body)
        for group, causes in groups:  # truncation leaves noise where the material couples nothing
            other_fields = np.setdiff1d(range(body.fields.size), causes)
            node_compliance[:, np.array(group)[:, None], other_fields] = 0.0
            if not any(np.any(condition.data) for condition in body.conditions if condition.field in causes):
                offset[:, group] = 0.0
        representation = self._representation(body)
        arrays = order, to_load, to_displacement, node_compliance, compliance, boundary_system, representation
        return HierarchicalSystem(zone.points, zone.frames, zone.weights, zone.cells, offset, *arrays, groups=groups)

    def from_arrays(self, body: Body, arrays: Mapping[str, AnyArray]) -> ReducedSystem:
        """Restore a reduced system that was stored as arrays; `recover` then needs assembly and elimination again.

        Parameters
        ----------
        body : Body
            The body that was reduced.
        arrays : dict of str to array
            Arrays of `Persistence.to_arrays`.

        Returns
        -------
        ReducedSystem
            The system.

        Raises
        ------
        ValueError
            If these are not the arrays of such a system.
        """
        names = (*ARRAYS, "table", "numbers")
        if set(arrays) != set(names):
            raise ValueError(
                f"a hierarchical system has the arrays {', '.join(names)}, not {', '.join(arrays) or 'none'}"
            )
        zone = find_contact_zone(body.mesh, body.contact_group or "")
        data, n = {name: arrays[name] for name in ARRAYS}, len(zone.points)
        compliance = unpack(arrays["table"], arrays["numbers"])
        boundary_system = LazyBoundary(partial(self.boundary, body))
        shapes = {name: array.shape for name, array in data.items()} | {"table": shape(compliance)}
        f = body.fields.size
        expected = dict.fromkeys(ARRAYS, (n, f, f)) | {"offset": (n, f), "order": (n,), "table": (f * n, f * n)}
        if shapes != expected:
            raise ValueError(f"{n} nodes of a hierarchical system have arrays of the shapes {expected}, not {shapes}")
        return HierarchicalSystem(
            zone.points,
            zone.frames,
            zone.weights,
            zone.cells,
            compliance=compliance,
            boundary_system=boundary_system,
            groups=coupled_groups(body),
            representation=self._representation(body),
            **data,
        )

    def boundary(self, body: Body, progress: Progress = silent) -> BoundarySystem:
        """Return the system of the whole boundary with its factors, without checks.

        Parameters
        ----------
        body : Body
            The body.
        progress : callable, optional
            Function that is called with the name of a stage and the fraction of it that is done.

        Returns
        -------
        BoundarySystem
            The boundary system, whose unknowns are in the units of `Units`.
        """
        stiffness = body.scaled_stiffness
        accuracy = Accuracy(QUADRATURE_TOLERANCE_RATIO * self.tolerance, anisotropy(stiffness))
        layout, units = self._layout(body)
        mesh = replace(body.mesh, points=body.mesh.points / units.length)
        sources = collocate(mesh, layout)
        tree = cluster_tree(mesh, layout, sources, self.leaf_size)
        kernel = bind_body(self.fundamental_solution, body)
        block_tolerance = BLOCK_TOLERANCE_RATIO * self.tolerance
        with ONE_BLAS_THREAD:
            integrals = tabulate_integrals(mesh, layout, sources, tree, kernel, accuracy)
            system = assemble(integrals, block_tolerance, progress)
            factors = factorise(system, block_tolerance, progress)
        return BoundarySystem(system, factors, tree, layout, units, body.mesh, flux_unit(mesh))

    def _representation(self, body: Body) -> InteriorRepresentation:
        spread = anisotropy(body.scaled_stiffness)
        return InteriorRepresentation.of(self.fundamental_solution, body, Units.of(body), spread)

    def _layout(self, body: Body) -> tuple[Layout, Units]:
        units = Units.of(body)
        return lay_out(body, find_patches(body.mesh, self.edge_angle), units), units


def _check_memory(unknowns: int, tolerance: float) -> None:
    """Raise TooLargeError if the matrices and factors are larger than the memory that the process may use."""
    digits = -np.log10(BLOCK_TOLERANCE_RATIO * tolerance)
    needed = 8.0 * unknowns * min(3.0 * unknowns, NUMBERS_PER_DIGIT * digits * max(1.0, np.log2(unknowns / 1e3)))
    available = usable_memory()
    if needed > available:
        raise TooLargeError(
            f"{unknowns} unknowns need about {needed / 1e9:.3g} GB; this process may use {available / 1e9:.3g} "
            "GB: use a coarser mesh or a larger tolerance"
        )
