"""The formulation `half-space`: body in, reduced system out."""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal, final

import numpy as np
from pydantic import Field

from meeframe.plugin import (
    THERMAL_FIELD,
    Array,
    Body,
    CaseError,
    DenseSystem,
    Formulation,
    MeshError,
    Progress,
    Quantity,
    ReducedSystem,
    check_conditions,
    check_quantities,
    checked_arguments,
    silent,
)
from meeframe_halfspace.array_library import ArrayLibrary, gpu_library
from meeframe_halfspace.flat_zone import FlatZone, flat_zone
from meeframe_halfspace.grid import Grid, find_grid
from meeframe_halfspace.grid_response import FreeGrid, GridResponse, PeriodicGrid, mean_length
from meeframe_halfspace.interior import HalfSpaceInterior
from meeframe_halfspace.layer_waves import LayerWaves
from meeframe_halfspace.layered_grid import LayeredFreeGrid, LayeredPeriodicGrid
from meeframe_halfspace.layered_symbol import LayeredResponse, undetermined_levels
from meeframe_halfspace.response import PointResponse
from meeframe_halfspace.system import HalfSpaceSystem, convolution_of, dense_matrix, waves_of
from meeframe_halfspace.thermal import ThermalResponse
from meeframe_halfspace.thermal_grid import HeatedGrid

MIN_CELLS_OF_EDGES: Final = 4.0
"""Smallest thickness of the top layer, in spacings, for contact edges between the nodes."""


