"""Boundary elements of meeframe by hierarchical matrices."""

from collections.abc import Iterable

from meeframe.plugin import Formulation, Record, hookimpl
from meeframe_hmatrix.formulation import HierarchicalBEM

__all__ = ["HierarchicalBEM", "meeframe_formulations"]


@hookimpl
def meeframe_formulations() -> Iterable[Record[Formulation]]:
    """Register the formulation of this package."""
    return [
        Record(
            name="hmatrix-bem",
            factory=HierarchicalBEM,
            summary="the boundary elements of dense-bem in hierarchical matrices",
            source="Hackbusch, Hierarchical Matrices (Springer, 2015)",
        )
    ]
