"""Contact laws that violate their contract are rejected, and nodes that the approach never closes are handled."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError
from meeframe.contact.conduction import resistances
from meeframe.contact.problem import Iterate, Solver, Status
from meeframe.indenters import Placement
from meeframe.laws import Signorini
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.model.kinematics import IndenterKinematics
from meeframe.model.laws import check_tractions
from meeframe.model.load import load_case
from meeframe.model.solve import reduce
from meeframe.model.step import Step
from meeframe.plugin.hookspecs import Record
from meeframe.plugin.registry import Entry, Kind, Provider
from meeframe.solvers import Auto
from meeframe.solvers.gradient.uzawa import Uzawa
from meeframe.study.sweep.points import PointStatus, solved

N = 25
"""Nodes of the tiny case's zone."""


@dataclass(frozen=True)
class InvalidLaw(ContactLaw):
    """A frictionless law. `columns` of its traction, `later` of that after slip; `rows` of its scaling; `forgets` to
    return a law for an increment."""

    columns: int = 3
    rows: int = 2
    forgets: bool = False
    later: int | None = None

    def project(self, trial):
        return np.minimum(trial * [0.0, 0.0, 1.0], 0.0)[:, : self.columns]

    def tangential_scaling(self):
        return np.zeros((self.rows, 2))

    def for_increment(self, slip_path, duration):
        if self.forgets:
            return None
        return self if self.later is None or not slip_path.any() else InvalidLaw(self.later)


@pytest.fixture
def laws(registry):
    """Return the registry with the laws of this module."""
    entry = Entry(Kind.CONTACT_LAW, Record("unfit", InvalidLaw, "for tests", "none"), Provider("tests", "0"))
    return replace(registry, entries=(*registry.entries, entry))


@pytest.fixture
def case(write_case, registry):
    """Return the sphere on springs."""
    return load_case(write_case(), registry)


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("columns = 2", rf"project of the contact law InvalidLaw has shape \({N}, 2\); allowed: \({N}, 3\)"),
        ("rows = 1", r"tangential_scaling of the contact law InvalidLaw has shape \(1, 2\); allowed: \(2, 2\)"),
        ("forgets = true", "for_increment of the contact law InvalidLaw returns None; allowed: a contact law"),
    ],
)
def test_invalid_laws_are_reported_at_their_key(write_case, laws, key, text):
    with pytest.raises(CaseError, match=rf"contact\.law: {text}"):
        load_case(write_case(more=f'\n[contact]\nlaw = {{name = "unfit", {key}}}\n'), laws)
    assert load_case(write_case(more='\n[contact]\nlaw = "unfit"\n'), laws).contact_law == InvalidLaw()


@dataclass(frozen=True)
class ModifiesTrial(Signorini):
    """A law that modifies its argument."""

    def project(self, trial):
        np.minimum(trial[:, 2], 0.0, out=trial[:, 2])
        trial[:, :2] = 0.0
        return trial


def test_law_that_modifies_its_argument_is_rejected(case):
    with pytest.raises(CaseError, match="project of the contact law ModifiesTrial changes its argument"):
        replace(case, contact_law=ModifiesTrial())


@dataclass(frozen=True)
class Overwriting(Signorini, ConductivityLaw):
    """A law that zeroes the first argument of `method`, or its gap."""

    method: str = ""
    argument: int = 0

    def resolve(self, trial, gap, r):
        return self._spoil("resolve", self.project(trial), trial, gap)

    def tangent(self, trial):
        return self._spoil("tangent", np.zeros((len(trial), 3, 3)), trial)

    def conductivity(self, normal_traction, gap, drop):
        return self._spoil("conductivity", np.zeros_like(gap), normal_traction, gap, drop)

    def _spoil(self, method, made, *given):
        if method == self.method:
            given[self.argument][...] = 7.0
        return made


