"""The dense boundary element formulation, which condenses a body to a reduced system."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError, TooLargeError
from meeframe.common.memory import usable_memory
from meeframe.elements.anisotropy import anisotropy
from meeframe.fields import THERMAL_FIELD, Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem._kernels.assembly import Accuracy
from meeframe.formulations.dense_bem.assembly import assemble
from meeframe.formulations.dense_bem.collocation import collocate
from meeframe.formulations.dense_bem.fundamental import bind_body, check_material
from meeframe.formulations.dense_bem.interfaces import Foundation, LayeredSolution, couple
from meeframe.formulations.dense_bem.interior import BoundaryInterior, InteriorRepresentation, LayeredInterior
from meeframe.formulations.dense_bem.layout import Layout, lay_out, number_first
from meeframe.formulations.dense_bem.patches import find_patches
from meeframe.formulations.dense_bem.regions import Region, divide, located_below
from meeframe.formulations.dense_bem.system import BoundarySolution, factorise, zone_relation
from meeframe.formulations.dense_bem.units import Units, check_expansion
from meeframe.greens import Tabulated
from meeframe.greens.base import FundamentalSolution
from meeframe.mesh import check_mesh, check_supports, find_contact_zone
from meeframe.mesh.body import Body
from meeframe.mesh.slenderness import bending_warnings
from meeframe.system.capabilities import InteriorFields
from meeframe.system.dense import in_local_frames
from meeframe.system.reduced import NodalFields, Progress, ReducedSystem, silent


@final
@checked_arguments
@dataclass(frozen=True)
class DenseBEM(Formulation):
    """Boundary elements with collocation at the nodes and one factorisation of one dense matrix.

    Attributes
    ----------
    fundamental_solution : FundamentalSolution
        Method to compute the kernels.
    quadrature_tolerance : float
        Relative error of each element integral.
    edge_angle : float
        Tractions are discontinuous where normals of neighbouring elements differ by more than this [rad].

    Raises
    ------
    CaseError
        If a number is out of bounds.
    """

    fundamental_solution: FundamentalSolution = field(default_factory=Tabulated)
    quadrature_tolerance: Annotated[float, Quantity("", gt=0, lt=0.1)] = 1e-5
    edge_angle: Annotated[float, Quantity("rad", gt=0, lt=np.pi)] = np.pi / 6

    def __post_init__(self) -> None:
        check_quantities(self)

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
        TooLargeError
            If the matrices do not fit into the memory that the process may use.
        CaseError
            If boundary conditions contradict each other, touch the contact zone or leave a field undetermined, or if
            heat acts on the other fields of a semi-infinite body.
        MaterialError
            If the fundamental solution does not apply, or the material is too close to inadmissible.
        """
        _check_memory(body)
        check_mesh(body.mesh)
        regions = divide(body)
        if body.layers:
            _check_memory(*(region.body for region in regions))
            check_supports(body)
        for number, region in enumerate(regions):
            check_expansion(region.body)
            with located_below(number):
                self._layout(region)
            check_material(self.fundamental_solution, region.body)
            anisotropy(region.body.scaled_stiffness)

    def supports_layers(self) -> bool:
        """Return True: each layer is a region with its own closed surface."""
        return True

    def couples_heat(self) -> bool:
        """Return True: the temperature may act on the other fields of the body."""
        return True

    def warnings(self, body: Body) -> tuple[str, ...]:
        """Return warnings about slender limbs, whose bending may be inaccurate.

        Parameters
        ----------
        body : Body
            A body that `check` accepts.

        Returns
        -------
        tuple of str
            The warnings.
        """
        return bending_warnings(body)

    def reduce(self, body: Body, progress: Progress = silent) -> ReducedSystem:
        """Assemble and factorise the system, and condense it to the contact zone.

        Parameters
        ----------
        body : Body
            The body.
        progress : callable, optional
            Function that is called with the name of a stage and the fraction of it that is done.

        Returns
        -------
        ReducedSystem
            A `DenseSystem`.

        Raises
        ------
        CaseError
            If the body has no contact zone, or the system is singular; also as `check`.
        MeshError, MaterialError
            As `check`.
        """
        if body.contact_group is None:
            raise CaseError("the body has no contact zone; use boundary_fields")
        solution = self._solve(body, progress)
        zone = find_contact_zone(body.mesh, body.contact_group)
        offset, compliance = zone_relation(solution.regions[0])
        geometry = zone.points, zone.frames, zone.weights, zone.cells
        system = in_local_frames(*geometry, offset, compliance, solution.fields)
        return replace(system, interior=self._interior(body, solution, system.recovery))

    def boundary_fields(self, body: Body, progress: Progress = silent) -> NodalFields:
        """Return the fields on the boundary of a body without contact zone.

        Parameters
        ----------
        body : Body
            Body without contact zone.
        progress : callable, optional
            Function that receives the stage and the fraction of it that is done.

        Returns
        -------
        NodalFields
            Extended displacements and tractions in SI units and global axes.

        Raises
        ------
        CaseError
            If the body has a contact zone, or the system is singular; also as `check`.
        MeshError, MaterialError
            As `check`.
        """
        if body.contact_group is not None:
            raise CaseError(f"the body has a contact zone {body.contact_group!r}; use reduce")
        return self._solve(body, progress).fields(np.zeros((0, body.fields.size)))

    def _solve(self, body: Body, progress: Progress) -> LayeredSolution:
        progress("fundamental solution", 0.0)
        self.check(body)
        regions = divide(body)
        solutions: list[BoundarySolution] = []
        foundations: list[Foundation] = []
        for number, region in enumerate(reversed(regions)):  # from the base up
            layout, units = self._layout(region)
            if region.interface is not None:
                foundations.insert(0, Foundation.of(solutions[0], region).scaled(units, layout))
            foundation = foundations[0] if foundations else None
            solutions.insert(
                0,
                self._solve_region(
                    region, layout, units, foundation, _share_of_progress(progress, number, len(regions))
                ),
            )
        return LayeredSolution(tuple(solutions), tuple(foundations))

    def _solve_region(
        self, region: Region, layout: Layout, units: Units, foundation: Foundation | None, progress: Progress
    ) -> BoundarySolution:
        body = region.body
        accuracy = Accuracy(self.quadrature_tolerance, anisotropy(body.scaled_stiffness))
        progress("assembly", 0.0)
        mesh = replace(body.mesh, points=body.mesh.points / units.length)
        system = assemble(
            mesh, layout, collocate(mesh, layout), bind_body(self.fundamental_solution, body), accuracy, progress
        )
        couple(system, layout, foundation, region)
        progress("factorisation", 0.0)
        factors, independent = factorise(system, layout)
        progress("factorisation", 1.0)
        return BoundarySolution(factors, independent, layout, units, body.mesh)

    def _interior(
        self, body: Body, solution: LayeredSolution, recovery: Callable[[Array], NodalFields]
    ) -> InteriorFields:
        representations = tuple(
            InteriorRepresentation.of(
                self.fundamental_solution, region.body, solved.units, anisotropy(region.body.scaled_stiffness)
            )
            for region, solved in zip(divide(body), solution.regions, strict=True)
        )
        if not body.layers:
            return BoundaryInterior(recovery, representations[0])
        zone = find_contact_zone(body.mesh, body.contact_group or "")
        return LayeredInterior(recovery, representations, body.layers, zone.points[0], -zone.frames[0, 2])

    def _layout(self, region: Region) -> tuple[Layout, Units]:
        body, units = region.body, Units.of(region.body)
        layout = lay_out(body, find_patches(body.mesh, self.edge_angle), units, region.joints)
        if THERMAL_FIELD in body.fields.scalars:
            layout = number_first(layout, body.fields.index(THERMAL_FIELD.name))
        return layout, units


