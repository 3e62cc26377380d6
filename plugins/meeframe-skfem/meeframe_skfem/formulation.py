"""The finite-element formulation: body in, reduced system out."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, final, get_args

import numpy as np
from pydantic import Field

from meeframe.plugin import (
    Body,
    CaseError,
    FieldScaling,
    Formulation,
    Progress,
    Quantity,
    ReducedSystem,
    check_quantities,
    checked_arguments,
    in_local_frames,
    silent,
)
from meeframe.plugin.boundary_elements import Layout, Units, characteristic_length, find_patches, lay_out
from meeframe.plugin.surfaces import check_mesh
from meeframe_skfem.constraints import Constraints, constrain
from meeframe_skfem.factorisation import LinearSolver, uses_pardiso
from meeframe_skfem.grid import Grid, box_volume
from meeframe_skfem.half_space import box_below
from meeframe_skfem.interior import FiniteElementInterior
from meeframe_skfem.matching import MatchedBody, match
from meeframe_skfem.system import FiniteElementSolution, solve_body
from meeframe_skfem.volume import VolumeMesh, read_volume


@final
@checked_arguments
@dataclass(frozen=True)
class FiniteElements(Formulation):
    """Displacements and potentials in the volume, int u_J,i C_iJKm v_K,m dV = int t_J v_J dS; direct sparse solution.

    A body that is a box is filled with a graded grid of hexahedra, which continues the contact zone: hex8 under quad4,
    hex20 under quad8, hex27 under quad9. Other bodies come with a volume mesh of hex8, hex20, hex27 or tet10. Layers on
    a rigid base are the box below the mesh of the half space; so is a half space without base for a `depth`.

    Attributes
    ----------
    growth : float
        Largest ratio of the widths of successive elements, outside the zone and downwards, >= 1.
    outside : int or None
        Elements from the zone to each edge of the box, instead of those that follow from `growth`.
    layers : int or None
        Elements from the zone's face to the opposite one, likewise; not with shells.
    grid : {'tensor', 'shells'}
        Lines of the zone through the whole box, or shells around a cube under the zone.
    volume : Path or None
        File of a volume mesh, any that meshio reads, whose boundary is the surface mesh.
    unit : float
        Metres in the unit of the file.
    linear_solver : {'auto', 'pardiso', 'splu'}
        Linear solver; auto takes pardiso (with pypardiso) where it is installed, else splu.
    edge_angle : float
        Fluxes are discontinuous where normals of neighbouring faces differ by more than this angle [rad].
    depth : float or None
        Depth of the box that stands for a half space without rigid base [m], at whose sides and base displacements and
        potentials are zero.

    Raises
    ------
    CaseError
        If one of them is not allowed.
    """

    growth: Annotated[float, Quantity("", ge=1, lt=10)] = 1.5
    outside: Annotated[int, Field(ge=1)] | None = None
    layers: Annotated[int, Field(ge=1)] | None = None
    grid: Grid = "tensor"
    volume: Path | None = None
    unit: Annotated[float, Quantity("m", gt=0, lt=np.inf)] = 1.0
    linear_solver: LinearSolver = "auto"
    edge_angle: Annotated[float, Quantity("rad", gt=0, lt=np.pi)] = np.pi / 6
    depth: Annotated[float, Quantity("m", gt=0, lt=np.inf)] | None = None

    def __post_init__(self) -> None:
        check_quantities(self)
        for name in ("outside", "layers"):
            value = getattr(self, name)
            full = isinstance(value, int | np.integer) and not isinstance(value, bool)
            if value is not None and not (full and value >= 1):
                raise CaseError(f"FiniteElements: {name} = {value!r}: must be a whole number of at least 1")
        if self.grid not in get_args(Grid):
            raise CaseError(f"FiniteElements: grid = {self.grid!r}; allowed: {', '.join(get_args(Grid))}")
        if self.grid == "shells" and self.layers is not None:
            raise CaseError(
                f'FiniteElements: layers = {self.layers}: shells have none; allowed: outside, or grid = "tensor"'
            )

    def check(self, body: Body) -> None:
        """Make the mesh and number the unknowns, without computing anything.

        Parameters
        ----------
        body : Body
            The body.

        Raises
        ------
        MeshError
            If the surface is not closed, if the body is neither a box nor has a volume mesh, or if that does not fit
            it.
        CaseError
            If boundary conditions contradict each other, touch the contact zone or leave a field undetermined, if
            layers do not fit the mesh or its keys, or if the linear solver is not installed.
        """
        self._prepare(body)

    def supports_layers(self) -> bool:
        """Return True."""
        return True

    def couples_heat(self) -> bool:
        """Return True."""
        return True

    def reduce(self, body: Body, progress: Progress = silent) -> ReducedSystem:
        """Assemble, factorise once and condense to the contact zone.

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
        MeshError
            As `check`.
        CaseError
            As `check`; if the system is singular; or if nodes of the zone move towards a pressure on them, as corners
            of quad8 do under strong coupling: no contact law is meaningful there.
        """
        solution = self.solve(body, progress)
        zone = solution.matched.zone
        offset, compliance = solution.zone_relation()
        geometry = zone.points, zone.frames, zone.weights, zone.cells
        system = in_local_frames(*geometry, offset, compliance, solution.fields)
        system = replace(system, interior=FiniteElementInterior(solution))
        _check_response(system, solution.matched.body.mesh.blocks[0].element.name)
        return system

    def solve(self, body: Body, progress: Progress = silent) -> FiniteElementSolution:
        """Return the factorised system, which also gives the values in the volume.

        Parameters
        ----------
        body : Body
            The body.
        progress : callable, optional
            Function that is called with the name of a stage and the fraction of it that is done.

        Returns
        -------
        FiniteElementSolution
            The factorised system.

        Raises
        ------
        MeshError, CaseError
            As `reduce`.
        """
        progress("mesh", 0.0)
        return solve_body(*self._prepare(body), self.linear_solver, progress)

    def _prepare(self, body: Body) -> tuple[MatchedBody, Layout, Units, Constraints]:
        uses_pardiso(self.linear_solver)  # raises CaseError if it is required but not installed
        check_mesh(body.mesh)
        body = self._finite(body)
        matched = match(body, self._volume(body))
        units = Units(characteristic_length(matched.body), FieldScaling.of(body.stiffness))
        layout = lay_out(matched.body, find_patches(matched.body.mesh, self.edge_angle), units)
        return matched, layout, units, constrain(matched.layered, matched.nodes, layout)

    def _finite(self, body: Body) -> Body:
        """Return the box that stands for a half space, or else the body itself."""
        base = body.layers.base
        if self.depth is not None and (base is not None or not body.mesh.semi_infinite):
            raise CaseError(
                f"skfem: depth = {self.depth:g} m: the depth of a block or of layers on a rigid base is known; "
                "allowed: half spaces without [base]"
            )
        if base is not None and base.insulating:
            raise CaseError(
                f"skfem: the base insulates {', '.join(base.insulating)}: the potential of a layer without ground has "
                "no limit far away; allowed: 'grounded'"
            )
        depth = self.depth if base is None else body.layers.thickness + base.thickness
        return body if depth is None or body.contact_group is None else box_below(body, depth)

    def _volume(self, body: Body) -> VolumeMesh:
        if self.volume is not None:
            return read_volume(self.volume, self.unit, body.fields.size)
        keys = {"layers": self.layers is not None, 'grid = "shells"': self.grid == "shells"}
        refused = [key for key, is_set in keys.items() if is_set]
        if body.layers.layers and refused:
            raise CaseError(
                f"skfem: {refused[0]}: the grid is not fitted to layers of other materials; allowed: growth and "
                'outside with grid = "tensor"'
            )
        return box_volume(body, self.growth, self.outside, self.layers, self.grid)


def _check_response(system: ReducedSystem, element: str) -> None:
    """Raise CaseError unless every node moves with the pressure on it."""
    normal_compliance = system.diagonal_blocks()[:, 2, 2]
    if normal_compliance.min() <= 0.0:
        count = np.count_nonzero(normal_compliance <= 0.0)
        raise CaseError(
            f"element = {element!r}: {count} of {len(normal_compliance)} nodes of the contact zone move "
            "towards a pressure on them: weights of its corners are negative, and this material's coupling is too "
            "strong for that; allowed: 'quad9' or 'quad4'"
        )
