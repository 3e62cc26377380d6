"""Contact solvers and the one driver loop around them."""

from meeframe.solvers.driver import Limits, solve
from meeframe.solvers.residual import residual
from meeframe.solvers.uzawa import Uzawa

__all__ = ["Limits", "Uzawa", "residual", "solve"]
