"""Assembly of the collocated system by threads, whose kernels release the global interpreter lock."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

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

# Quadrature points for one call of the fundamental solution, on curved elements: their kernels fit into a second-level
# cache. With twice as many points, of which more share a cell of the table, the time is the same, with four times as
# many it is longer.
POINTS_PER_CALL = 1024
PIECES_PER_CALL = 128
SOURCES_PER_TASK = 8


@dataclass(frozen=True, eq=False)
class System:
    """The system matrix @ unknowns + joined @ values = load_matrix @ loads + rhs, with values on interfaces.

    Attributes
    ----------
    columns : Array
        Matrix, load matrix, right-hand side and coefficients of values that interfaces determine, (u, w), in Fortran
        order.
    n_loads : int
        Number of loads.
    """

    columns: Array
    n_loads: int

    @property
    def equations(self) -> Array:
        """Matrix, load matrix and right-hand side, (u, u + n_loads + 1)."""
        return self.columns[:, : len(self.columns) + self.n_loads + 1]

    @property
    def matrix(self) -> Array:
        """Matrix, (u, u)."""
        return self.columns[:, : len(self.columns)]

    @property
    def load_matrix(self) -> Array:
        """Load matrix, (u, n_loads)."""
        return self.equations[:, len(self.columns) : -1]

    @property
    def rhs(self) -> Array:
        """Right-hand side, (u,)."""
        return self.equations[:, -1]

    @property
    def joined(self) -> Array:
        """Coefficients of values that interfaces determine, (u, j)."""
        return self.columns[:, len(self.columns) + self.n_loads + 1 :]


@dataclass(frozen=True, eq=False)
class Problem:
    """Data that every assembly task reads.

    Attributes
    ----------
    mesh : SurfaceMesh
        The mesh, in units of the system.
    layout : Layout
        Numbers of the unknowns.
    sources : Sources
        Collocation points.
    singular_shape : Array
        Shape functions at Sources.singular_xi, (o, k), zero-padded.
    kernel : Kernel
        Fundamental solution.
    accuracy : Accuracy
        Accuracy of the element integrals.
    exterior : Array or None
        Terms of the plane outside the mesh of a semi-infinite body, (s, f^2).
    rules : tuple of RuleTable
        Tensor rules of each block.
    planes : tuple of Array or None
        Normals (e, 3) of each block, if all its elements are plane.
    """

    mesh: SurfaceMesh
    layout: Layout
    sources: Sources
    singular_shape: Array
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
    """Assemble the boundary element system (eqs. 19, 20).

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh, in units of the system.
    layout : Layout
        Numbers of the unknowns.
    sources : Sources
        Collocation points.
    kernel : Kernel
        Fundamental solution.
    accuracy : Accuracy
        Accuracy of the element integrals.
    progress : callable
        Function that receives a stage and the fraction done.

    Raises
    ------
    MeshError
        If a source lies on an element of which it is not a node.
    """
    mesh = _in_row_order(mesh)
    rules = tuple(tabulate(block, mesh.points, accuracy.tolerance) for block in mesh.blocks)
    exterior = exterior_terms(kernel, mesh, sources.position) if mesh.semi_infinite else None
    planes = tuple(plane_normals(rule) for rule in rules)
    singular_shape = _singular_shapes(mesh, sources)
    problem = Problem(mesh, layout, sources, singular_shape, kernel, accuracy, exterior, rules, planes)
    n, collocated = layout.n_unknowns, layout.n_unknowns - layout.n_added
    # Not np.zeros, for which NumPy requests no huge pages; the tasks write every entry of the matrix.
    system = System(np.empty((n, layout.first_joined + layout.n_joined), order="F"), layout.n_loads)
    system.columns[:, collocated:], system.columns[collocated:] = 0.0, 0.0
    n_sources = len(sources.position)
    tasks = [range(i, min(i + SOURCES_PER_TASK, n_sources)) for i in range(0, n_sources, SOURCES_PER_TASK)]
    with ThreadPoolExecutor(get_num_threads()) as pool:
        for done, _ in enumerate(pool.map(lambda task: _collocate(problem, task, system), tasks), 1):
            progress("assembly", done / len(tasks))
    return system


@dataclass(frozen=True, eq=False)
class _Panels:
    """Coefficients of one source, value (p, f^2), flux (m, f^2) and total (f^2,); see _kernels.assembly."""

    value: Array
    flux: Array
    total: Array


def _in_row_order(mesh: SurfaceMesh) -> SurfaceMesh:
    """Return the mesh with its arrays row by row: kernels are compiled once for each order."""
    blocks = (replace(block, connectivity=np.ascontiguousarray(block.connectivity)) for block in mesh.blocks)
    return replace(mesh, points=np.ascontiguousarray(mesh.points), blocks=tuple(blocks))


def _collocate(problem: Problem, task: range, system: System) -> None:
    """Enter the equations of some sources into the system."""
    layout, sources, weak = problem.layout, problem.sources, problem.kernel.weakly_singular()
    entries = layout.value_column.shape[1] ** 2
    values, fluxes = np.empty((len(layout.value_column), entries)), np.empty((len(layout.flux_column), entries))
    panels = _Panels(values, fluxes, np.empty(entries))
    buffers = [_buffers(block, 16 * len(block.connectivity) + 8192) for block in problem.mesh.blocks]
    for source in task:
        for panel in (panels.value, panels.flux, panels.total):
            panel[:] = 0.0
        for number in range(len(problem.mesh.blocks)):
            buffers[number] = _add_regular_elements(problem, source, number, buffers[number], panels)
        if problem.exterior is not None:
            panels.total[:] -= problem.exterior[source]
        panels.total[weak] = 0.0  # constant fields say nothing about these entries
        kernels.subtract_constant(panels.total, sources.mesh_points[source], sources.shape[source], panels.value)
        panels.total[:] = 0.0
        for entry in range(sources.singular_start[source], sources.singular_start[source + 1]):
            number = sources.singular_block[entry]
            buffers[number] = _add_singular_element(problem, source, entry, buffers[number], panels)
        if len(weak):
            # Singular elements multiply all entries by differences from the value at the source, which is added again.
            kernels.subtract_constant(panels.total, sources.mesh_points[source], sources.shape[source], panels.value)
        kernels.enter_rows(
            tuple(range(layout.value_column.shape[1])),
            sources.row[source],
            panels.value,
            panels.flux,
            layout.value_column,
            layout.value_data,
            layout.flux_column,
            layout.flux_data,
            layout.load_column,
            system.columns,
            system.load_matrix,
            system.rhs,
        )


def _add_regular_elements(
    problem: Problem, source: int, number: int, buffers: kernels.Buffers, panels: _Panels
) -> kernels.Buffers:
    """Add the regular elements of a block and return the buffers, enlarged if necessary."""
    block, sources = problem.mesh.blocks[number], problem.sources
    position = sources.position[source]
    elements = slice(sources.singular_start[source], sources.singular_start[source + 1])
    singular = np.zeros(len(block.connectivity), bool)
    singular[sources.singular_element[elements][sources.singular_block[elements] == number]] = True
    while True:
        count, n_near = kernels.far_points(position, singular, problem.accuracy, problem.rules[number], buffers)
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
        buffers = _enlarged_buffers(count, block, buffers, position)
    _accumulate(problem, number, count, buffers, panels)
    return buffers


def _accumulate(problem: Problem, number: int, count: int, buffers: kernels.Buffers, panels: _Panels) -> None:
    """Add `count` quadrature points on elements of a block to the panels."""
    if _add_planes(problem, number, count, buffers, panels):
        return
    for first in range(0, count, POINTS_PER_CALL):
        points = slice(first, min(first + POINTS_PER_CALL, count))
        u, t = problem.kernel.evaluate(buffers.offsets[points], buffers.normals[points])
        kernels.accumulate(
            tuple(range(u.shape[1])),
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
    """Add the points if the block is plane and the kernel integrates over planes, and return whether this is so."""
    planes = problem.planes[number]
    if planes is None:
        return False
    starts = kernels.piece_starts(buffers.elements[:count])
    for first in range(0, len(starts) - 1, PIECES_PER_CALL):
        piece_starts = starts[first : first + PIECES_PER_CALL + 1]
        elements = buffers.elements[piece_starts[:-1]]
        sums = problem.kernel.integrate(buffers.offsets, buffers.shape_weights, piece_starts, planes[elements])
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


def _add_singular_element(
    problem: Problem, source: int, entry: int, buffers: kernels.Buffers, panels: _Panels
) -> kernels.Buffers:
    """Add one singular element and return the buffers, enlarged if necessary."""
    sources = problem.sources
    number, element, xi = (
        sources.singular_block[entry],
        sources.singular_element[entry],
        sources.singular_xi[entry],
    )
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
        buffers = _enlarged_buffers(count, block, buffers, position)
    u, t = problem.kernel.evaluate(buffers.offsets[:count], buffers.normals[:count])
    kernels.accumulate_singular(
        u.reshape(len(u), -1),
        t.reshape(len(t), -1),
        buffers.shape_weights[:count],
        buffers.weights[:count],
        problem.singular_shape[entry],
        block.connectivity[element],
        problem.layout.patches.connectivity[number][element],
        panels.value,
        panels.flux,
    )
    weak = problem.kernel.weakly_singular()
    if len(weak):
        panels.total[weak] -= buffers.weights[:count] @ t.reshape(len(t), -1)[:, weak]
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


def _enlarged_buffers(code: int, block: ElementBlock, buffers: kernels.Buffers, position: Array) -> kernels.Buffers:
    if code == BUFFER_TOO_SMALL:
        return _buffers(block, 2 * len(buffers.elements))
    raise MeshError(
        f"the collocation point {np.array2string(position, precision=6)} (in units of the contact zone) lies on an "
        "element of which it is not a node: the mesh overlaps itself"
    )


def _singular_shapes(mesh: SurfaceMesh, sources: Sources) -> Array:
    """Return the shape functions at the sources on their singular elements, (o, k)."""
    shapes = np.zeros((len(sources.singular_block), sources.shape.shape[1]))
    for number, block in enumerate(mesh.blocks):
        rows = sources.singular_block == number
        shapes[rows, : block.connectivity.shape[1]] = shape_functions(block.element, sources.singular_xi[rows])
    return shapes
