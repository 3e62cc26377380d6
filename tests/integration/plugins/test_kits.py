"""The conformance kits name the violated property, the input and the reason; wrong formulations and indenters are
detected."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numba import njit

import meeframe.testing as kits
from meeframe.common.errors import CaseError
from meeframe.contact.problem import Solver
from meeframe.elements import Quad4
from meeframe.formulations.base import Formulation, PersistentFormulation
from meeframe.indenters.base import Indenter
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw, is_conducting
from meeframe.material import library_material
from meeframe.mesh import block_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.plugin.registry import Kind, load
from meeframe.plugin.scaffold import new_plugin
from meeframe.solvers import SemismoothNewton
from meeframe.system.capabilities import Persistence
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import ReducedSystem, silent
from meeframe.testing.manufactured import LinearField
from meeframe.testing.requirements import REASONS, require


def test_all_kits_exist():
    for name in kits.__all__:
        assert getattr(kits, name).__name__ == name
    with pytest.raises(AttributeError, match="check_nothing"):
        _ = kits.check_nothing
    assert dir(kits) == sorted(kits.__all__)


@pytest.mark.parametrize("fragment", REASONS)
def test_each_message_has_its_reason(fragment):
    """No fragment hides that of another property, as `tangent` would hide `tangential_scaling`."""
    with pytest.raises(AssertionError) as caught:
        require(False, fragment, 0)
    assert str(caught.value).endswith(f"why it matters: {REASONS[fragment]}")


def test_reason_is_that_of_the_property_named_first():
    with pytest.raises(AssertionError, match="why it matters: solvers converge because"):
        require(False, "project is expansive in the metric of tangential_scaling", 0)


@njit(cache=True, nogil=True)
def _return_to_cone(trial, mu):
    traction = np.zeros_like(trial)
    for node in range(len(trial)):
        pressure = -min(trial[node, 2], 0.0)
        size = np.hypot(trial[node, 0], trial[node, 1])
        factor = mu * pressure / size if size > mu * pressure else 1.0
        traction[node, 0], traction[node, 1], traction[node, 2] = (
            factor * trial[node, 0],
            factor * trial[node, 1],
            -pressure,
        )
    return traction


@dataclass(frozen=True)
class CompiledCoulomb(ContactLaw):
    """Compiled Coulomb friction as described on docs/howto/plugins.md."""

    mu: float

    def project(self, trial):
        return _return_to_cone(np.ascontiguousarray(trial), self.mu)

    def tangential_scaling(self):
        return np.eye(2)


def test_compiled_law_agrees_with_plain_law():
    kits.check_contact_law(CompiledCoulomb(0.3), reference=IsotropicCoulomb(0.3))
    with pytest.raises(AssertionError, match="differs from the reference law") as caught:
        kits.check_contact_law(CompiledCoulomb(0.3), reference=IsotropicCoulomb(0.3001))
    assert "why it matters: a faster implementation must describe the same law" in str(caught.value)


@dataclass(frozen=True)
class ZeroOverZero(ContactLaw):
    """Correct except for trials without tangential component."""

    def project(self, trial):
        normal = np.minimum(trial[:, 2:], 0.0)
        size = np.linalg.norm(trial[:, :2], axis=1, keepdims=True)
        with np.errstate(all="ignore"):
            factor = np.where(normal < 0.0, np.minimum(-0.3 * normal / size, 1.0 + 0.0 * size / size), 0.0)
        return np.hstack([trial[:, :2] * factor, normal])

    def tangential_scaling(self):
        return np.eye(2)


def test_hypothesis_finds_the_simplest_trial():
    with pytest.raises(AssertionError) as caught:
        kits.check_contact_law(ZeroOverZero())
    text = str(caught.value)
    assert re.match(r"project gives tractions that are not finite: for \[ *-?0\. +-?0\. +-1", text)
    assert "why it matters: one such number spreads" in text


@dataclass(frozen=True)
class Raised(Indenter):
    """Heights that are raised by a constant."""

    drop: float = 0.0

    def height(self, x, y):
        return x**2 + y**2 + self.drop


@dataclass(frozen=True)
class NonlocalHeights(Indenter):
    """Heights that depend on the other requested points."""

    def height(self, x, y):
        return x**2 - (x**2).min() + y**2 * (1 + len(x))


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(
    ("indenter", "message"),
    [
        (Raised(-1e-9), "negative or NaN, though approaches count from the lowest point: -1e-09 at x, y = 0, 0 m"),
        (Raised(1.0), "no height near zero"),
        (Raised(float("nan")), "height is negative or NaN"),
        (NonlocalHeights(), "height depends on other points"),
    ],
)  # fmt: skip
def test_wrong_indenters_are_detected(indenter, message):
    kits.check_indenter(Raised())
    with pytest.raises(AssertionError, match=message):
        kits.check_indenter(indenter)


THICKNESS = 0.02


@pytest.fixture(scope="module")
def layer(tmp_path_factory):
    """Return a formulation, a body and an exact field, as in a new package."""
    folder = new_plugin(Kind.FORMULATION, "layer", load(), tmp_path_factory.mktemp("layer"))
    formulation = load(folder / "meeframe_layer.py").create(Kind.FORMULATION, {"name": "layer", "thickness": THICKNESS})
    stiffness = library_material("batio3-cofe2o4").stiffness
    gradient = LinearField.random(stiffness, seed=3).gradient * [0.0, 0.0, 1.0]
    field = LinearField(stiffness, gradient, np.array([1e-5, -2e-5, 3e-5, 4.0, 5e-3]))
    values = field.values(np.array([[0.0, 0.0, -THICKNESS]]))[0]
    held = tuple(BoundaryCondition("base", number, "value", float(value)) for number, value in enumerate(values))
    return formulation, Body(stiffness, block_mesh(0.05, THICKNESS, 0.03, 3, 2, 1, Quad4()), held, "contact"), field


def rotated(frames):
    return frames[:, [1, 0, 2]]


@dataclass(frozen=True)
class Indefinite(ReducedSystem):
    """A system whose compliance is not positive definite."""

    inner: ReducedSystem

    def apply(self, load):
        answer = self.inner.apply(load)
        return answer * (1 + 1e-3 * np.abs(answer).max())

    def diagonal_blocks(self):
        return self.inner.diagonal_blocks()

    def dense(self):
        return None

    def recover(self, load):
        return self.inner.recover(load)


def indefinite(system):
    parts = {name: getattr(system, name) for name in ("points", "frames", "weights", "cells", "offset")}
    return Indefinite(**parts, inner=replace(system, matrix=1e3 * system.matrix))


def shifted(system):
    """Return a system that recovers the fields of another load."""
    return replace(system, recovery=lambda load: system.recover(1.01 * load))


def unsymmetric(matrix):
    """Return a system in which reciprocity between e1 and e2 fails at each node."""
    matrix = matrix.copy()
    nodes = range(len(matrix))
    matrix[nodes, 0, nodes, 1] += 0.5 * matrix[nodes, 0, nodes, 0]
    return matrix


SPOILT = {
    "frames are not orthonormal": lambda s, _: replace(s, frames=rotated(s.frames)),
    "is not the outward normal": lambda s, _: replace(s, frames=s.frames * np.array([[1.0], [-1.0], [-1.0]])),
    "weights do not add up": lambda s, _: replace(s, weights=2 * s.weights),
    "lies outside the contact zone": lambda s, _: replace(s, points=s.points + np.array([0.0, 0.0, 1e-3])),
    "offset is not finite": lambda s, _: replace(s, offset=s.offset[:, :3]),
    "apply is not linear": lambda s, _: indefinite(s),
    "the offset is not zero though": lambda s, _: replace(s, offset=s.offset + 1e-6),
    "the compliance depends on the prescribed data": lambda s, b: replace(
        s, matrix=s.matrix * (1 + b.conditions[3].data)
    ),
    "is not reproduced in u.nu": lambda s, _: replace(
        s, matrix=s.matrix * np.array([1.0, 1, 1.01, 1, 1])[:, None, None]
    ),
    "is not reproduced in -phi": lambda s, _: replace(s, offset=s.offset * [1.0, 1, 1, -1, 1]),
    "a load gains energy": lambda s, _: replace(s, matrix=-s.matrix),
    "reciprocal theorem": lambda s, _: replace(s, matrix=unsymmetric(s.matrix)),
    "recover has other values on the zone": lambda s, _: shifted(s),
}


@dataclass(frozen=True)
class Altered(PersistentFormulation):
    """A correct formulation whose system, or system from arrays, is modified."""

    inner: Formulation
    change: Callable[[DenseSystem, Body], ReducedSystem]
    restore: Callable[[DenseSystem, Mapping], ReducedSystem] | None = None

    def check(self, body):
        self.inner.check(body)

    def reduce(self, body, progress=silent):
        return self.change(self.inner.reduce(body, progress), body)

    def from_arrays(self, body, arrays):
        return self.restore(self.inner.reduce(body), arrays)


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("fault", SPOILT)
def test_wrong_formulations_are_detected(layer, fault):
    formulation, body, field = layer
    loose = fault in ("a load gains energy", "reciprocal theorem")
    kits.check_formulation(formulation, body, field, tolerance=1e-9)
    with pytest.raises(AssertionError, match=fault):
        kits.check_formulation(Altered(formulation, SPOILT[fault]), body, field, tolerance=10.0 if loose else 1e-9)


@dataclass(frozen=True, eq=False)
class Stored(ReducedSystem, Persistence):
    """A system that stores its offset and has no matrix."""

    inner: DenseSystem

    def apply(self, load):
        return self.inner.apply(load)

    def diagonal_blocks(self):
        return self.inner.diagonal_blocks()

    def dense(self):
        return None

    def recover(self, load):
        return self.inner.recover(load)

    def to_arrays(self):
        return {"offset": self.offset}


def stored(system):
    return Stored(system.points, system.frames, system.weights, system.cells, system.offset, system)


FROM_ARRAYS = {
    "weights": lambda s, k: stored(replace(s, weights=2 * s.weights, offset=k["offset"])),
    "apply": lambda s, k: stored(replace(s, matrix=2 * s.matrix, offset=k["offset"])),
}


@pytest.mark.parametrize("fault", FROM_ARRAYS)
def test_systems_wrongly_restored_from_arrays_are_detected(layer, fault):
    formulation, body, field = layer
    right = Altered(formulation, lambda s, _: stored(s), lambda s, k: stored(replace(s, offset=k["offset"])))
    kits.check_formulation(right, body, field, tolerance=1e-9)
    with pytest.raises(AssertionError, match=f"{fault} changes when restored from arrays"):
        kits.check_formulation(replace(right, restore=FROM_ARRAYS[fault]), body, field, tolerance=1e-9)


@dataclass(frozen=True)
class AcceptsEverything(Formulation):
    """A formulation that rejects nothing."""

    inner: Formulation

    def check(self, body):
        pass

    def reduce(self, body, progress=silent):
        return self.inner.reduce(body, progress)


def test_formulation_must_reject_unsupported_bodies(layer):
    formulation, body, field = layer
    with pytest.raises(AssertionError, match="check accepts an unknown face group"):
        kits.check_formulation(AcceptsEverything(formulation), body, field)


def test_layer_fails_the_half_space_check(layer):
    formulation, body, _ = layer
    with pytest.raises(AssertionError, match=r"relative error \(allowed: 0.05\): 1\nwhy it matters: .*check_arguments"):
        kits.check_indentation(formulation, body)


def test_wrong_shapes_are_reported_before_contact_is_solved(layer):
    formulation, body, _ = layer
    with pytest.raises(AssertionError, match="offset is not finite"):
        kits.check_indentation(Altered(formulation, SPOILT["offset is not finite"]), body)


def test_frictionless_law_conforms():
    kits.check_contact_law(Signorini(), reference=IsotropicCoulomb(0.0))


@dataclass(frozen=True)
class Notched(Indenter):
    """An indenter without height on a single line, which random points miss."""

    def height(self, x, y):
        return np.where((x == y) & (x != 0.0), np.nan, x**2 + y**2)


def test_hypothesis_finds_the_line_without_height():
    with pytest.raises(AssertionError, match=r"height is negative or NaN.*: for \[(\S+) \1\] it gives nan"):
        kits.check_indenter(Notched())


@dataclass(frozen=True)
class FailsWithoutContact(Solver):
    """A solver that fails only where there is no contact."""

    inner: Solver = field(default_factory=SemismoothNewton)

    def init(self, problem, start, tolerance=1e-10):
        return self.astray(problem, self.inner.init(problem, start))

    def step(self, problem, iterate):
        return self.astray(problem, self.inner.step(problem, iterate))

    def astray(self, problem, iterate):
        return iterate if (problem.gap < 0.0).any() else replace(iterate, load=np.nan * iterate.load)


@pytest.mark.full
def test_hypothesis_finds_the_problem_that_a_solver_fails_on():
    with pytest.raises(
        AssertionError, match=r"(?s)indentation .*'approach': (-1e-05|0\.0|1e-06).*the worst condition is"
    ):
        kits.check_solver(FailsWithoutContact())


@dataclass(frozen=True)
class RejectsTooMuch(Solver):
    """A solver that solves everything, but rejects conduction or rigid bodies."""

    refuses: str
    inner: Solver = field(default_factory=SemismoothNewton)

    def check(self, problem):
        if self.refuses == "conduction" and is_conducting(problem.law_of("electric")):
            raise CaseError("solver 'picky' is for insulated contact")
        if self.refuses == "rigid bodies" and not problem.system.diagonal_blocks().any():
            raise ZeroDivisionError("no compliance")

    def init(self, problem, start, tolerance=1e-10):
        return self.inner.init(problem, start)

    def step(self, problem, iterate):
        return self.inner.step(problem, iterate)


@pytest.mark.parametrize(
    ("refuses", "reported"),
    [
        ("conduction", "conducting: check refuses it: CaseError: solver 'picky' is for insulated contact"),
        ("rigid bodies", "insulated on a rigid body: check refuses it: ZeroDivisionError: no compliance"),
    ],
)
def test_overly_strict_checks_are_detected(refuses, reported):
    with pytest.raises(AssertionError, match=f"{reported}\nwhy it matters: check runs before the body is reduced"):
        kits.check_solver(RejectsTooMuch(refuses))


def gains_energy(system, _body):
    """Return a system that gains energy from uniform electric charges only."""
    matrix = system.matrix.copy()
    # the response to charges of one sign is reversed; reciprocity still holds
    own = np.einsum("n,nm->", system.weights, matrix[:, 3, :, 3]) / system.weights.sum() ** 2
    matrix[:, 3, :, 3] -= 1.01 * own * system.weights
    return replace(system, matrix=matrix)


def test_hypothesis_finds_a_load_that_gains_energy(layer):
    formulation, body, field = layer
    with pytest.raises(
        AssertionError, match=r"(?s)a load gains energy.*fields \(0\.0, 0\.0, 0\.0, -?1\.0, 0\.0\), shape 0: work -"
    ):
        kits.check_formulation(Altered(formulation, gains_energy), body, field, tolerance=10.0)
