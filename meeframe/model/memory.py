"""Memory that a run on a large grid needs, estimated before anything is computed."""

from collections.abc import Iterable, Iterator
from typing import Final

from meeframe.common.memory import usable_memory
from meeframe.contact.channels import FluxChannel
from meeframe.fields import N_MECHANICAL
from meeframe.indenters.base import Indenter
from meeframe.laws.base import ContactLaw, has_friction
from meeframe.mesh.generators import BASE_BYTES, BYTES_PER_NODE, check_grid_memory
from meeframe.mesh.surface import SurfaceMesh

BYTES_PER_TANGENTIAL_FIELD: Final = 80
"""Memory per node of each tangential traction.

It is that of partial slip, where Newton's method stores most vectors, with contact on a quarter of the grid. Most
of it is stored for nodes near the contact.
"""
BYTES_PER_FLUX: Final = 240
"""Memory per node of each flux that the contact conducts, with friction."""
BYTES_PER_SAMPLE: Final = 48
"""Memory per sample of a surface while it is made from its spectrum: that of three complex numbers."""
BYTES_PER_NODE_OF_REPORTS: Final = 240
"""Memory per node of figures and of fields for ParaView, which are made when that of fluxes is free again."""
NOTICED_FRACTION: Final = 0.5
"""Fraction of the usable memory above which the estimate is a warning."""


def required_memory(nodes: int, law: ContactLaw, channels: Iterable[FluxChannel], has_reports: bool = False) -> int:
    """Return the estimated memory of a run on a grid of so many nodes [bytes].

    has_reports: with figures or fields for ParaView.
    """
    return BASE_BYTES + nodes * _bytes_per_node(law, channels, has_reports)


def _bytes_per_node(law: ContactLaw, channels: Iterable[FluxChannel], has_reports: bool) -> int:
    """Return the memory per node: friction loads two fields besides the pressure, and each conducting law one."""
    tangential = N_MECHANICAL - 1 if has_friction(law) else 0
    fluxes = sum(channel.is_conducting for channel in channels)
    reports = BYTES_PER_NODE_OF_REPORTS if has_reports else 0
    return BYTES_PER_NODE + tangential * BYTES_PER_TANGENTIAL_FIELD + max(fluxes * BYTES_PER_FLUX, reports)


def check_memory(
    mesh: SurfaceMesh, law: ContactLaw, channels: Iterable[FluxChannel], has_reports: bool = False
) -> None:
    """Raise TooLargeError if a run on the grid of a half space needs more memory than the process may use."""
    if mesh.grid is not None:
        nx, ny = mesh.grid
        check_grid_memory(f"divisions = {nx - 1} x {ny - 1}", nx * ny, _bytes_per_node(law, channels, has_reports))


def check_memory_of_surface(indenter: Indenter) -> None:
    """Raise TooLargeError if an indenter makes heights that need more memory than the process may use."""
    shape = getattr(indenter, "grid_shape", None)
    if shape is not None:
        check_grid_memory(f"samples = {shape[0]}", shape[0] * shape[1], BYTES_PER_SAMPLE, "surface")


def memory_warning(mesh: SurfaceMesh, law: ContactLaw, channels: Iterable[FluxChannel]) -> Iterator[str]:
    """Yield a warning if a run on the grid of a half space needs much of the memory that the process may use."""
    if mesh.grid is None:
        return
    required, available = required_memory(mesh.grid[0] * mesh.grid[1], law, channels), usable_memory()
    if required > NOTICED_FRACTION * available:
        yield f"the run needs about {required / 1e9:.3g} GB of the {available / 1e9:.3g} GB that this process may use"
