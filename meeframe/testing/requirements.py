"""Common assertions of the conformance checks, which name the property that fails and show an offending value."""

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array

ROUND_OFF: Final = 1e-12

REASONS: Final = {
    "no frozen dataclass": "its fields are the case file's keys, and results are only as good as what cannot change.",
    "not equal to its copy": "reduced systems and bound kernels are found again by what they were made from.",
    "changes the shape": "each node has one traction.",
    "not finite": "one such number spreads over all nodes in the next product with the compliance.",
    "normal traction pulls": "t_nu <= 0 in compression (eq. 10): nothing holds the bodies together.",
    "traction where the trial is open": "the gap is open there, so that nothing can be transmitted (eq. 11).",
    "no indenter above": "the gap is infinite beside a punch; inf times zero must not become NaN.",
    "not idempotent": "an admissible traction has to stay as it is, or no state is ever a solution.",
    "other nodes": "solvers evaluate subsets of nodes, and the law is one of each point.",
    "expansive": "solvers converge because projections bring tractions no farther apart; tangential_scaling has to be"
    " that of the metric in which project is one (docs/explanation/theory.md, Set and metric).",
    "comes to no rest": "under constant slip the traction has to settle, or no solver can.",
    "depends on the step": "the solution must not depend on the solver's step length r: use tangential_scaling as the"
    " metric of project.",
    "extra compliance": "a compliance that is not positive leaves contact without a solution.",
    "gains energy": "friction dissipates: the traction on the body has the sign of the indenter's slip over it.",
    "tangent is not the derivative": "Newton's method converges by it; leave it out and differences serve.",
    "tangent": "Newton's method takes it as (n, 3, 3), rows of the traction, finite everywhere.",
    "kinks at most": "a law with kinks nearly everywhere has no derivative for Newton's method.",
    "tangential_scaling": "step sizes and the residual use it as the metric of project.",
    "changes its argument": "solvers keep the array, and go on with what the law left in it.",
    "changes what it gave before": "solvers keep the array they were given; hand out a new one each time.",
    "earlier calls": "a result has to follow from the case file alone.",
    "another shape": "one number for each node.",
    "negative or NaN": "a negative conductivity makes energy, NaN spreads.",
    "not across_gap": "solvers look at the gap and the drop only for laws that say so by across_gap = True.",
    "sign of the drop": "which body is the higher one is a matter of names; say rectifies=True of a law that tells them"
    " apart.",
    "flux falls": "a flux that falls while the drop grows leaves several solutions for the same potentials.",
    "jumps to infinity": "solvers treat perfect conduction apart and cannot switch to it on the way.",
    "conductivity jumps": "a jump leaves no solution where pressure, gap or drop is that of the jump; at zero traction"
    " it is allowed.",
    "tractions that project does not admit": "solvers stay near the solution by project, which has to hold all of it.",
    "is not monotone in its trial": "pressing harder presses harder: otherwise several pressures belong to one gap.",
    "depend on the step r": "the solution must not depend on the solver's step length r: resolve gives the traction t"
    " with t + r (tangential_scaling . G_tau(t), G_nu(t)) = trial.",
    "resolve is not monotone": "given slips have one traction only if slip grows with it.",
    "adhesion is negative": "it is an attraction; what presses surfaces apart belongs to resolve.",
    "at an infinite gap": "beside a punch nothing is there that could attract.",
    "overlapping surfaces": "the gaps of overlapping surfaces count as zero.",
    "adhesion jumps": "no solution has its gap at the jump; spread it over a width.",
    "attraction grows": "an attraction that grows with the gap is none of surfaces.",
    "does not use it": "load steps without a duration would be refused for nothing.",
    "does not return a contact law": "the solver goes on with what for_increment gives.",
    "changes the law itself": "laws are frozen: their memory is the slip path.",
    "needs none": "load steps need not say a duration then, and results would hang on whether they do.",
    "differs from the reference law": "a fast version is worth nothing if it solves another problem.",
    "friction depends on the direction": "an isotropic law commutes with every rotation.",
    "friction limit": "the coefficient is the limit of |t| / p along its axis.",
    "slip does not dissipate the most": "the associated rule (eq. 12) is that of maximum dissipation.",
    "not homogeneous": "without a stress of its own a law cannot know how large a pressure is.",
    "changes the problem": "later load steps solve on the same arrays.",
    "check refuses it": "a case file with the solver is refused before anything is computed; the body is rigid then.",
    "leaves its own solution": "load steps start from the state before.",
    "units": "answers and work must not depend on metres or millimetres; look for absolute numbers.",
    "converged, but": "a wrong answer must never be called converged.",
    "least squares": "the frictionless problem has one solution, found there without iteration on gaps.",
    "reference domain": "quadrature covers the reference domain, and nothing outside it.",
    "element has no name": "case files and results name it.",
    "no meshio cell type": "meshes are read and fields written with it.",
    "monomials": "N_n(node m) = delta_nm determines as many shape functions as there are monomials.",
    "exponents": "shape functions are polynomials; their derivatives are taken term by term.",
    "order must be": "a linear field has to be exact, or no refinement converges.",
    "first nodes must be the corners": "mesh generators, areas and pictures take the corners from there.",
    "hash": "tables of shape functions are found again by the element.",
    "shape functions": "a constant field has to be one: N_n is one at node n, zero at others, and they add up to one.",
    "order is overstated": "orders of convergence are judged by it.",
    "dN/dxi": "normals and areas follow from the derivatives.",
    "nodes off a side": "neighbours would not fit together: the surface had gaps.",
    "normal not upwards": "tractions take their sign from the outward normal: corners run counter-clockwise.",
    "wrong area": "resultants are integrals over elements.",
    "C-contiguous": "kernels of the assembly read the arrays in that order.",
    "order of the points": "assembly shares the points out over threads, in any order.",
    "no points": "assembly asks for none where an element has no far points.",
    "not symmetric": "the reciprocal theorem: U_JK = U_KJ.",
    "not even": "U depends on the distance along a line, not on its sense.",
    "not odd": "a source and its mirror image have opposite fluxes.",
    "not homogeneous of degree": "infinite space has no length: assembly works in units of its own.",
    "C : grad U": "the traction of the field U on the normal (eq. 47).",
    "differences of U": "U,q has to be the derivative of U, with respect to x and not x'.",
    "differential equation": "away from the source nothing acts: C_iJKm U_KL,mi = 0.",
    "flux through a sphere": "the source is a unit one, and this fixes sign and size of everything.",
    "differs from the reference": "the line integral is exact to round-off.",
}
"""Reasons why properties matter, by a fragment of their messages; the first match is shown."""