@final
@checked_arguments
@dataclass(frozen=True)
class HalfSpace(Formulation):
    """Exact surface response of an anisotropic half space on the grid of the contact zone, by fast Fourier transforms.

    Attributes
    ----------
    density : {'bilinear', 'constant', 'trigonometric'}
        Density of loads around each node: 'bilinear', decreasing to zero at its neighbours, like four-node elements;
        'constant' on the cell around it; or 'trigonometric', interpolation by waves, for periodic surfaces only.
    periodic : bool
        Whether the zone and half a spacing on each side of it are one period of an infinite surface. A half space has
        no finite response to a mean load, for which the response to a wave of this length is used.
    matrix_up_to : int
        Largest number of nodes for which the compliance is stored as a matrix, for solvers that factorize it; with more
        nodes, solving without a matrix takes less time.
    edges : {'nodes', 'resolved'}
        Contact edges are at the 'nodes', or 'resolved' between them, which solves each increment twice and stores no
        matrix.
    reference_radius : float or None
        Distance [m] from a point where heat flows out, at which its mean effect on the displacement and the potentials
        vanishes. A half space leaves that level undetermined: without this length, contact with heat flow needs
        prescribed forces and total fluxes, which do not depend on it. Not for layers on a rigid base, which determines
        all levels.
    device : {'cpu', 'gpu'}
        Where Fourier transforms are computed: on the 'cpu', or by CuPy on a 'gpu', which gives the same results but for
        round-off.
    """

    density: Literal["bilinear", "constant", "trigonometric"] = "bilinear"
    periodic: bool = False
    matrix_up_to: Annotated[int, Field(ge=0)] = 256
    edges: Literal["nodes", "resolved"] = "nodes"
    reference_radius: Annotated[float, Quantity("m", gt=0, lt=math.inf)] | None = None
    device: Literal["cpu", "gpu"] = "cpu"

    def __post_init__(self) -> None:
        check_quantities(self)
        if not isinstance(self.periodic, bool):
            raise CaseError(f"half-space: periodic = {self.periodic!r}; allowed: true or false")
        if self.density == "trigonometric" and not self.periodic:
            raise CaseError("half-space: density = 'trigonometric' needs periodic = true: waves have no border")
        if self.edges == "resolved" and self.density != "bilinear":
            raise CaseError(f"half-space: edges = 'resolved' with density = {self.density!r}; allowed: 'bilinear'")
        if not isinstance(self.matrix_up_to, int) or self.matrix_up_to < 0:
            raise CaseError(f"half-space: matrix_up_to = {self.matrix_up_to!r}; allowed: whole numbers from 0")
        if self.reference_radius is not None and self.periodic:
            raise CaseError(
                "half-space: reference_radius with periodic = true has no effect: the response to heat has zero mean "
                "over the period; allowed: one of them"
            )

    def check(self, body: Body) -> None:
        """Check that the body is a half space with a regular grid.

        Parameters
        ----------
        body : Body
            The body.

        Raises
        ------
        MeshError
            If the mesh is no part of a plane, or its contact zone no regular grid.
        CaseError
            If boundary conditions contradict each other or prescribe anything but zero flux outside the zone, or if the
            device is not available.
        """
        self._grid(body)
        self._library()

    def is_periodic(self) -> bool:
        """Return whether the surface is periodic."""
        return self.periodic

    def resolves_edges(self) -> bool:
        """Return whether contact edges between nodes are resolved."""
        return self.edges == "resolved"

    def supports_layers(self) -> bool:
        """Return True."""
        return True

    def supports_rolling(self) -> bool:
        """Return whether contact edges are at the nodes: others do not move with the material."""
        return not self.resolves_edges()

    def couples_heat(self) -> bool:
        """Return True."""
        return True

    def reduce(self, body: Body, progress: Progress = silent) -> ReducedSystem:
        """Compute the surface compliance and the response to one node.

        Parameters
        ----------
        body : Body
            The body.
        progress : callable, optional
            Function that is called with the name of a stage and the fraction of it that is done.

        Returns
        -------
        ReducedSystem
            The system, with a matrix if the zone has at most `matrix_up_to` nodes and edges are at the nodes.

        Raises
        ------
        MeshError, CaseError
            As `check`.
        MaterialError
            If the surface compliance cannot be computed, as for a material close to inadmissible.
        """
        zone, grid = self._grid(body)
        library = self._library()
        progress("surface compliance", 0.0)
        grid_response = self._grid_response(body, grid)
        progress("surface compliance", 1.0)
        weights, fractions = grid.weights(self.periodic), grid.fractions(self.periodic)
        origin = zone.points[grid.nodes[0, 0]]
        system = HalfSpaceSystem(
            points=zone.points,
            frames=np.broadcast_to(zone.frame, (len(weights), 3, 3)),
            weights=weights,
            cells=zone.cells,
            offset=np.zeros((len(weights), body.fields.size)),
            grid=grid,
            grid_response=grid_response,
            convolution=convolution_of(grid_response, library),
            waves=waves_of(grid_response),
            fractions=fractions,
            edge_waves=grid_response.response.wave_series()[0] if self.resolves_edges() else None,
            interior=_interior(body, grid, grid_response, origin, fractions),
        )
        # a system with a matrix does not know its grid any more
        return _with_matrix(system) if len(weights) <= self.matrix_up_to and not self.resolves_edges() else system

    def _library(self) -> ArrayLibrary | None:
        return gpu_library() if self.device == "gpu" else None

    def _grid_response(self, body: Body, grid: Grid) -> GridResponse:
        if body.layers:
            longest = max(n * h for n, h in zip(grid.size, grid.spacing, strict=True))
            layered = self._layered_response(LayeredResponse.of(body, grid.frame, longest), grid)
            return HeatedGrid.of_layers(layered, self._radius(grid)) if body.expands else layered
        thermal = None if body.thermal_moduli is None else _thermal_response(body, body.thermal_moduli, grid)
        response = replace(PointResponse.of(body.stiffness, grid.frame), thermal=thermal)
        if self.periodic:
            periodic = PeriodicGrid(response, grid.spacing, grid.size, self.density)
            return periodic if thermal is None else HeatedGrid.of(periodic, self._radius(grid))
        assert self.density != "trigonometric"
        free = FreeGrid(response, grid.spacing, grid.size, self.density)
        return free if thermal is None else HeatedGrid.of(free, self._radius(grid))

    def _radius(self, grid: Grid) -> float:
        """Return the reference radius [m]: without one that of a circle with the area of the grid, without effect."""
        return self.reference_radius or float(np.sqrt(grid.weights(False).sum() / np.pi))

    def warnings(self, body: Body) -> tuple[str, ...]:
        """Return a note on the reference radius, on which prescribed motions and potentials depend.

        Parameters
        ----------
        body : Body
            The body.

        Returns
        -------
        tuple of str
            The note; none without a reference radius, or if heat acts on no other field.
        """
        if not body.expands or self.reference_radius is None:
            return ()
        return (
            f"where heat flows, approach and potentials of a half space are those for reference_radius = "
            f"{self.reference_radius:g} m, at which the effect of heat on the surface vanishes",
        )

    def undetermined_levels(self, body: Body) -> tuple[int, ...]:
        """Return the fields whose level heat leaves undetermined: those it acts on, without a reference radius.

        Parameters
        ----------
        body : Body
            The body.

        Returns
        -------
        tuple of int
            Their columns in local frames.
        """
        if not body.expands or body.contact_group is None or self.reference_radius is not None:
            return ()
        grid = self._grid(body)[1]
        if body.layers:
            return tuple(undetermined_levels(body, grid.frame).tolist())
        assert body.thermal_moduli is not None
        return tuple(np.flatnonzero(_thermal_response(body, body.thermal_moduli, grid).level).tolist())

    def _layered_response(self, layers: LayeredResponse, grid: Grid) -> LayeredFreeGrid | LayeredPeriodicGrid:
        if self.periodic:
            return LayeredPeriodicGrid.of(layers, grid.spacing, grid.size, self.density)
        assert self.density != "trigonometric"
        return LayeredFreeGrid.of(layers, grid.spacing, grid.size, self.density)

    def _grid(self, body: Body) -> tuple[FlatZone, Grid]:
        if body.contact_group is None:
            raise CaseError("this body has no contact zone to condense to")
        if not body.mesh.semi_infinite:
            raise MeshError(
                "formulation half-space: the mesh bounds a finite body; allowed: [mesh] type = 'half-space'"
            )
        check_conditions(body)
        for condition in body.conditions:
            if condition.kind == "value" or np.any(condition.data):
                name = body.fields.value_names[condition.field]
                raise CaseError(
                    f"boundary condition on {condition.group!r}: {condition.kind} of {name}: a "
                    "half space is free of traction and flux beside its contact zone and at rest at infinity; allowed: "
                    "zero fluxes"
                )
        if not self.periodic:
            _check_grounded(body)
        zone = flat_zone(body.mesh, body.contact_group)
        grid = find_grid(zone, body.contact_group)
        if body.layers and self.edges == "resolved":
            _check_resolved(body, grid)
        if body.layers.base is not None and self.reference_radius is not None:
            raise CaseError(
                f"half-space: reference_radius = {self.reference_radius:g} m with a rigid base has no effect: the base "
                "determines the levels of displacement and potentials; allowed: one of them"
            )
        return zone, grid