@pytest.mark.parametrize(("method", "argument"), [("resolve", 0), ("resolve", 1), ("tangent", 0)])
def test_no_method_may_modify_its_arguments(case, method, argument):
    assert replace(case, contact_law=Overwriting()).contact_law == Overwriting()
    with pytest.raises(CaseError, match=f"{method} of the contact law Overwriting changes its argument"):
        replace(case, contact_law=Overwriting(method, argument))


@pytest.mark.parametrize("argument", [0, 1, 2])
def test_conductivities_may_not_modify_their_arguments(case, argument):
    with pytest.raises(CaseError, match="conductivity of the conductivity law Overwriting changes its arguments"):
        replace(case, conductivity={"electric": Overwriting("conductivity", argument)})


@dataclass(frozen=True)
class Constant(ConductivityLaw):
    """A law that returns kappa for all arguments."""

    kappa: object

    def conductivity(self, normal_traction, gap, drop):
        return np.asarray(self.kappa) * np.ones_like(normal_traction) if self.kappa else self.kappa


@pytest.mark.parametrize(
    ("kappa", "text"),
    [
        (None, rf"returns None; allowed: an array of real numbers of shape \({N},\)"),
        (1j, rf"returns an array of complex128; allowed: an array of real numbers of shape \({N},\)"),
        (((1.0,), (2.0,)), rf"has shape \(2, {N}\); allowed: \({N},\)"),
    ],
)
@pytest.mark.parametrize("field", ["electric", "magnetic"])
def test_invalid_conductivities_are_rejected_early(case, field, kappa, text):
    with pytest.raises(CaseError, match=f"conductivity of the conductivity law Constant {text}"):
        replace(case, conductivity={field: Constant(kappa)})


@dataclass(frozen=True)
class Decreasing(ConductivityLaw):
    """kappa = 1e-6 (1 - pressure / limit), and above the limit that or another number."""

    limit: float
    beyond: float | None = None

    def conductivity(self, normal_traction, gap, drop):
        kappa = 1e-6 * (1.0 + normal_traction / self.limit)
        return kappa if self.beyond is None else np.where(normal_traction < -self.limit, self.beyond, kappa)


TOLD = (
    r"conductivity\.electric: .* law Decreasing is (-.*|nan) under a normal traction of -\d.* Pa[;,] allowed: numbers"
)


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("beyond", [None, np.nan, -np.inf])
@pytest.mark.parametrize("solver", [Auto(), Uzawa()])
def test_conductivities_are_checked_where_the_case_needs_them(case, solver, beyond):
    """The pressure under the sphere is 1 GPa; a law must return conductivities up to there only."""
    case = replace(case, solver=solver, potentials={"electric_potential": 100.0})
    (step,) = meeframe.solve_case(replace(case, conductivity={"electric": Decreasing(1e10, beyond)})).steps
    assert step.status is Status.CONVERGED
    with pytest.raises(CaseError, match=TOLD):
        meeframe.solve_case(replace(case, conductivity={"electric": Decreasing(1e8, beyond)}))


@pytest.mark.parametrize("solver", [Auto(), Uzawa()])
def test_intermediate_states_are_reported_and_not_evaluated(case, solver):
    """Resistances become negative above 0.1 GPa: the iteration ends at the limit before they affect the results."""
    stopping = replace(case.stopping, max_iterations=1)
    case = replace(
        case,
        solver=solver,
        stopping=stopping,
        potentials={"electric_potential": 100.0},
        conductivity={"electric": Decreasing(1e8)},
    )
    (step,) = meeframe.solve_case(case).steps
    assert step.status is not Status.CONVERGED
    assert np.isfinite(step.traction).all()
    assert re.search(TOLD, step.message)


@dataclass(frozen=True)
class Diverging(Solver):
    """A solver whose loads are NaN after a step to `pressure` [Pa]."""

    pressure: float

    def init(self, problem, start, tolerance=1e-10):
        return Iterate(np.zeros((N, 5)), np.zeros(N))

    def step(self, problem, iterate):
        load = np.full((N, 5), np.nan)
        if not iterate.load.any():
            load = np.zeros((N, 5))
            load[:, 2] = -self.pressure
            resistances(problem, load[:, 2], np.ones(N), np.ones((N, 2)))
        return Iterate(load, np.ones(N))