def require(holds: bool, message: str, value: object) -> None:
    """Raise AssertionError with the message, an offending value and the reason unless a property holds."""
    if not holds:
        raise AssertionError(f"{message}: {value}{_reason(message)}")


@contextmanager
def explained(subject: object) -> Iterator[None]:
    """Add the subject and the reason to assertions that fail in the block."""
    try:
        yield
    except AssertionError as error:
        has_reason = "why it matters" in str(error)
        raise AssertionError(f"{subject}: {error}{'' if has_reason else _reason(str(error))}") from None


def _reason(message: str) -> str:
    return next((f"\nwhy it matters: {why}" for fragment, why in REASONS.items() if fragment in message), "")


def each(holds: Any, message: str, arguments: NDArray[Any], result: Array) -> None:
    """Require a property at every node, booleans (n,); the message shows input and output at the first failure."""
    if not np.all(holds):
        node = int(np.argmin(holds))
        require(False, message, f"for {arguments[node]} it gives {result[node]}")


def close(actual: Array, expected: Array, scale: float, message: str) -> None:
    """Require that arrays agree to round-off relative to a scale."""
    error = np.abs(actual - expected).max(initial=0.0) / scale
    require(bool(error <= ROUND_OFF), message, error)


def check_frozen(record: object) -> None:
    """Require a frozen dataclass that is equal to its copy."""
    frozen = getattr(getattr(type(record), "__dataclass_params__", None), "frozen", False)
    require(frozen, "is no frozen dataclass", type(record).__name__)
    values = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}  # type: ignore[arg-type]
    require(type(record)(**values) == record, "is not equal to its copy", record)


def pure(function: Callable[[Array], Array], argument: Array, name: str) -> Array:
    """Return the value of a function that neither changes its argument nor depends on earlier calls."""
    original = argument.copy()
    value = function(argument)
    require(np.array_equal(argument, original), f"{name} changes its argument", argument)
    first = value.copy()
    function(0.5 * original[::-1])
    require(np.array_equal(value, first, equal_nan=True), f"{name} changes what it gave before", value)
    again = function(original)
    require(np.array_equal(again, first, equal_nan=True), f"{name} depends on earlier calls", again)
    return first
