"""The dense boundary element formulation: body in, reduced system out."""

import math
import os
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Annotated, final

import numpy as np

from meeframe.common.errors import CaseError, TooLargeError
from meeframe.elements.anisotropy import anisotropy
from meeframe.fields import Array, FieldScaling
from meeframe.fields.units import Quantity, check_quantities
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem._kernels.assembly import Accuracy
from meeframe.formulations.dense_bem.assembly import assemble
from meeframe.formulations.dense_bem.collocation import collocate
from meeframe.formulations.dense_bem.layout import Layout, Units, lay_out
from meeframe.formulations.dense_bem.patches import find_patches
from meeframe.formulations.dense_bem.system import BoundarySolution, characteristic_length, factorise, zone_relation
from meeframe.greens import Tabulated
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.decoupled import bind_fields
from meeframe.mesh import check_mesh, zone_frames
from meeframe.mesh.body import Body
from meeframe.mesh.slenderness import bending_warnings
from meeframe.system.dense import in_local_frames
from meeframe.system.reduced import NodalFields, Progress, ReducedSystem, silent


@final
@dataclass(frozen=True)
class DenseBEM(Formulation):
    """Collocation at the nodes, one dense matrix, one factorisation.

    fundamental_solution: the kernels; quadrature_tolerance: relative error of each element integral;
    edge_angle: tractions are discontinuous where normals of neighbouring elements differ by more than this [rad].
    Raises CaseError if a number is out of bounds.
    """

    fundamental_solution: FundamentalSolution = field(default_factory=Tabulated)
    quadrature_tolerance: Annotated[float, Quantity("", gt=0, lt=0.1)] = 1e-5
    edge_angle: Annotated[float, Quantity("rad", gt=0, lt=np.pi)] = np.pi / 6

    def __post_init__(self) -> None:
        check_quantities(self)

    def check(self, body: Body) -> None:
        """Check mesh, boundary conditions, material and memory.

        Raises MeshError unless the mesh is a closed surface with outward normals; TooLargeError if its matrices would
        not fit into this machine's memory; CaseError if boundary conditions contradict each other, touch the contact
        zone or leave a field undetermined; MaterialError if the fundamental solution does not apply, or the material is
        too near to inadmissible.
        """
        _check_memory(body)
        check_mesh(body.mesh)
        self._layout(body)
        stiffness = _scaled(body)
        _bound(self.fundamental_solution, stiffness.tobytes())
        anisotropy(stiffness)

    def warnings(self, body: Body) -> tuple[str, ...]:
        """Return warnings of slender parts, whose bending may be wrong, for a body that `check` accepts."""
        return bending_warnings(body)

    def reduce(self, body: Body, progress: Progress = silent) -> ReducedSystem:
        """Assemble, factorise once, condense to the contact zone.

        Raises as check, and CaseError if the system is singular.
        """
        if body.contact_group is None:
            raise CaseError("this body has no contact zone to condense to")
        solution = self._solve(body, progress)
        zone = zone_frames(body.mesh, body.contact_group)
        offset, compliance = zone_relation(solution)
        parts = zone.points, zone.frames, zone.weights, zone.cells
        return in_local_frames(*parts, offset, compliance, solution.fields)

    def boundary_fields(self, body: Body, progress: Progress = silent) -> NodalFields:
        """Return the fields on the boundary of a body without contact zone. Raises as reduce."""
        if body.contact_group is not None:
            raise CaseError(f"the body has a contact zone {body.contact_group!r}; use reduce")
        return self._solve(body, progress).fields(np.zeros((0, body.fields.size)))

    def _solve(self, body: Body, progress: Progress) -> BoundarySolution:
        progress("fundamental solution", 0.0)
        self.check(body)
        stiffness = _scaled(body)
        kernel = _bound(self.fundamental_solution, stiffness.tobytes())
        accuracy = Accuracy(self.quadrature_tolerance, anisotropy(stiffness))
        progress("assembly", 0.0)
        layout, units = self._layout(body)
        mesh = replace(body.mesh, points=body.mesh.points / units.length)
        system = assemble(mesh, layout, collocate(mesh, layout), kernel, accuracy, progress)
        progress("factorisation", 0.0)
        factors = factorise(system)
        progress("factorisation", 1.0)
        return BoundarySolution(factors, layout, units, body.mesh)

    def _layout(self, body: Body) -> tuple[Layout, Units]:
        units = Units(characteristic_length(body), FieldScaling.of(body.stiffness))
        return lay_out(body, find_patches(body.mesh, self.edge_angle), units), units


def _scaled(body: Body) -> Array:
    return FieldScaling.of(body.stiffness).scale_stiffness(body.stiffness)


@lru_cache(maxsize=4)
def _bound(fundamental_solution: FundamentalSolution, stiffness: bytes) -> Kernel:
    """The kernel of a scaled stiffness, given as bytes so that checks and further meshes find it again by content."""
    values = np.frombuffer(stiffness)
    size = math.isqrt(len(values) // 9)
    return bind_fields(fundamental_solution, values.reshape(3, size, size, 3))


def _check_memory(body: Body) -> None:
    """Raise TooLargeError if the matrices, of one unknown a field and point, are larger than the memory of the
    machine."""
    n_fields = body.fields.size
    unknowns = n_fields * len(body.mesh.points)
    loads = 0 if body.contact_group is None else n_fields * len(body.mesh.group_points(body.contact_group))
    needed = 8 * unknowns * (unknowns + loads)
    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > available:
        other = "half-space" if body.mesh.semi_infinite else "hmatrix-bem"
        raise TooLargeError(
            f"{len(body.mesh.points)} points, {loads // n_fields} of them in the contact zone, need matrices of "
            f"{needed / 1e9:.3g} GB; this machine has {available / 1e9:.3g} GB: use a coarser mesh, or the "
            f"formulation {other!r}"
        )