@dataclass(frozen=True)
class UndefinedAbove(ConductivityLaw):
    """A law that returns NaN at pressures that no case reaches."""

    def conductivity(self, normal_traction, gap, drop):
        return np.where(normal_traction < -1e14, np.nan, 1e-6 * (normal_traction < 0.0))


@pytest.mark.parametrize(
    ("law", "pressure", "message", "refused"),
    [
        (Decreasing(1e8), 1e6, False, False),
        (Decreasing(1e8), 1e9, True, True),
        (Decreasing(1e8, np.nan), 1e9, True, True),
        (Decreasing(1e8), 1e13, True, False),
        (Decreasing(1e8, np.nan), 1e13, True, False),
        (UndefinedAbove(), 1e9, False, False),
    ],
)
def test_divergence_is_not_attributed_to_a_law(case, law, pressure, message, refused):
    """The law is responsible only if it returns no conductivity at a pressure of the problem, here 1 GPa."""
    case = replace(
        case, solver=Diverging(pressure), potentials={"electric_potential": 100.0}, conductivity={"electric": law}
    )
    if refused:
        with pytest.raises(CaseError, match=TOLD):
            meeframe.solve_case(case)
        assert solved(case, [reduce(case)]).status is PointStatus.REFUSED
        return
    (step,) = meeframe.solve_case(case).steps
    assert step.status is Status.DIVERGED
    assert "not a finite number at iteration 2" in step.message
    assert bool(re.search(TOLD, step.message)) is message
    outcome = solved(case, [reduce(case)])
    assert outcome.status is PointStatus.NOT_CONVERGED
    assert outcome.message == step.message


@dataclass(frozen=True)
class WithReturnValue(Signorini):
    """Signorini's law with a replaced return value of `method`."""

    method: str = ""
    returns: Callable[[np.ndarray], object] = lambda array: array

    def _returned(self, method, right):
        return self.returns(right) if method == self.method else right

    def project(self, trial):
        return self._returned("project", super().project(trial))

    def tangential_scaling(self):
        return self._returned("tangential_scaling", np.zeros((2, 2)))

    def resolve(self, trial, gap, r):
        return self._returned("resolve", super().project(trial))

    def adhesion(self, gap):
        return self._returned("adhesion", np.zeros(len(gap)))

    def initial_gap(self, points):
        return self._returned("initial_gap", np.zeros(len(points)))

    def tangent(self, trial):
        return self._returned("tangent", np.zeros((len(trial), 3, 3)))

    def tangents(self, trial, gap, r):
        here = self._returned("by trial", np.zeros((len(trial), 3, 3)))
        return self._returned("tangents", (here, self._returned("by gap", np.zeros((len(trial), 3, 3)))))


SHAPES = {
    "project": (N, 3),
    "tangential_scaling": (2, 2),
    "resolve": (N, 3),
    "adhesion": (N,),
    "tangent": (N, 3, 3),
    "by trial": (N, 3, 3),
    "by gap": (N, 3, 3),
}


@pytest.mark.parametrize("method", [*SHAPES, "initial_gap"])
def test_return_values_are_checked_early(case, method):
    assert replace(case, contact_law=WithReturnValue()).contact_law == WithReturnValue()
    shape = SHAPES.get(method, (N,))
    what = "tangents of the contact law WithReturnValue, " + method + "," if method.startswith("by") else method
    what = "the initial gap" if method == "initial_gap" else what
    for returns, text in [
        (lambda array: array[..., :1], f"has shape {(*shape[:-1], 1)}; allowed: {shape}"),
        (lambda array: array.tolist(), f"returns a list; allowed: an array of real numbers of shape {shape}"),
        (lambda _: None, f"returns None; allowed: an array of real numbers of shape {shape}"),
        (np.ma.masked_array, f"returns a MaskedArray; allowed: an array of real numbers of shape {shape}"),
        (lambda array: array.astype(str), "returns an array of <U"),
    ]:
        with pytest.raises(CaseError, match=f"^{what}.*{re.escape(text)}"):
            replace(case, contact_law=WithReturnValue(method, returns))


