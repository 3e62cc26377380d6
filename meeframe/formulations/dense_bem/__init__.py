"""Dense boundary elements with collocation at the nodes (paper, section 5; eqs. 19-26)."""

from meeframe.formulations.dense_bem.formulation import DenseBEM

__all__ = ["DenseBEM"]
