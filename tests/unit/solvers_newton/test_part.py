"""Newton's method on the part of a half space around the contact, against the same on all of it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.core.body import Body
from meeframe.core.contact import ContactProblem, ContactSolution, Freedom, Status
from meeframe.core.fields import Array
from meeframe.core.formulation import Part, ReducedSystem
from meeframe.core.mesh import Indices
from meeframe.core.pair import pair
from meeframe.elements import Quad4
from meeframe.geometry import half_space_mesh
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini, StepConductivity
from meeframe.materials import Material, library_material
from meeframe.solvers import Limits, SemismoothNewton, newton, solve
from meeframe.solvers.newton_part import Inset, inset
from meeframe.testing.counted import Counted

WIDTH, RADIUS, MU = 1e-2, 0.1, 0.3
LIMITS = Limits(tolerance=1e-10)


def half_space(n: int = 63, stiffness: Array | None = None) -> ReducedSystem:
    body = Body(
        library_material("orthotropic-mee").stiffness if stiffness is None else stiffness,
        half_space_mesh(10.0 * WIDTH, WIDTH, n, 1, Quad4()),
        (),
        "contact",
    )
    return HalfSpace(matrix_up_to=0).reduce(body)


def sphere(system: ReducedSystem, at: Sequence[float], contact: float = 0.15, **given: Any) -> ContactProblem:
    """A sphere pressed onto a place [widths], conducting and rubbing, dragged a little."""
    depth = (contact * WIDTH) ** 2 / RADIUS
    gap = ((system.points[:, :2] - WIDTH * np.array(at)) ** 2).sum(axis=1) / (2.0 * RADIUS) - depth
    translation, flux = np.tile([0.3 * MU * depth, 0.0], (len(gap), 1)), StepConductivity(np.inf)
    problem = ContactProblem(
        system, IsotropicCoulomb(MU), flux, flux, gap, translation, np.tile([5.0, 1.0], (len(gap), 1))
    )
    return replace(problem, **given)


def solutions(problem: ContactProblem, monkeypatch: pytest.MonkeyPatch) -> tuple[ContactSolution, ContactSolution]:
    """With parts and without; the second one beforehand would find entries made."""
    found = solve(problem, SemismoothNewton(), LIMITS)
    with monkeypatch.context() as without:
        without.setattr(newton, "inset", lambda problem, contact: None)
        return found, solve(problem, SemismoothNewton(), LIMITS)


def check_alike(found: ContactSolution, other: ContactSolution) -> None:
    assert found.status is other.status is Status.CONVERGED
    for field in range(5):
        largest = np.abs(other.state.load[:, field]).max()
        np.testing.assert_allclose(found.state.load[:, field], other.state.load[:, field], atol=1e-7 * largest, rtol=0)
    np.testing.assert_array_equal(found.state.closed > 0.0, other.state.closed > 0.0)


def freedoms(system: ReducedSystem, force: float) -> tuple[Freedom, ...]:
    """Pressed by a force and dragged with half of what friction bears."""
    totals, found = {2: -force, 0: 0.5 * MU * force, 1: 0.0}, []
    for field, total in totals.items():
        mode = np.zeros_like(system.offset)
        mode[:, field] = 1.0
        found.append(Freedom(mode, system.weights[:, None] * mode, total))
    return tuple(found)


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"at": (0.42, -0.4)},  # over the corner of the zone
        {"contact_law": Signorini()},
        {"electric_law": Insulating(), "magnetic_law": StepConductivity(1e-9)},
        {"force": 40.0},
        {"pair": True},
    ],
    ids=["fixed", "corner", "frictionless", "resistance", "force", "pair"],
)
def test_parts_have_the_solution_of_the_whole(given: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    given = dict(given)
    body, other = half_space(), Material.isotropic(1e11, 0.25).stiffness
    system = Counted.of(pair(body, half_space(stiffness=other)) if given.pop("pair", False) else body)
    at, force = given.pop("at", (0.05, -0.1)), given.pop("force", None)
    problem = sphere(system, at, **given)
    if force is not None:
        still = np.zeros_like(problem.translation)
        gap = problem.gap - problem.gap.min()
        problem = replace(problem, gap=gap, translation=still, freedoms=freedoms(system, force))
    sizes: list[int] = []

    class Seen(Inset):
        def __init__(self, whole: ContactProblem, kept: Indices, equation: Any) -> None:
            super().__init__(whole, kept, equation)
            sizes.append(len(kept))

    monkeypatch.setattr("meeframe.solvers.newton_part.Inset", Seen)
    found, whole = solutions(problem, monkeypatch)
    assert min(sizes) < 0.5 * len(problem.gap)
    check_alike(found, whole)


def test_contact_beside_the_part_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts that have too little, wherever they are taken: half of what was asked for."""
    problem = sphere(half_space(), (0.05, -0.1))
    parts: list[Part] = []

    def halved(problem: ContactProblem, contact: Indices) -> Inset | None:
        kept = contact & (problem.system.points[:, 0] > 0.05 * WIDTH)
        part = inset(problem, kept)
        if part is not None:
            parts.append(Part(part.equation.problem.system, part.kept))
        return part

    with monkeypatch.context() as given:
        given.setattr(newton, "inset", halved)
        found = solve(problem, SemismoothNewton(), LIMITS)
    pressed = np.flatnonzero(found.state.load[:, 2] < 0.0)
    assert any(not np.isin(pressed, part.kept).all() for part in parts)
    check_alike(found, solutions(problem, monkeypatch)[1])


def test_an_indenter_known_to_be_small_is_all_there_is() -> None:
    """Nodes without an indenter above need no part, whatever the contact."""
    system = half_space()
    problem = sphere(system, (0.0, 0.0))
    small = replace(problem, gap=np.where(np.hypot(*system.points[:, :2].T) < 0.1 * WIDTH, problem.gap, np.inf))
    part = inset(small, problem.gap < 0.0)
    assert part is not None
    assert np.isin(np.flatnonzero(np.isfinite(small.gap)), part.kept).all()
    nothing = np.zeros(len(part.kept))
    load = np.zeros((len(part.kept), 5))
    point = part.equation.at(load, nothing, nothing > 0.0, np.zeros(0))
    assert not part.spilt(point)
    assert inset(small, np.zeros(len(small.gap), bool)) is None


def test_overlap_beside_the_part_spills() -> None:
    """Two bumps, one of them in the part."""
    system = half_space()
    one, two = (sphere(system, (x, 0.0), 0.08) for x in (-0.3, 0.3))
    both = replace(one, gap=np.minimum(one.gap, two.gap))
    part = inset(both, one.gap < 0.0)
    assert part is not None
    assert len(part.kept) < 0.3 * len(both.gap)
    load, nothing = np.zeros((len(part.kept), 5)), np.zeros(len(part.kept))
    assert part.spilt(part.equation.at(load, nothing, nothing > 0.0, np.zeros(0)))
    alone = replace(part, whole=one)
    assert not alone.spilt(part.equation.at(load, nothing, nothing > 0.0, np.zeros(0)))
