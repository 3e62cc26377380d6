"""Contact solvers and the one driver loop around them."""

from meeframe.contact.residual import residual
from meeframe.solvers.auto import Auto
from meeframe.solvers.cg.projected_cg import ProjectedCG
from meeframe.solvers.driver import resolve_edges, solve, solve_to_edges
from meeframe.solvers.gradient.accelerated import BarzilaiBorwein, Nesterov
from meeframe.solvers.gradient.uzawa import Uzawa
from meeframe.solvers.newton.method import SemismoothNewton
from meeframe.solvers.stopping import StoppingCriteria

__all__ = [
    "Auto",
    "BarzilaiBorwein",
    "Nesterov",
    "ProjectedCG",
    "SemismoothNewton",
    "StoppingCriteria",
    "Uzawa",
    "residual",
    "resolve_edges",
    "solve",
    "solve_to_edges",
]
