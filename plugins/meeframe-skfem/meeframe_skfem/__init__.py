"""Finite element formulation of meeframe with scikit-fem."""

from collections.abc import Iterable

from meeframe.plugin import Formulation, Record, hookimpl
from meeframe_skfem.formulation import FiniteElements

__all__ = ["FiniteElements", "meeframe_formulations"]


@hookimpl
def meeframe_formulations() -> Iterable[Record[Formulation]]:
    """Register the formulation of this package."""
    return [
        Record(
            name="skfem",
            factory=FiniteElements,
            summary="finite elements in the volume, condensed to the contact zone",
            source="Allik & Hughes, Int. J. Numer. Meth. Eng. 2 (1970) 151-157; scikit-fem",
        )
    ]
