"""Assembly of the collocated system: sources are shared out over threads, whose kernels release the interpreter."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numba import get_num_threads

from meeframe.common.errors import MeshError
from meeframe.elements._kernels.quadrature import BUFFER_TOO_SMALL
from meeframe.elements.base import shape_functions
from meeframe.elements.quadrature import gauss_table, shape_table
from meeframe.fields import Array
from meeframe.formulations.dense_bem._kernels import assembly as kernels
from meeframe.formulations.dense_bem.collocation import Sources
from meeframe.formulations.dense_bem.half_space import exterior_terms
from meeframe.formulations.dense_bem.layout import Layout
from meeframe.formulations.dense_bem.rules import plane_normals, tabulate
from meeframe.greens.base import Kernel
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.system.reduced import Progress

# Quadrature points handed to the fundamental solution at a time, on curved elements: their kernels fit the second-level
# cache. Twice as many, of which more share a cell of the table, take as long, four times as many longer.
POINTS_PER_CALL = 1024
PIECES_PER_CALL = 128
SOURCES_PER_TASK = 8


@dataclass(frozen=True, eq=False)
class System:
    """matrix @ unknowns = load_matrix @ loads + rhs, in one array: columns (u, u + f n + 1), in Fortran order."""

    columns: Array

    @property
    def matrix(self) -> Array:
        """(u, u)."""
        return self.columns[:, : len(self.columns)]

    @property
    def load_matrix(self) -> Array:
        """(u, f n)."""
        return self.columns[:, len(self.columns) : -1]

    @property
    def rhs(self) -> Array:
        """(u,)."""
        return self.columns[:, -1]


@dataclass(frozen=True, eq=False)
class Problem:
    """Data that every assembly task reads.

    mesh: in units of the system; own_shape: (o, k) shape functions at Sources.source_xi, zero-padded; accuracy, rules:
    how the elements are integrated; exterior: (s, f^2) terms of the plane outside the mesh of a semi-infinite body;
    planes: for each block whose elements are all plane, their normals (e, 3).
    """

    mesh: SurfaceMesh
    layout: Layout
    sources: Sources
    own_shape: Array
    kernel: Kernel
    accuracy: kernels.Accuracy
    exterior: Array | None
    rules: tuple[kernels.RuleTable, ...]
    planes: tuple[Array | None, ...]


def assemble(
    mesh: SurfaceMesh,
    layout: Layout,
    sources: Sources,
    kernel: Kernel,
    accuracy: kernels.Accuracy,
    progress: Progress,
) -> System:
    """Return the boundary element system (eqs. 19, 20). Raises MeshError if a source lies on an element not its own."""
    rules = tuple(tabulate(block, mesh.points, accuracy.tolerance) for block in mesh.blocks)
    exterior = exterior_terms(kernel, mesh, sources.position) if mesh.semi_infinite else None
    planes = tuple(plane_normals(rule) for rule in rules)
    own_shape = _own_shapes(mesh, sources)
    problem = Problem(mesh, layout, sources, own_shape, kernel, accuracy, exterior, rules, planes)
    n, n_fields = layout.n_unknowns, layout.value_column.shape[1]
    # Not of zeros, for which NumPy asks for no huge pages; the tasks write every entry of the matrix.
    system = System(np.empty((n, n + n_fields * len(layout.zone) + 1), order="F"))
    system.columns[:, n:] = 0.0
    n_sources = len(sources.position)
    tasks = [range(i, min(i + SOURCES_PER_TASK, n_sources)) for i in range(0, n_sources, SOURCES_PER_TASK)]
    with ThreadPoolExecutor(get_num_threads()) as pool:
        for done, _ in enumerate(pool.map(lambda task: _collocate(problem, task, system), tasks), 1):
            progress("assembly", done / len(tasks))
    return system


@dataclass(frozen=True, eq=False)
class _Panels:
    """Coefficients of one source: value (p, f^2) and flux (m, f^2); total (f^2,), see
    meeframe.formulations.dense_bem._kernels.assembly."""

    value: Array
    flux: Array
    total: Array


def _collocate(problem: Problem, task: range, system: System) -> None:
    """Enter the rows of some sources."""
    layout, sources = problem.layout, problem.sources
    entries = layout.value_column.shape[1] ** 2
    values, fluxes = np.empty((len(layout.value_column), entries)), np.empty((len(layout.flux_column), entries))
    panels = _Panels(values, fluxes, np.empty(entries))
    buffers = [_buffers(block, 16 * len(block.connectivity) + 8192) for block in problem.mesh.blocks]
    for source in task:
        for panel in (panels.value, panels.flux, panels.total):
            panel[:] = 0.0
        for number in range(len(problem.mesh.blocks)):
            buffers[number] = _add_others(problem, source, number, buffers[number], panels)
        if problem.exterior is not None:
            panels.total[:] -= problem.exterior[source]
        kernels.subtract_constant(panels.total, sources.mesh_points[source], sources.shape[source], panels.value)
        for own in range(sources.own_start[source], sources.own_start[source + 1]):
            number = sources.own_block[own]
            buffers[number] = _add_own(problem, source, own, buffers[number], panels)
        kernels.enter_rows(
            sources.row[source],
            panels.value,
            panels.flux,
            layout.value_column,
            layout.value_data,
            layout.flux_column,
            layout.flux_data,
            layout.load_column,
            system.matrix,
            system.load_matrix,
            system.rhs,
        )


def _add_others(
    problem: Problem, source: int, number: int, buffers: kernels.Buffers, panels: _Panels
) -> kernels.Buffers:
    """Add the elements of a block that do not hold the source; returns the buffers, enlarged if need be."""
    block, sources = problem.mesh.blocks[number], problem.sources
    position = sources.position[source]
    held = slice(sources.own_start[source], sources.own_start[source + 1])
    own = np.zeros(len(block.connectivity), bool)
    own[sources.own_element[held][sources.own_block[held] == number]] = True
    while True:
        count, n_near = kernels.far_points(position, own, problem.accuracy, problem.rules[number], buffers)
        if count >= 0:
            count = kernels.near_points(
                position,
                problem.mesh.points,
                block.connectivity,
                n_near,
                shape_table(block.element),
                problem.accuracy,
                gauss_table(),
                buffers,
                count,
            )
        if count >= 0:
            break
        buffers = _enlarged(count, block, buffers, position)
    _accumulate(problem, number, count, buffers, panels)
    return buffers


def _accumulate(problem: Problem, number: int, count: int, buffers: kernels.Buffers, panels: _Panels) -> None:
    """Add count quadrature points on elements of a block to the panels."""
    if _add_planes(problem, number, count, buffers, panels):
        return
    for first in range(0, count, POINTS_PER_CALL):
        points = slice(first, min(first + POINTS_PER_CALL, count))
        u, t = problem.kernel.evaluate(buffers.offsets[points], buffers.normals[points])
        kernels.accumulate(
            u.reshape(len(u), -1),
            t.reshape(len(t), -1),
            buffers.shape_weights[points],
            buffers.elements[points],
            problem.mesh.blocks[number].connectivity,
            problem.layout.patches.connectivity[number],
            panels.value,
            panels.flux,
            panels.total,
        )


def _add_planes(problem: Problem, number: int, count: int, buffers: kernels.Buffers, panels: _Panels) -> bool:
    """Accumulate if the block is plane and the kernel integrates over planes; otherwise add nothing and return
    False."""
    planes = problem.planes[number]
    if planes is None:
        return False
    starts = kernels.piece_starts(buffers.elements[:count])
    for first in range(0, len(starts) - 1, PIECES_PER_CALL):
        part = starts[first : first + PIECES_PER_CALL + 1]
        elements = buffers.elements[part[:-1]]
        sums = problem.kernel.integrate(buffers.offsets, buffers.shape_weights, part, planes[elements])
        if sums is None:
            return False
        kernels.add_pieces(
            *sums,
            elements,
            problem.mesh.blocks[number].connectivity,
            problem.layout.patches.connectivity[number],
            panels.value,
            panels.flux,
            panels.total,
        )
    return True


def _add_own(problem: Problem, source: int, own: int, buffers: kernels.Buffers, panels: _Panels) -> kernels.Buffers:
    """Add one element that holds the source; returns the buffers, enlarged if need be."""
    sources = problem.sources
    number, element, xi = sources.own_block[own], sources.own_element[own], sources.source_xi[own]
    block = problem.mesh.blocks[number]
    position = sources.position[source]
    table = shape_table(block.element)
    while True:
        count = kernels.adaptive_points(
            position,
            problem.mesh.points,
            block.connectivity,
            element,
            xi,
            table,
            problem.accuracy,
            gauss_table(),
            buffers,
            0,
        )
        if count >= 0:
            break
        buffers = _enlarged(count, block, buffers, position)
    u, t = problem.kernel.evaluate(buffers.offsets[:count], buffers.normals[:count])
    kernels.accumulate_own(
        u.reshape(len(u), -1),
        t.reshape(len(t), -1),
        buffers.shape_weights[:count],
        buffers.weights[:count],
        problem.own_shape[own],
        block.connectivity[element],
        problem.layout.patches.connectivity[number][element],
        panels.value,
        panels.flux,
    )
    return buffers


def _buffers(block: ElementBlock, capacity: int) -> kernels.Buffers:
    n_nodes = block.connectivity.shape[1]
    return kernels.Buffers(
        np.empty((capacity, 3)),
        np.empty((capacity, 3)),
        np.empty((capacity, n_nodes)),
        np.empty(capacity),
        np.empty(capacity, np.int64),
        np.empty(len(block.connectivity), np.int64),
        np.empty((capacity, 2)),
        np.empty(capacity),
        np.empty((capacity, n_nodes)),
    )


def _enlarged(code: int, block: ElementBlock, buffers: kernels.Buffers, position: Array) -> kernels.Buffers:
    if code == BUFFER_TOO_SMALL:
        return _buffers(block, 2 * len(buffers.elements))
    raise MeshError(
        f"the collocation point {np.array2string(position, precision=6)} (in units of the contact zone) lies on an "
        "element that does not hold it: the mesh overlaps itself"
    )


def _own_shapes(mesh: SurfaceMesh, sources: Sources) -> Array:
    """Return the shape functions at the sources on the elements that hold them, (o, k)."""
    shapes = np.zeros((len(sources.own_block), sources.shape.shape[1]))
    for number, block in enumerate(mesh.blocks):
        rows = sources.own_block == number
        shapes[rows, : block.connectivity.shape[1]] = shape_functions(block.element, sources.source_xi[rows])
    return shapes