def _share_of_progress(progress: Progress, number: int, count: int) -> Progress:
    """Return a function that reports the progress of one of several regions as a share of that of all."""
    return lambda stage, fraction: progress(stage, (number + fraction) / count)


def _check_memory(*regions: Body) -> None:
    """Raise TooLargeError if the matrices, with one unknown for each field and point, exceed the memory.

    Matrices of a region have columns for loads on its contact zone, and for values on the interface below it.
    """
    body = regions[0]
    n_fields = body.fields.size
    unknowns = np.array([n_fields * len(region.mesh.points) for region in regions])
    zones = [0 if r.contact_group is None else len(r.mesh.group_points(r.contact_group)) for r in regions]
    loads = n_fields * np.array(zones)
    required = int(8 * unknowns @ (unknowns + loads + np.append(loads[1:], 0)))
    available = usable_memory()
    if required > available:
        other = "half-space" if body.mesh.semi_infinite else "skfem" if len(regions) > 1 else "hmatrix-bem"
        raise TooLargeError(
            f"{unknowns.sum() // n_fields} points, {zones[0]} of them in the contact zone, require matrices of "
            f"{required / 1e9:.3g} GB; this process may use {available / 1e9:.3g} GB: use a coarser mesh, or the "
            f"formulation {other!r}"
        )
