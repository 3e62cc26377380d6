"""Half-space formulation of meeframe by fast Fourier transforms."""

from collections.abc import Iterable

from meeframe.plugin import Formulation, HeightMap, Indenter, Record, hookimpl
from meeframe_halfspace.formulation import HalfSpace
from meeframe_halfspace.height_files import Scales, read_height_map
from meeframe_halfspace.height_map import MeasuredHeights
from meeframe_halfspace.manufactured import GaussianLoad
from meeframe_halfspace.response import PointResponse, indentation_modulus
from meeframe_halfspace.self_affine import SelfAffine

__all__ = [
    "GaussianLoad",
    "HalfSpace",
    "HeightMap",
    "MeasuredHeights",
    "PointResponse",
    "Scales",
    "SelfAffine",
    "indentation_modulus",
    "meeframe_formulations",
    "meeframe_indenters",
    "read_height_map",
]


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


@hookimpl
def meeframe_indenters() -> Iterable[Record[Indenter]]:
    """Register the rough surfaces of this package."""
    return [
        Record(
            name="height-map",
            factory=MeasuredHeights,
            summary="measured surface: npy, HDF5, Surfer and ESRI ASCII grids, matrices and columns of profilometers",
            source="a file",
        ),
        Record(
            name="self-affine",
            factory=SelfAffine,
            summary="periodic random surface with a self-affine spectrum between roll-off and cut-off",
            source="Jacobs, Junge & Pastewka, Surf. Topogr.: Metrol. Prop. 5 (2017) 013001",
        ),
    ]