def _thermal_response(body: Body, moduli: Array, grid: Grid) -> ThermalResponse:
    return ThermalResponse.of(body.stiffness, moduli, body.fields.index(THERMAL_FIELD.name), grid.frame)


def _interior(
    body: Body, grid: Grid, grid_response: GridResponse, origin: Array, fractions: tuple[Array, Array]
) -> HalfSpaceInterior | None:
    """Return the fields inside a body; None with heat."""
    if isinstance(grid_response, HeatedGrid):
        return None
    if isinstance(grid_response, LayeredFreeGrid | LayeredPeriodicGrid):
        waves = LayerWaves(body, grid.frame, mean_length(grid.size, grid.spacing))
        return HalfSpaceInterior(grid, grid_response.homogeneous, waves.stiffnesses[0], origin, fractions, waves)
    return HalfSpaceInterior(grid, grid_response, body.stiffness, origin, fractions)


def _check_grounded(body: Body) -> None:
    base = body.layers.base
    if base is not None and base.insulating:
        raise CaseError(
            f"half-space: the base insulates {', '.join(base.insulating)}: the potential of a layer without ground has "
            "no limit far away; allowed: 'grounded', or periodic = true"
        )


def _check_resolved(body: Body, grid: Grid) -> None:
    thickness, spacing = body.layers.top_thickness, max(grid.spacing)
    if thickness < MIN_CELLS_OF_EDGES * spacing:
        raise CaseError(
            f"half-space: edges = 'resolved' with a top layer of {thickness:.3g} m and a spacing of {spacing:.3g} m: "
            "near an edge the response is that of the top material; allowed: thicknesses of "
            f"{MIN_CELLS_OF_EDGES:g} spacings and more, or edges = 'nodes'"
        )


def _with_matrix(system: HalfSpaceSystem) -> DenseSystem:
    matrix: Array = dense_matrix(system)
    return DenseSystem(
        system.points,
        system.frames,
        system.weights,
        system.cells,
        system.offset,
        matrix,
        system.recover,
        system.interior,
    )
