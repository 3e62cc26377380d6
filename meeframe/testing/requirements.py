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
    "no frozen dataclass": "its fields are the keys of the case file, and mutable records make results irreproducible.",
    "not equal to its copy": "caches of reduced systems and kernels are looked up by equal records.",
    "changes the shape": "the result has one traction vector for each node.",
    "not finite": "one such number spreads to all nodes in the next product with the compliance.",
    "normal traction pulls": "t_nu <= 0 in compression (eq. 10): without adhesion the contact transmits no tension.",
    "traction where the trial is open": "the gap is open there and transmits no traction (eq. 11).",
    "no indenter above": "the gap beside a punch is infinite; inf times zero must not become NaN.",
    "not idempotent": "a projection leaves admissible tractions unchanged; otherwise no state satisfies the law.",
    "other nodes": "the law is local: solvers evaluate it on subsets of the nodes.",
    "expansive": "solvers converge because the projection is nonexpansive in the metric defined by tangential_scaling"
    " (docs/explanation/theory.md, Set and metric).",
    "does not become stationary": "under constant slip the traction must converge; otherwise no solver can.",
    "depends on the step": "the solution must not depend on the solver's step length r: use tangential_scaling as the"
    " metric of project.",
    "extra compliance": "without a positive compliance the contact problem may have no solution.",
    "gains energy": "friction dissipates energy: the traction on the body points along the slip of the indenter.",
    "tangential_scaling": "step lengths and the residual use it as the metric of project.",
    "tangent is not the derivative": "Newton's method uses it; without tangent it uses finite differences.",
    "tangent": "Newton's method needs finite derivatives of shape (n, 3, 3), with one row for each traction component.",
    "kinks at most": "Newton's method needs a law that is differentiable almost everywhere.",
    "changes its argument": "solvers use the array again after the call.",
    "changes what it gave before": "solvers store the returned array; return a new array at each call.",
    "earlier calls": "results must be determined by the case file alone.",
    "another shape": "the result has one number for each node.",
    "negative or NaN": "a negative conductivity generates energy, and NaN spreads to all nodes.",
    "not across_gap": "solvers compute the gap and the drop only for laws with across_gap = True.",
    "sign of the drop": "the bodies are interchangeable; pass rectifies=True for a law that depends on the sign.",
    "wear rate is not finite": "one such number spreads to all nodes in the next product with the compliance.",
    "wear rate is negative": "wear removes material; what adheres is not described by this contract.",
    "without pressure": "open surfaces do not wear.",
    "wear rate depends on the speed": "load steps may then omit the duration, and results must not depend on it.",
    "wear rate falls": "the pressure at the end of an increment must be unique.",
    "wear rate jumps": "there is no solution at the jump; replace it by a steep slope.",
    "flux falls": "if the flux decreases while the drop increases, the same potentials have several solutions.",
    "jumps to infinity": "solvers treat perfect conduction separately and cannot switch to it during the iteration.",
    "conductivity jumps": "there is no solution at the jump; a jump at zero traction is allowed.",
    "tractions that project does not admit": "solvers project iterates; project must admit every solution of resolve.",
    "is not monotone in its trial": "otherwise one gap has several pressures.",
    "depend on the step r": "the solution must not depend on the solver's step length r: resolve gives the traction t"
    " with t + r (tangential_scaling . G_tau(t), G_nu(t)) = trial.",
    "resolve is not monotone": "the traction of a slip is unique only if the slip increases with the traction.",
    "adhesion is negative": "adhesion is an attraction; repulsion belongs in resolve.",
    "at an infinite gap": "beside a punch there is no surface that could attract.",
    "overlapping surfaces": "the gaps of overlapping surfaces count as zero.",
    "adhesion jumps": "at the gap of a jump there is no solution; replace the jump by a steep slope.",
    "attraction grows": "the attraction of surfaces does not grow with the gap between them.",
    "does not use it": "load steps without a duration would be rejected without need.",
    "does not return a contact law": "the solver uses the law that for_increment returns.",
    "changes the law itself": "laws are frozen; the slip path is their only memory.",
    "needs none": "load steps may then omit the duration, and results must not depend on it.",
    "differs from the reference law": "a faster implementation must describe the same law.",
    "friction depends on the direction": "an isotropic law commutes with every rotation.",
    "friction limit": "the coefficient is the limit of |t| / p along its axis.",
    "slip does not dissipate the most": "the associated rule (eq. 12) is that of maximum dissipation.",
    "not homogeneous": "a law without a characteristic stress is homogeneous of degree one.",
    "changes the problem": "later load steps use the same arrays.",
    "check refuses it": "check runs before the body is reduced, with a placeholder system whose compliance is zero.",
    "leaves its own solution": "each load step starts from the solution of the step before.",
    "units": "results and iterations must not depend on the units; look for absolute tolerances.",
    "converged, but": "an inaccurate state must not be reported as converged.",
    "least squares": "the frictionless solution is unique; nonnegative least squares compute it independently.",
    "on a half space": "a large block responds as a half space. A formulation for other bodies is checked by a body and"
    " an exact field that its Record names by check_arguments (docs/howto/fast-formulation.md, Conformance).",
    "reference domain": "quadrature points lie in the reference domain.",
    "element has no name": "case files and results refer to elements by name.",
    "no meshio cell type": "meshes are read and fields are written by meshio.",
    "monomials": "N_n(node m) = delta_nm needs as many monomials as nodes.",
    "exponents": "shape functions are polynomials with nonnegative integer exponents.",
    "order must be": "linear fields must be exact; otherwise refinement does not converge.",
    "first nodes must be the corners": "mesh generators, areas and figures take the corners from the first nodes.",
    "hash": "tables of shape functions are cached by element.",
    "shape functions": "N_n is one at node n and zero at the others, and their sum is one.",
    "order is overstated": "tests of convergence orders use it.",
    "dN/dxi": "normals and areas are computed from the derivatives.",
    "nodes off a side": "neighbouring elements share the nodes of a side only; otherwise the surface has gaps.",
    "normal not upwards": "corners run counter-clockwise, so that the normal points outwards.",
    "wrong area": "resultants are integrals over the elements.",
    "C-contiguous": "compiled kernels need arrays in this order.",
    "order of the points": "assembly distributes the points over threads in any order.",
    "no points": "assembly evaluates empty sets of points for elements without far points.",
    "not symmetric": "the reciprocal theorem: U_JK = U_KJ.",
    "not even": "U(-x) = U(x).",
    "not odd": "T(-x) = -T(x) for the same normal.",
    "not homogeneous of degree": "infinite space has no length scale, and assembly uses dimensionless coordinates.",
    "C : grad U": "the traction of the field U on the normal (eq. 47).",
    "differences of U": "gradient must be the derivative of U with respect to x, not x'.",
    "differential equation": "away from the source the equilibrium equations are homogeneous: C_iJKm U_KL,mi = 0.",
    "flux through a sphere": "the source has unit strength, which fixes sign and magnitude of U and T.",
    "differs from the reference": "the line integral is exact to round-off.",
}
"""Reasons why properties matter, by a fragment of their messages: the earliest match counts, of several the longest."""


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
    matches = [fragment for fragment in REASONS if fragment in message]
    best = min(matches, key=lambda fragment: (message.index(fragment), -len(fragment)), default=None)
    return "" if best is None else f"\nwhy it matters: {REASONS[best]}"


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
