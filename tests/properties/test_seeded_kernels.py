"""The conformance checks name the fault of elements and fundamental solutions that are each wrong in one way."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from meeframe.elements import ELEMENTS, Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array
from meeframe.greens import LineIntegral
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.material import library_material, rotation_about
from meeframe.testing import check_element, check_fundamental_solution
from meeframe.testing.strategies import scaled_stiffness

POINT = r"for \[ *-?\d.*\] it gives"


@dataclass(frozen=True)
class Element(SurfaceElement):
    """An element with some properties of another one."""

    correct: SurfaceElement
    changed: tuple[tuple[str, Any], ...] = ()

    def part(self, name: str) -> Any:
        return dict(self.changed).get(name, getattr(self.correct, name))

    name = property(lambda self: self.part("name"))
    meshio_type = property(lambda self: self.part("meshio_type"))
    reference = property(lambda self: self.part("reference"))
    order = property(lambda self: self.part("order"))
    nodes = property(lambda self: self.part("nodes"))
    exponents = property(lambda self: self.part("exponents"))

    def __hash__(self) -> int:
        return hash(type(self))

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other)


def element(correct: SurfaceElement, **changed: Any) -> SurfaceElement:
    """Return an element of a separate class, so that objects created without arguments are equal to it."""

    class Changed(Element):
        def __init__(self) -> None:
            super().__init__(correct, tuple(changed.items()))

    return Changed()


def wilson() -> SurfaceElement:
    """Return an incompatible element of first order."""
    nodes, exponents = np.vstack([Quad4().nodes, [[0.0, 0.0]]]), np.vstack([Quad4().exponents, [[2.0, 0.0]]])
    return element(Quad4(), nodes=nodes, exponents=exponents)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (element(Quad8(), name=""), "the element has no name"),
        (element(Quad8(), exponents=Quad8().exponents[:7]), "as many monomials as nodes"),
        (element(Quad4(), nodes=Quad4().nodes[::-1]), "the first nodes must be the corners"),
        (element(Tri3(), nodes=Tri3().nodes[[0, 2, 1]]), "the first nodes must be the corners"),
        (element(Tri6(), exponents=Tri6().exponents - 0.5), "exponents must be whole, >= 0: for 0 it gives"),
        (element(Tri6(), nodes=Tri6().nodes + np.eye(6, 2, -4)), "a node lies outside the reference domain: for 4"),
        (element(Quad9(), order=3), rf"order is overstated: {POINT}"),
        (element(Tri3(), order=2), rf"order is overstated: {POINT}"),
        (element(Quad4(), order=0), "order must be at least 1"),
        (wilson(), rf"nodes off a side contribute on it: {POINT}"),
        (
            element(Quad4(), exponents=Quad4().exponents + [[0, 1]] * 4),
            rf"sum of shape functions: {POINT}|not determined",
        ),
    ],
)
def test_wrong_elements_are_detected(wrong: SurfaceElement, message: str) -> None:
    with pytest.raises(AssertionError, match=rf"(?s){message}.*why it matters"):
        check_element(wrong)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("correct", ELEMENTS.values(), ids=str)
def test_correct_element_passes(correct: SurfaceElement) -> None:
    check_element(element(correct))


Fault = Callable[[Array, Array, Array], tuple[Array, Array]]


@dataclass(frozen=True)
class WrongSolution(FundamentalSolution):
    """The line integral, modified by a function of offset (n, 3), U and T, and by a factor on the gradient."""

    fault: Fault
    steep: float = 1.0

    def bind(self, stiffness: Array) -> Kernel:
        return WrongKernel(LineIntegral().bind(stiffness), self.fault, self.steep)


@dataclass(frozen=True)
class WrongKernel(Kernel):
    correct: Kernel
    fault: Fault
    steep: float

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        u, t = self.correct.evaluate(offset, normal)
        return self.fault(offset, u, t)

    def gradient(self, offset: Array) -> Array:
        return self.steep * self.correct.gradient(offset)


def asymmetric(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    changed = u.copy()
    changed[:, 0, 1] *= 1.0 + 1e-6
    return changed, t


def on_the_axis(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    """Fail where eigenvalues coincide: along the third axis only."""
    along = (offset[:, :2] == 0.0).all(axis=1)
    return np.where(along[:, None, None], np.nan, u), t


def in_a_plane(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    """Add a small error in the plane of isotropy only."""
    return u, np.where((offset[:, 2] == 0.0)[:, None, None], 1.001 * t, t)


def mixed(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    return u + 1e-9 * u[:1], t


def growing(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    return u * np.linalg.norm(offset, axis=1)[:, None, None] ** 0.01, t


def lopsided(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    return u * (1.0 + 1e-6 * np.sign(offset[:, 0]))[:, None, None], t


def strided(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    return np.asfortranarray(u), t


def with_rotated_traction(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    return u, -t


def unchanged(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    return u, t


def larger(offset: Array, u: Array, t: Array) -> tuple[Array, Array]:
    return 1.01 * u, 1.01 * t


OFFSET = r"by \d.* at offset \[.*\]"
AXIS = r"for \[ *0\. +0\. +-?1\.\] it gives"


@pytest.mark.full(except_for=5)
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (WrongSolution(asymmetric), f"U is not symmetric: {OFFSET}"),
        (WrongSolution(on_the_axis), f"U is not finite: {AXIS}"),
        (WrongSolution(in_a_plane), r"T is not C : grad U . nu: by \d.* at offset \[.* -?0\. *\]"),
        (WrongSolution(mixed), f"U depends on the order of the points: {OFFSET}"),
        (WrongSolution(growing), f"U is not homogeneous of degree -1: {OFFSET}"),
        (WrongSolution(lopsided), f"U is not even: {OFFSET}"),
        (WrongSolution(strided), "U is not C-contiguous"),
        (WrongSolution(with_rotated_traction), f"T is not C : grad U . nu: {OFFSET}"),
        (WrongSolution(larger, 1.01), r"flux through a sphere differs from unity, component \d, \d: by 1.0e-02"),
        (WrongSolution(unchanged, 1.01), f"T is not C : grad U . nu: {OFFSET}"),
        (
            WrongSolution(lambda offset, u, t: (u, 1.01 * t), 1.01),
            r"differences of U do not approach U,q: .* at offset \[",
        ),
    ],
)
def test_wrong_kernels_are_detected(wrong: FundamentalSolution, message: str) -> None:
    material = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8))
    with pytest.raises(AssertionError, match=rf"(?s){message}.*why it matters"):
        check_fundamental_solution(wrong, scaled_stiffness(material))


def test_correct_kernel_passes() -> None:
    check_fundamental_solution(WrongSolution(unchanged), scaled_stiffness(library_material("batio3-cofe2o4")))
