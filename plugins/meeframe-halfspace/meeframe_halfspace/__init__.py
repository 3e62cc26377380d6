"""Half-space formulation of meeframe by fast Fourier transforms."""

from collections.abc import Iterable

from meeframe.core.formulation import Formulation
from meeframe.plugin.hookspecs import Record, hookimpl
from meeframe_halfspace.formulation import HalfSpace
from meeframe_halfspace.manufactured import GaussianLoad
from meeframe_halfspace.response import PointResponse

__all__ = ["GaussianLoad", "HalfSpace", "PointResponse", "meeframe_formulations"]


@hookimpl
def meeframe_formulations() -> Iterable[Record[Formulation]]:
    """Register the formulation of this package."""
    return [
        Record(
            name="half-space",
            factory=HalfSpace,
            summary="anisotropic half space, free or periodic, by fast Fourier transforms on a regular grid",
            source="Barnett & Lothe, Phys. Norvegica 7 (1973) 13; Stanley & Kato, J. Tribol. 119 (1997) 481",
        )
    ]
