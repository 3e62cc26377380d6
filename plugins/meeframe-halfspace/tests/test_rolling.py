"""Rolling over half spaces: Carter's solution, Kalker's coefficients, the program CONTACT, and exact balances."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.self_affine import SelfAffine
from meeframe_laws.adhesive import DMTCoulomb
from meeframe_laws.directional import NonAssociatedCoulomb, SuperellipticCoulomb
from meeframe_laws.evolving import RateAndPressure, SlipWeakening
from meeframe_laws.friction import CappedCoulomb, RegularisedCoulomb, Tresca
from scipy.integrate import quad
from scipy.optimize import brentq

from meeframe.elements import Quad4
from meeframe.indenters import Paraboloid, Placement, Sphere
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, StepConductivity
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.layers import Layer, LayerStack
from meeframe.mesh import FrictionAxes, half_space_mesh
from meeframe.model.case import Case
from meeframe.model.restart import Restart
from meeframe.model.rolling import Rolling
from meeframe.model.second_body import SecondBody
from meeframe.model.solve import reduce, solve_case, solve_steps
from meeframe.model.step import Step
from meeframe.results.files import read_result, write_result
from meeframe.results.history import curves
from meeframe.results.records import Region, Result, StepResult
from meeframe.results.resultants import resultants
from meeframe.results.schema import rolling_totals
from meeframe.results.summary import summary
from meeframe.system.edge_correction import correct_edge
from meeframe.system.rolling import CellShift, SteadyRollingSystem
from meeframe.testing.capabilities import check_approximate_inverse
from meeframe.testing.formulation import check_translation
from meeframe.testing.operation_counter import OperationCounter

CONSTANT = HalfSpace(density="constant", matrix_up_to=0)
"""Densities as in the program CONTACT."""


def isotropic(shear_modulus: float, poisson_ratio: float) -> Material:
    modulus = 2.0 * shear_modulus * (1.0 + poisson_ratio)
    return library_material("isotropic", young_modulus=modulus, poisson_ratio=poisson_ratio)


def equal_bodies(material: Material, nodes: tuple[int, int], spacing: tuple[float, float], **arguments) -> Case:
    """Return the case of two half spaces on a grid of nodes, of equal materials unless there is a second one."""
    width = tuple((count - 1) * h for count, h in zip(nodes, spacing, strict=True))
    cells = tuple(count - 1 for count in nodes)
    mesh = half_space_mesh(4.0 * max(width), width, cells, 1, Quad4())
    arguments = {"formulation": CONSTANT, **arguments}
    second = SecondBody(arguments.pop("second_material", material), mesh, formulation=arguments["formulation"])
    return Case(material, mesh, (), second_body=second, **arguments)


def run(case: Case) -> Result:
    result = solve_case(case)
    assert result.status == "converged", [step.message for step in result.steps]
    return result


def steady(
    creepage: tuple[float, float] | None = None, spin: float = 0.0, direction=(1.0, 0.0), speed: float | None = None
) -> Step:
    return Step(rolling=Rolling(direction, steady=True, creepage=creepage, spin=spin, speed=speed))


def sphere(steps: Sequence[Step], formulation: HalfSpace | None = None, **arguments) -> Case:
    """Return the case of a sphere on a half space with a contact seven nodes across."""
    mesh = half_space_mesh(4e-2, 6e-3, 20, 1, Quad4())
    arguments = {"material": isotropic(80e9, 0.28), "contact_law": IsotropicCoulomb(0.3), **arguments}
    law = {"formulation": formulation or HalfSpace(matrix_up_to=0)}
    return Case(mesh=mesh, conditions=(), indenter=Sphere(0.1), steps=tuple(steps), **arguments, **law)


def equal_spheres(*steps: Step, refined: int = 1) -> Case:
    """Return the case of equal spheres in contact on ten nodes across, or on ten times `refined`."""
    return equal_bodies(
        isotropic(80e9, 0.28),
        (24 * refined, 24 * refined),
        (3e-4 / refined, 3e-4 / refined),
        indenter=Sphere(0.1),
        contact_law=IsotropicCoulomb(0.3),
        steps=(PRESS, *steps),
    )


PRESS = Step(normal_force=2000.0)
CREEPAGES = {"creepage": (5e-4, 3e-4), "spin": 0.5}


class TestCarter:
    """Equal cylinders, on a periodic surface whose period is twenty half widths of the contact."""

    SHEAR, POISSON, FRICTION, HALF_WIDTH, RADIUS = 1e9, 0.3, 0.3, 1e-3, 1.0
    FRACTIONS = (0.4, 0.8, 1.5)
    """Creepages in units of that at which the whole contact slips."""

    @classmethod
    def forces(cls, across: int) -> tuple[np.ndarray, list[StepResult]]:
        """Return the forces over the largest friction, and the increments; across: nodes in contact."""
        spacing, rows = 2.0 * cls.HALF_WIDTH / across, 2
        force = np.pi * cls.SHEAR / (1.0 - cls.POISSON) * cls.HALF_WIDTH**2 / (4.0 * cls.RADIUS) * rows * spacing
        creepages = [fraction * cls.FRICTION * cls.HALF_WIDTH / cls.RADIUS for fraction in cls.FRACTIONS]
        case = equal_bodies(
            isotropic(cls.SHEAR, cls.POISSON),
            (10 * across, rows),
            (spacing, spacing),
            indenter=Paraboloid(cls.RADIUS, 1e9),
            contact_law=IsotropicCoulomb(cls.FRICTION),
            formulation=HalfSpace(density="constant", matrix_up_to=0, periodic=True),
            steps=(Step(normal_force=force), *(steady((creepage, 0.0)) for creepage in creepages)),
        )
        result = run(case)
        ratios = [resultants(result.zone, step).tangential_force[0] for step in result.steps[1:]]
        return np.array(ratios) / (cls.FRICTION * force), list(result.steps[1:])

    @pytest.mark.full
    def test_force_and_stick_zone(self) -> None:
        coarse, middle, fine = (self.forces(across) for across in (10, 20, 40))
        carter = 1.0 - (1.0 - np.minimum(self.FRACTIONS, 1.0)) ** 2
        orders = np.log2((coarse[0] - middle[0])[:2] / (middle[0] - fine[0])[:2])
        assert orders == pytest.approx(1.0, abs=0.15)
        assert 2.0 * fine[0] - middle[0] == pytest.approx(carter, rel=5e-3)  # the period changes them by 4e-3
        for fraction, step in zip(self.FRACTIONS, fine[1], strict=True):
            sticking = (step.region == Region.STICK).reshape(-1, 2)[:, 0]
            touching = step.touching.reshape(-1, 2)[:, 0]
            assert sticking.sum() == max(round((1.0 - fraction) * touching.sum()), 0)
            assert not sticking.any() or np.flatnonzero(sticking)[-1] == np.flatnonzero(touching)[-1], "leading edge"


def test_free_rolling_of_unlike_cylinders_creeps() -> None:
    """Without friction in the limit: Bentall and Johnson, Int. J. Mech. Sci. 9 (1967) 389."""
    across, rows, half_width, radius = 40, 2, 1e-3, 1.0
    soft, hard = (1e9, 0.3), (3e9, 0.25)
    modulus = 1.0 / sum((1.0 - poisson) / (2.0 * shear) for shear, poisson in (soft, hard))
    beta = (1.0 - 2.0 * soft[1]) / (2.0 * soft[0]) - (1.0 - 2.0 * hard[1]) / (2.0 * hard[0])
    spacing = 2.0 * half_width / across
    case = equal_bodies(
        isotropic(*soft),
        (10 * across, rows),
        (spacing, spacing),
        second_material=isotropic(*hard),
        indenter=Paraboloid(radius, 1e9),
        contact_law=IsotropicCoulomb(1e-4),
        formulation=HalfSpace(density="constant", matrix_up_to=0, periodic=True),
        steps=(
            Step(normal_force=np.pi * modulus * half_width**2 / (4.0 * radius) * rows * spacing),
            Step(tangential_force=(0.0, 0.0)),
            steady(),
        ),
    )
    creepage = run(case).steps[-1].loading.rolling.creepage
    peak = modulus * half_width / (2.0 * radius)
    # on a periodic surface pressure strains by its difference from the mean; positive: the softer body is below
    mean = np.pi * half_width / (2.0 * 10 * across * spacing)
    assert creepage[0] == pytest.approx((0.9148 - mean) * beta * peak, rel=5e-3)


class TestContact:
    """Values that the program CONTACT (Vollebregt, Kalker) prints for its examples, on the same cells."""

    @staticmethod
    def from_cattaneo(rolling: Sequence[Step]) -> Case:
        """Return example catt_to_cart, in units of 1 mm, 1 N and 1 N/mm^2 for the shear modulus."""
        spacing, friction, force = 0.25e-3, 0.4013, 0.4705
        radius = 1.0 / (2.0 * 2.963)
        return equal_bodies(
            isotropic(1e6, 0.28),
            (34, 33),
            (spacing, spacing),
            indenter=Paraboloid(radius, radius),
            placement=Placement(x=-spacing / 2.0),
            contact_law=IsotropicCoulomb(friction),
            steps=(
                Step(normal_force=force),
                Step(tangential_force=(0.657 * friction * force, 0.0)),
                *rolling,
            ),
        )

    @pytest.mark.full
    def test_from_cattaneo_to_carter(self) -> None:
        rolls = Step(rolling=Rolling((1.0, 0.0), distance=0.25e-3)), steady()
        _, shift, first, end = run(self.from_cattaneo(rolls))
        assert shift.loading.translation[0] == pytest.approx(1.774e-5, rel=3e-4)
        assert first.loading.rolling.creepage[0] == pytest.approx(1.824e-3, rel=3e-4)
        assert end.loading.rolling.creepage[0] == pytest.approx(3.101e-3, rel=3e-4)
        assert [(step.region == Region.STICK).sum() for step in (shift, first, end)] == [305, 422, 346]

    @pytest.mark.full
    def test_transient_after_two_diameters(self) -> None:
        *_, last = run(self.from_cattaneo([Step(rolling=Rolling((1.0, 0.0), distance=56 * 0.25e-3))]))
        assert last.loading.rolling.creepage[0] == pytest.approx(3.10059e-3, rel=2e-6)

    @pytest.mark.full
    def test_creep_curve_and_saturation(self) -> None:
        """Example tractcurv: an ellipse with half axes 1 : 2."""
        shear, poisson, friction, force, curvature = 82e9, 0.28, 0.33, 106.7e3, 0.8
        half_axis = brentq(lambda a: hertz_curvatures(a, 2.0 * a, force, shear, poisson)[0] - curvature, 1e-3, 1e-2)
        other = hertz_curvatures(half_axis, 2.0 * half_axis, force, shear, poisson)[1]
        case = equal_bodies(
            isotropic(shear, poisson),
            (48, 44),
            (2.2 * half_axis / 48, 4.4 * half_axis / 44),
            indenter=Paraboloid(0.5 / curvature, 0.5 / other),
            contact_law=IsotropicCoulomb(friction),
            steps=(Step(normal_force=force), *(steady((creepage, 0.0)) for creepage in (8e-4, 1.6e-3, 2.4e-3, 1e-2))),
        )
        result = run(case)
        forces = [resultants(result.zone, step).tangential_force[0] / (friction * force) for step in result.steps[1:]]
        assert forces == pytest.approx([0.4742, 0.7831, 0.9467, 1.0], abs=2e-4)
        assert max(forces) < 1.0


def hertz_curvatures(a: float, b: float, force: float, shear: float, poisson: float) -> tuple[float, float]:
    """Return A and B of the distance A x^2 + B y^2 of equal bodies with an elliptic contact of half axes a, b."""
    factor = 3.0 * force * (1.0 - poisson) / (4.0 * np.pi * shear)

    def integral(square: float) -> float:
        def integrand(t: float) -> float:
            return 2.0 / ((square + t * t) * np.sqrt((a * a + t * t) * (b * b + t * t)))

        return float(quad(integrand, 0.0, np.inf, epsrel=1e-10)[0])

    return factor * integral(a * a), factor * integral(b * b)


@cache
def creep_coefficients(across: int, poisson: float = 0.25) -> np.ndarray:
    """Return C11, C22, C23, C32 and C33 of a circle on a grid with so many nodes across."""
    shear, radius, small = 1e9, 1e-3, 1e-3  # tractions as large as pressures, to whose magnitude they are solved
    motions = ((small, 0.0), 0.0), ((0.0, small), 0.0), ((0.0, 0.0), small / radius)
    spacing = 2.0 * radius / across
    case = equal_bodies(
        isotropic(shear, poisson),
        (across + 4, across + 4),
        (spacing, spacing),
        indenter=Paraboloid(1.0, 1.0),
        contact_law=IsotropicCoulomb(1e4),
        steps=(
            Step(normal_force=4.0 * shear / (1.0 - poisson) * radius**3 / 3.0),
            *(steady(*each) for each in motions),
        ),
    )
    result = run(case)
    totals = [resultants(result.zone, step) for step in result.steps]
    a = np.sqrt(totals[1].contact_area / np.pi)  # the nodes in contact make up another area than the circle
    along, lateral, spin = totals[1:]
    return np.array(
        [
            along.tangential_force[0] / (shear * a**2 * small),
            lateral.tangential_force[1] / (shear * a**2 * small),
            spin.tangential_force[1] / (shear * a**3 * small / radius),
            -lateral.torque / (shear * a**3 * small),
            spin.torque / (shear * a**4 * small / radius),
        ]
    )


@pytest.mark.full
def test_linear_creep_coefficients_of_a_circle() -> None:
    """Extrapolated values agree with those of Kalker, Three-Dimensional Elastic Bodies (1990), table E.3."""
    coarse, fine = creep_coefficients(16), creep_coefficients(32)
    extrapolated = 2.0 * fine - coarse
    assert extrapolated == pytest.approx([4.12, 3.67, 1.47, 1.47, 1.19], rel=0.015)


@pytest.mark.parametrize("poisson", [0.0, pytest.param(0.4999999, marks=pytest.mark.full)])
def test_creep_coefficients_over_poisson_ratio(poisson: float) -> None:
    coarse, fine = creep_coefficients(8, poisson), creep_coefficients(16, poisson)
    c11, c22, c23, c32, _ = 2.0 * fine - coarse
    assert c23 == pytest.approx(c32, rel=0.02), "mirror symmetry, which a grid violates"
    assert abs(fine[2] / fine[3] - 1.0) > 0.1
    if poisson == 0.0:  # the body then responds alike along both axes
        assert fine[0] == pytest.approx(fine[1], rel=1e-7)
    else:
        assert c11 > 1.2 * c22


class TestBalances:
    def test_work_of_friction_is_force_times_creepage(self) -> None:
        """The pressure of equal bodies does no work: the identity is exact on any grid."""
        result = run(equal_spheres(steady(**CREEPAGES)))
        numbers = rolling_totals(result.zone, result.steps[-1])
        assert {Region.STICK, Region.SLIP} <= set(result.steps[-1].region)
        assert numbers["friction_work"] == pytest.approx(numbers["creep_work"], rel=1e-11)

    @pytest.mark.full(except_for=1)
    @pytest.mark.parametrize(
        "law",
        [IsotropicCoulomb(0.3), RateAndPressure(mu_static=0.4, mu_kinetic=0.2, reference_speed=1e-3)],
        ids=["coulomb", "rate"],
    )
    def test_work_includes_that_of_the_pressure(self, law) -> None:
        """Friction under a rigid indenter shifts the pressure, which then works on the material that moves through."""
        rolls = Step(rolling=Rolling((1.0, 0.0), steady=True, speed=2.0, **CREEPAGES))
        press = Step(normal_force=2000.0, duration=1.0)
        result = run(sphere((press, rolls), contact_law=law))
        step, numbers = result.steps[-1], rolling_totals(result.zone, result.steps[-1])
        grid = result.zone.cells.shape
        traction, displacement = (values[:, 2].reshape(grid) for values in (step.traction, step.displacement))
        mean, change = 0.5 * (traction[:-1] + traction[1:]), displacement[:-1] - displacement[1:]
        of_pressure = (mean * change).sum() * result.zone.weights.max() / step.loading.rolling.cell
        assert abs(of_pressure) > 0.1 * numbers["creep_work"]
        assert numbers["friction_work"] == pytest.approx(numbers["creep_work"] + of_pressure, rel=1e-9)
        assert numbers["friction_power"] == pytest.approx(2.0 * numbers["friction_work"])

    def test_reverse_rolling_transposes_the_creep_matrix(self) -> None:
        """By reciprocity, exactly on any grid, without any symmetry of the bodies and of the nodes in contact."""
        upright, small = library_material("orthotropic-mee"), 1e-4
        # the second body, rotated over, has the axes of the first, so that pressure and friction are not coupled
        material, other = (upright.rotated(rotation_about([0.0, 0.0, 1.0], angle)) for angle in (0.5, -0.5))

        def matrix(direction: int) -> np.ndarray:
            motions = ((0.0, 0.0), (small, 0.0), (0.0, small))
            case = equal_bodies(
                material,
                (14, 14),
                (3e-4, 3e-4),
                second_material=other,
                indenter=Sphere(0.1),
                placement=Placement(x=1e-4, y=0.7e-4),
                contact_law=IsotropicCoulomb(1e4),
                steps=(Step(normal_force=50.0), *(steady(each, direction=(direction, 0.0)) for each in motions)),
            )
            result = run(case)
            at_rest, *others = [resultants(result.zone, step).tangential_force for step in result.steps[1:]]
            return direction * (np.array(others) - at_rest).T

        forward, backward = matrix(1), matrix(-1)
        assert abs(forward[0, 1] - forward[1, 0]) > 1e-3 * abs(forward[0, 1])
        assert backward == pytest.approx(forward.T, abs=1e-4 * abs(forward[0, 1] - forward[1, 0]))


class TestSymmetries:
    @staticmethod
    def tractions(direction: tuple[float, float]) -> tuple[np.ndarray, StepResult, Result]:
        result = run(sphere((PRESS, steady(direction=direction, **CREEPAGES))))
        step = result.steps[-1]
        return step.traction.reshape(21, 21, 3), step, result

    def test_directions_along_all_axes(self) -> None:
        """A quarter turn of the direction turns the tractions."""
        traction, *_ = self.tractions((1.0, 0.0))
        for direction in ((0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)):
            previous, (traction, *_) = traction, self.tractions(direction)
            rotated = np.rot90(previous, 1)[..., [1, 0, 2]] * [-1.0, 1.0, 1.0]
            assert traction == pytest.approx(rotated, abs=1e-7 * np.abs(traction).max())

    def test_spin_causes_a_lateral_force_to_the_left(self) -> None:
        result = run(equal_spheres(steady((0.0, 0.0), spin=0.5)))
        numbers = rolling_totals(result.zone, result.steps[-1])
        longitudinal, lateral = numbers["creep_force"]
        assert lateral > 0.1 * 0.3 * 2000.0
        assert abs(longitudinal) < 1e-9 * lateral
        assert resultants(result.zone, result.steps[-1]).torque > 0.0


class TestSaturation:
    def test_large_creepage_saturates(self) -> None:
        result = run(equal_spheres(steady((0.03, 0.04))))
        assert rolling_totals(result.zone, result.steps[-1])["creep_force"] == pytest.approx([360.0, 480.0], rel=2e-3)

    @pytest.mark.parametrize("axis", [0, pytest.param(1, marks=pytest.mark.full)])
    def test_force_grows_with_the_creepage_to_full_slip(self, axis: int) -> None:
        creepages = np.eye(2)[axis] * [[5e-4], [1e-3], [2e-3], [3e-3], [4e-3], [1e-2]]
        result = run(equal_spheres(*(steady(tuple(each)) for each in creepages)))
        forces = [resultants(result.zone, step).tangential_force for step in result.steps[1:]]
        ratios = np.array(forces)[:, axis] / (0.3 * 2000.0)
        sticking = [(step.region == Region.STICK).sum() for step in result.steps[1:]]
        assert (np.diff(ratios) > 0.0).all()
        assert (np.diff(sticking) <= 0).all()
        assert sticking[0] > 20
        assert sticking[-1] == 0
        assert 0.999 < ratios[-1] < 1.0

    def test_large_spin_turns_in_place(self) -> None:
        """In the limit friction opposes a rotation: no force, and the torque 3 pi mu N a / 16; of first order."""
        forces, torques = [], []
        radius = (3.0 * 2000.0 * 0.1 * (1.0 - 0.28) / (4.0 * 80e9)) ** (1.0 / 3.0)
        for refined in (1, 2):
            result = run(equal_spheres(steady((0.0, 0.0), spin=2e3), refined=refined))
            totals = resultants(result.zone, result.steps[-1])
            forces.append(totals.tangential_force[1] / (0.3 * 2000.0))
            torques.append(totals.torque / (3.0 * np.pi / 16.0 * 0.3 * 2000.0 * radius))
        assert forces[1] < 0.6 * forces[0]
        assert 2.0 * forces[1] - forces[0] == pytest.approx(0.0, abs=0.01)
        assert torques[1] == pytest.approx(1.0, abs=0.01)


def test_held_force_and_held_creepages_are_the_same_state() -> None:
    """With spin: the force of given creepages is held, and the creepages follow."""
    given = run(equal_spheres(steady((1e-3, 2e-4), spin=0.5)))
    force = resultants(given.zone, given.steps[-1]).tangential_force
    held = run(equal_spheres(Step(tangential_force=tuple(force)), steady(None, spin=0.5)))
    assert held.steps[-1].loading.rolling.creepage == pytest.approx([1e-3, 2e-4], rel=1e-7)
    traction = given.steps[-1].traction
    assert held.steps[-1].traction == pytest.approx(traction, abs=1e-7 * np.abs(traction).max())


SLIDES = {
    "slider": {"creepage": (1.0, 0.0), "distance": 6e-4},
    "steady": {"creepage": (0.3, 0.4), "steady": True},
}


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("slides", SLIDES)
def test_friction_follows_the_speed_of_the_slip(slides: str) -> None:
    """In full slip all particles slip at the rolling speed times the creepage, but for elastic strains of 1e-3."""
    law = RateAndPressure(mu_static=0.4, mu_kinetic=0.2, reference_speed=0.5)
    for speed in (0.2, 1.0):
        rolls = Step(rolling=Rolling((1.0, 0.0), speed=speed, **SLIDES[slides]))
        result = run(sphere((Step(normal_force=50.0, duration=1.0), rolls), contact_law=law))
        force = np.linalg.norm(resultants(result.zone, result.steps[-1]).tangential_force)
        slip = speed * np.hypot(*SLIDES[slides]["creepage"])
        assert force == pytest.approx(50.0 * (0.2 + 0.2 * np.exp(-slip / 0.5)), rel=1e-3)


PIEZO = {
    "material": library_material("pzt-4").rotated(rotation_about([1.0, 2.0, 3.0], 0.7)),
    "conductivity": {"electric": StepConductivity(np.inf)},
    "potentials": {"electric_potential": 10.0},
}
VARIANTS = {
    "fft": {},
    "matrix": {"formulation": HalfSpace(matrix_up_to=500)},
    "polar axes": {"axes": FrictionAxes(around=(0.0, 0.0, 1.0))},
    "oblique axes": {"axes": FrictionAxes(direction=(1.0, 2.0, 0.0))},
    "layered": {"layers": LayerStack((Layer(library_material("zno"), 3e-4),)), "material": library_material("silicon")},
    "piezoelectric": PIEZO,
    "finite conductance": {**PIEZO, "conductivity": {"electric": StepConductivity(10.0)}},
    "free potential": {**PIEZO, "potentials": {}},
    "slip weakening": {"contact_law": SlipWeakening(0.4, 0.2, 1e-6)},
    "orthotropic": {"contact_law": OrthotropicCoulomb(0.3, 0.2)},
    "non-associated": {"contact_law": NonAssociatedCoulomb(0.3, 0.2, slip_ratio=2.0)},
    "rate": {"contact_law": RateAndPressure(mu_static=0.4, mu_kinetic=0.2, reference_speed=1e-3)},
    "superelliptic": {"contact_law": SuperellipticCoulomb(0.3, 0.2, exponent=4.0)},
    "capped": {"contact_law": CappedCoulomb(0.3, 2e8)},
    "tresca": {"contact_law": Tresca(2e8)},
    "regularised": {"contact_law": RegularisedCoulomb(0.3, 1e-7)},
    "adhesive": {"contact_law": DMTCoulomb(0.3, 1e8)},
}


def test_rough_slider_has_the_limit_of_friction() -> None:
    period, nodes = 1e-3, 16
    spacing = period / nodes
    case = Case(
        isotropic(40e9, 0.3),
        half_space_mesh(4.0 * period, (nodes - 1) * spacing, nodes - 1, 1, Quad4()),
        (),
        SelfAffine(period, period / 4.0, 0.8, rms_slope=0.05),
        contact_law=IsotropicCoulomb(0.3),
        formulation=HalfSpace(density="trigonometric", periodic=True),
        steps=(Step(normal_force=20.0), Step(rolling=Rolling((0.0, 1.0), 3 * spacing, creepage=(1.0, 0.0)))),
    )
    result = run(case)
    assert not (result.steps[-1].region == Region.STICK).any()
    numbers = rolling_totals(result.zone, result.steps[-1])
    assert numbers["creep_force"][0] == pytest.approx(6.0, rel=1e-4)
    assert abs(numbers["creep_force"][1]) < 1e-3 * 6.0, "asperities yield sideways"
    assert numbers["friction_work"] == pytest.approx(6.0, rel=0.02)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("variant", VARIANTS)
def test_steady_state_repeats_from_cell_to_cell(variant: str) -> None:
    """Transient increments, which are solved with another operator, leave the steady state as it is."""
    held = {"charge": 0.0} if variant == "free potential" else {}
    press = replace(PRESS, duration=1.0, scalars=held)
    more = Step(rolling=Rolling((1.0, 0.0), distance=6e-4, speed=2.0, **CREEPAGES))
    *_, state, once, twice = run(sphere((press, steady(speed=2.0, **CREEPAGES), more), **VARIANTS[variant]))
    assert ({Region.SLIP} if variant == "regularised" else {Region.STICK, Region.SLIP}) <= set(state.region)
    for later in (once, twice):
        names = ("slip_path",) if variant == "slip weakening" else ()
        for name in ("traction", "displacement", "slip", "fluxes", "potentials", *names):
            values = getattr(state, name)
            assert np.abs(getattr(later, name) - values).max() <= 1e-8 * np.abs(values).max(), name


@pytest.mark.full
def test_axes_of_friction_do_not_change_isotropic_rolling() -> None:
    forces = []
    for variant in ("fft", "polar axes", "oblique axes"):
        result = run(sphere((PRESS, steady(**CREEPAGES)), **VARIANTS[variant]))
        forces.append(resultants(result.zone, result.steps[-1]).force)
    assert forces[1] == pytest.approx(forces[0], rel=1e-8)
    assert forces[2] == pytest.approx(forces[0], rel=1e-8)


@pytest.mark.full
def test_steady_is_the_limit_of_transient() -> None:
    press = Step(normal_force=600.0)
    rolls = Step(rolling=Rolling((1.0, 0.0), distance=50 * 3e-4, **CREEPAGES))
    transient = run(sphere((press, rolls))).steps
    direct = run(sphere((press, steady(**CREEPAGES)))).steps[-1]
    errors = [np.abs(step.traction - direct.traction).max() for step in transient[1:]]
    assert errors[0] > 0.1 * np.abs(direct.traction[:, :2]).max()
    assert errors[-1] <= 1e-6 * np.abs(direct.traction[:, :2]).max()


Motion = tuple[tuple[float, float], float]
"""Creepages and spin [1/m]."""


def rolling_work(nodes: int, motion: Motion = ((1e-3, 5e-4), 0.5)) -> tuple[int, int]:
    """Return iterations and products of a steady state with stick and slip in a contact over two thirds of the zone."""
    mesh = half_space_mesh(4e-2, 3e-3, nodes - 1, 1, Quad4())
    case = replace(sphere((PRESS, steady(motion[0], spin=motion[1]))), mesh=mesh)
    counted = OperationCounter.of(reduce(case))
    steps = solve_steps(case, counted, boundary=False)
    next(steps)
    before = len(counted.products)
    rolls = next(steps)
    assert rolls.status == "converged"
    assert {Region.STICK, Region.SLIP} <= set(rolls.region)
    return rolls.iterations, len(counted.products) - before


@pytest.mark.full
def test_work_hardly_grows_with_the_grid() -> None:
    iterations, products = zip(*(rolling_work(nodes) for nodes in (16, 32, 64)), strict=True)
    assert max(iterations) - min(iterations) <= 2
    assert max(products) < 1.3 * products[0]
    assert products[2] < 1.15 * products[1]


@pytest.mark.full
def test_work_hardly_grows_on_fine_grids() -> None:
    coarse, fine = rolling_work(32), rolling_work(128)
    assert fine[0] <= coarse[0] + 2
    assert fine[1] < 1.35 * coarse[1]


@pytest.mark.full
@pytest.mark.parametrize("motion", [((1e-3, 0.0), 0.0), ((0.0, 1e-3), 0.0), ((0.0, 0.0), 1.0)])
def test_work_hardly_grows_in_any_direction(motion: Motion) -> None:
    """Creepage along and across the rolling direction, and spin, each alone on a grid with 16 times as many nodes."""
    coarse, fine = rolling_work(32, motion), rolling_work(128, motion)
    assert fine[0] <= coarse[0] + 3
    assert fine[1] < 1.4 * coarse[1]


def test_inverse_with_friction_recovers_loads_where_some_nodes_slip() -> None:
    """Accumulation of all changes, as where all nodes stick, does not: waves along lines of slip would grow."""
    body = reduce(replace(sphere((PRESS,)), mesh=half_space_mesh(4e-2, 3e-3, 47, 1, Quad4())))
    system = SteadyRollingSystem.of(body, CellShift.of(body.points, body.frames, np.array([1.0, 0.0, 0.0])))
    x, y = (system.points[:, :2] / 1.5e-3).T
    inside = np.maximum(1.0 - (x**2 + y**2) / 0.6, 0.0)
    load = np.zeros_like(system.offset)
    load[:, 0], load[:, 1] = inside * np.sin(40.0 * y), inside * np.cos(30.0 * y)
    resistance = system.diagonal((0,))[:, 0] * np.maximum(-2.0 * x, 0.0)  # behind the middle
    sums = (system.apply(load) + resistance[:, None] * load)[:, :3]
    errors = []
    for inverse in (system.inverse_with_friction((0, 1, 2), resistance), system.approximate_inverse((0, 1, 2))):
        found = inverse(sums) * (inside > 0.0)[:, None]
        errors.append(np.linalg.norm(found - load[:, :3]) / np.linalg.norm(load))
    assert errors[0] < 0.2
    assert errors[1] > 1.0


def test_check_of_inverses_includes_friction(monkeypatch: pytest.MonkeyPatch) -> None:
    body = reduce(replace(sphere((PRESS,)), mesh=half_space_mesh(4e-2, 3e-3, 15, 1, Quad4())))
    system = SteadyRollingSystem.of(body, CellShift.of(body.points, body.frames, np.array([0.0, -1.0, 0.0])))
    check_approximate_inverse(system)
    inverse = SteadyRollingSystem.inverse_with_friction

    def with_loads_of_slipping_nodes_reversed(self, fields, resistance):
        signs = np.where(resistance > 0.0, -1.0, 1.0)[:, None]
        return lambda sums: inverse(self, fields, resistance)(sums) * signs

    monkeypatch.setattr(SteadyRollingSystem, "inverse_with_friction", with_loads_of_slipping_nodes_reversed)
    with pytest.raises(AssertionError, match=r"inverse_with_friction in fields .* does not return the loads"):
        check_approximate_inverse(system)


def test_coarser_grids_see_the_change_over_a_cell_of_the_finest() -> None:
    """So that creepages per cell apply to all of them; a change over their own cells would be twice as large."""
    body = reduce(replace(sphere((PRESS,)), mesh=half_space_mesh(4e-2, 3e-3, 63, 1, Quad4())))
    system = SteadyRollingSystem.of(body, CellShift.of(body.points, body.frames, np.array([1.0, 0.0, 0.0])))
    coarse = system.coarsen()
    x, y = coarse.system.points[:, :2].T
    load = np.zeros_like(coarse.system.offset)
    load[:, :3] = np.maximum(1.0 - (x**2 + y**2) / 1e-6, 0.0)[:, None] * [1.0, -0.5, -2.0]
    inside = np.abs(x) < 1.4e-3
    found, expected = coarse.system.apply(load), system.apply(coarse.prolong(load))[coarse.nodes]
    assert np.abs(found - expected)[inside, :2].max() < 0.1 * np.abs(expected[:, :2]).max()


def test_run_continues_from_its_files(tmp_path) -> None:
    rolls = Step(rolling=Rolling((1.0, 0.0), distance=12e-4, speed=2.0, **CREEPAGES))
    whole = run(sphere((PRESS, rolls)))
    write_result(tmp_path, whole)
    read = read_result(tmp_path)
    loading, expected = read.steps[-1].loading, whole.steps[-1].loading
    assert loading.rolling.distance == pytest.approx(12e-4)
    assert loading.duration == pytest.approx(3e-4 / 2.0)
    for name in ("direction", "creepage", "spin", "cell", "distance"):
        assert np.array_equal(getattr(loading.rolling, name), getattr(expected.rolling, name)), name
    restart = Restart("", read.zone.points, read.zone.frames, read.steps[2])
    rest = Step(rolling=Rolling((1.0, 0.0), distance=6e-4, speed=2.0, **CREEPAGES))
    for ours, theirs in zip(run(sphere((rest,), restart=restart)), whole.steps[3:], strict=True):
        assert ours.traction == pytest.approx(theirs.traction, abs=1e-9 * np.abs(theirs.traction).max())
        assert ours.loading.rolling.distance == pytest.approx(theirs.loading.rolling.distance)


@pytest.mark.parametrize("is_periodic", [False, True])
def test_compliance_is_the_same_along_the_grid(is_periodic: bool) -> None:
    """The conformance check of formulations passes, and detects a node that is softer than the others."""
    case = sphere((PRESS,), HalfSpace(matrix_up_to=0, periodic=is_periodic))
    system = reduce(case)
    check_translation(case.formulation, system)
    extra = np.zeros((len(system.points), 5, 5))
    extra[200, 0, 0] = 1e-6 * system.diagonal_blocks()[200, 0, 0]
    with pytest.raises(AssertionError, match="not the same along the grid"):
        check_translation(case.formulation, correct_edge(system, extra))


def test_tables_and_figures_show_numbers_of_rolling() -> None:
    result = run(sphere((PRESS, steady(**CREEPAGES), steady(creepage=(1e-3, 0.0)))))
    numbers = rolling_totals(result.zone, result.steps[1])
    at_rest, rolls, _ = summary(result)["steps"]
    assert at_rest["rolling"] is None
    assert rolls["rolling"]["creep_work"] == pytest.approx(numbers["creep_work"])
    drawn = {curve.name: curve for curve in curves(result)}
    assert drawn["creepage"].up[2] == pytest.approx(np.array([[5e-4, 3e-4], [1e-3, 0.0]]))
    assert drawn["creep force"].up[2][0] == pytest.approx(numbers["creep_force"])
    assert drawn["sticking area"].up[2].shape == (2, 1)
    table = result.to_dataframe()
    assert table["creepage_longitudinal"].iloc[1] == pytest.approx(5e-4)
    assert np.isnan(table["creep_work"].iloc[0])
    assert not {"friction_power", "duration"} & set(table.columns)
    assert table.attrs["units"]["spin"] == "1/m"
    assert "creepage_longitudinal" not in run(sphere((PRESS,))).to_dataframe().columns
