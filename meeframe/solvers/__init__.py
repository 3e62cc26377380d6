"""Contact solvers and the one driver loop around them."""

from meeframe.solvers.accelerated import BarzilaiBorwein, Nesterov
from meeframe.solvers.auto import Auto
from meeframe.solvers.conjugate_gradients import ProjectedCG
from meeframe.solvers.driver import Limits, solve
from meeframe.solvers.edges import solve_to_edges
from meeframe.solvers.newton import SemismoothNewton
from meeframe.solvers.residual import residual
from meeframe.solvers.uzawa import Uzawa

__all__ = [
    "Auto",
    "BarzilaiBorwein",
    "Limits",
    "Nesterov",
    "ProjectedCG",
    "SemismoothNewton",
    "Uzawa",
    "residual",
    "solve",
    "solve_to_edges",
]