@pytest.mark.parametrize(
    ("returns", "text"),
    [
        (lambda pair: np.concatenate(pair), "returns an array of float64; allowed: two arrays, by trial and by gap"),
        (lambda pair: (*pair, pair[0]), "returns a tuple; allowed: two arrays"),
        (lambda _: None, "returns None; allowed: two arrays"),
    ],
)
def test_tangents_are_two_arrays(case, returns, text):
    with pytest.raises(CaseError, match=f"tangents of the contact law WithReturnValue {text}"):
        replace(case, contact_law=WithReturnValue("tangents", returns))


@pytest.mark.parametrize("method", ["project", "resolve", "tangent", "by trial", "by gap"])
def test_laws_must_be_finite_for_finite_tractions(case, method):
    """The law returns NaN without pressure."""

    def returns(array):
        spoilt = array.copy()
        spoilt[4::5] = np.nan
        return spoilt

    with pytest.raises(CaseError, match=r" is nan at a trial traction of \(0, 0, 0\) Pa; allowed: finite numbers"):
        replace(case, contact_law=WithReturnValue(method, returns))


@pytest.mark.parametrize("number", [np.nan, np.inf])
@pytest.mark.parametrize(("method", "where"), [("tangential_scaling", ""), ("adhesion", " at a gap of 0 m")])
def test_laws_must_return_finite_numbers(case, method, where, number):
    with pytest.raises(
        CaseError, match=f"^{method} of the contact law WithReturnValue is {number}{where}; allowed: finite numbers"
    ):
        replace(case, contact_law=WithReturnValue(method, lambda array: array + number))


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_small_zones_evaluate_every_traction(n):
    """The law returns NaN without pressure."""

    @dataclass(frozen=True)
    class Nan(Signorini):
        def project(self, trial):
            return np.where(trial.any(axis=1, keepdims=True), super().project(trial), np.nan)

    check_tractions(Signorini(), n)
    with pytest.raises(CaseError, match=r" is nan at a trial traction of \(0, 0, 0\) Pa; allowed: finite numbers"):
        check_tractions(Nan(), n)


def test_law_that_becomes_invalid_is_rejected(case):
    """By the second increment nodes have slipped, because the indenter slides over a frictionless surface."""
    steps = (Step(approach=1e-5), Step(translation=(1e-6, 0.0), increments=2))
    slides = replace(case, contact_law=InvalidLaw(later=2), steps=steps)
    with pytest.raises(CaseError, match=rf"project of the contact law InvalidLaw has shape \({N}, 2\)"):
        meeframe.solve_case(slides)


@dataclass(frozen=True)
class Film(Signorini):
    """A film of uniform thickness."""

    def initial_gap(self, points):
        return np.full(len(points), -1e-6)


@pytest.mark.parametrize("slope", [0.0, -0.05])
def test_nodes_that_the_approach_does_not_close_do_not_define_first_contact(case, slope):
    """The normal of one node leans towards a tilted sphere, which moves along its axis and not towards that node."""
    tilted = replace(case, placement=Placement(tilt_2=0.2))
    system = reduce(tilted)
    frames = system.frames.copy()
    node = int(np.argmin(system.points[:, 0]))
    sine = np.sqrt(1.0 - slope**2)
    frames[node] = np.array([[slope, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, slope]])
    leaning = replace(system, frames=frames)
    gap = IndenterKinematics(tilted, leaning).touching_gap
    assert np.isfinite(gap[node]), "the tilted sphere is met"
    filmed = IndenterKinematics(replace(tilted, contact_law=Film()), leaning).touching_gap
    flat = np.arange(N) != node
    expected = IndenterKinematics(replace(tilted, contact_law=Film()), system).touching_gap
    np.testing.assert_allclose(filmed[flat], expected[flat], rtol=1e-12, atol=1e-18)
    assert np.isfinite(filmed).all()
