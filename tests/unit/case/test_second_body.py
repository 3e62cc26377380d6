"""Test case files of two deformable bodies on beds of springs in series, for which contact has a closed form."""

from dataclasses import dataclass, field, replace
from weakref import WeakSet

import h5py
import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError, MeshError
from meeframe.elements import Quad4
from meeframe.formulations.base import Formulation
from meeframe.mesh import block_mesh
from meeframe.model.cache import cached_reduce
from meeframe.model.load import load_case
from meeframe.model.second_body import SecondBody
from meeframe.model.solve import reduce
from meeframe.model.step import Step
from meeframe.results.files import read_result
from meeframe.results.records import RunStatus
from meeframe.system.reduced import silent
from meeframe.system.two_body import second_load

STIFFNESS, OTHER, RADIUS = 1e14, 3e14, 0.1
IN_SERIES = STIFFNESS * OTHER / (STIFFNESS + OTHER)
ELECTRIC = 1e13  # stiffness of the springs in tests/conftest.py


@pytest.fixture
def case(write_case, registry, second_body):
    return load_case(write_case(more=second_body), registry)


def springs(points, approach):
    return IN_SERIES * np.minimum((points[:, 0] ** 2 + points[:, 1] ** 2) / (2 * RADIUS) - approach, 0.0)


def test_tables_of_the_file(case):
    second_body = case.second_body
    assert (second_body.material.name, second_body.zone, second_body.formulation.stiffness) == (
        "pzt-4",
        "contact",
        OTHER,
    )
    assert np.ptp(second_body.mesh.points, axis=0) == pytest.approx([0.08, 0.08, 0.06])
    assert [condition.field for condition in second_body.conditions] == [0, 1, 2, 3, 4]


def test_springs_in_series(case):
    result = meeframe.solve_case(case)
    assert result.status is RunStatus.CONVERGED
    (step,) = result.steps
    expected = springs(result.zone.points, 1e-5)
    contact_fraction = expected < 0
    np.testing.assert_allclose(step.traction[:, 2], expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(step.displacement[:, 2], expected / STIFFNESS, atol=1e-14)
    np.testing.assert_allclose(step.second_body.displacement[:, 2], -expected / OTHER, atol=1e-14)
    np.testing.assert_allclose(step.gap[contact_fraction], 0.0, atol=1e-13)
    assert (step.gap[~contact_fraction] > 0).all()
    # the fields on the boundary are those of the first body
    np.testing.assert_allclose(step.boundary.values[:, 2], step.displacement[:, 2], atol=1e-14)


def test_prescribed_force(case):
    (moved,) = meeframe.solve_case(case).steps
    pressed = replace(case, steps=(Step(normal_force=case_force(case, moved)),))
    (step,) = meeframe.solve_case(pressed).steps
    assert step.loading.approach == pytest.approx(1e-5, rel=1e-8)
    np.testing.assert_allclose(step.second_body.displacement, moved.second_body.displacement, rtol=1e-7, atol=1e-14)


def case_force(case, step):
    return float(-reduce(case).weights @ step.traction[:, 2])


@pytest.fixture
def conducting(write_case, registry, second_body):
    """Return a perfectly conducting case with 2 kV between the grounds and a tangential motion without slip."""
    path = write_case(
        ("[[steps]]", '[conductivity.electric]\nname = "step"\nkappa = inf\n\n[[steps]]\nelectric_potential = "2 kV"'),
        ("[indenter]", '[contact]\nlaw = { name = "isotropic-coulomb", mu = inf }\n\n[indenter]'),
        ('"10 um"', '"10 um"\ntranslation = ["1 um", "2 um"]'),
        more=second_body,
    )
    return load_case(path, registry)


def test_voltage_and_tangential_motion_of_both_bodies(conducting):
    (step,) = meeframe.solve_case(conducting).steps
    contact_fraction = step.contact_fraction == 1
    assert contact_fraction.any()
    flux = -2e3 / (ELECTRIC / STIFFNESS + ELECTRIC / OTHER)
    np.testing.assert_allclose(step.fluxes[contact_fraction, 0], flux, rtol=1e-8)
    np.testing.assert_allclose(step.potentials[contact_fraction, 0], -ELECTRIC / STIFFNESS * flux, rtol=1e-8)
    np.testing.assert_allclose(step.second_body.potentials[contact_fraction, 0], ELECTRIC / OTHER * flux, rtol=1e-8)
    jump = step.potentials - step.second_body.potentials
    np.testing.assert_allclose(jump[contact_fraction, 0], 2e3, rtol=1e-8)
    pulled = step.displacement[contact_fraction, :2] - step.second_body.displacement[contact_fraction, :2]
    np.testing.assert_allclose(pulled, np.tile([1e-6, 2e-6], (contact_fraction.sum(), 1)), rtol=1e-7)
    share = OTHER / (STIFFNESS + OTHER)
    np.testing.assert_allclose(step.displacement[contact_fraction, :2], share * pulled, rtol=1e-7)


def test_result_file_contains_both_surfaces(conducting, tmp_path):
    folder = tmp_path / "out"
    (made,) = meeframe.run(conducting, out=folder).steps
    (read,) = read_result(folder).steps
    np.testing.assert_array_equal(read.second_body.displacement, made.second_body.displacement)
    np.testing.assert_array_equal(read.second_body.potentials, made.second_body.potentials)
    np.testing.assert_array_equal(read.state.displacement, made.state.displacement)
    np.testing.assert_array_equal(read.gap, made.gap)
    with h5py.File(folder / "result.h5") as file:
        units = {name: own.attrs["units"] for name, own in file["steps/0001/second_body"].items()}
        zero = file["steps/0001/second_body"].attrs["zero"].split()
    assert units | dict.fromkeys(zero, "") == {"displacement": "m", "electric_potential": "V", "magnetic_potential": ""}
    assert (folder / "fields.vtu").is_file()


def test_state_matches_springs_in_series(conducting):
    system = reduce(conducting)
    assert len(system.terms) == 2
    (step,) = meeframe.solve_case(conducting).steps
    expected = system.offset + system.apply(step.state.load)
    np.testing.assert_allclose(step.state.displacement, expected, rtol=1e-12, atol=1e-18)


def test_restart(write_case, registry, tmp_path, second_body):
    further = '\n[[steps]]\napproach = "20 um"\n'
    both = meeframe.solve_case(load_case(write_case(more=further + second_body), registry)).steps
    first = load_case(write_case(more=second_body + "\n[output]\nfigures = false\nvtu = false\n"), registry)
    meeframe.run(first, out=tmp_path / "first")
    text = write_case(('"10 um"', '"20 um"'), more=f'\n[restart]\nfrom = "first"\n{second_body}')
    (continued,) = meeframe.solve_case(load_case(text, registry)).steps
    for name in ("traction", "displacement", "total_slip"):
        computed, expected = getattr(continued, name), getattr(both[1], name)
        np.testing.assert_allclose(computed, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())
    alone = load_case(write_case(('"10 um"', '"20 um"'), more='\n[restart]\nfrom = "first"\n'), registry)
    with pytest.raises(CaseError, match="cause other displacements in this body"):
        meeframe.solve_case(alone)


@dataclass(frozen=True)
class Watched(Formulation):
    """Records at each reduction how many earlier systems still hold the data for their fields."""

    inner: Formulation
    kept: list[WeakSet] = field(default_factory=lambda: [WeakSet()], compare=False)
    counts: list[int] = field(default_factory=list, compare=False)

    def check(self, body):
        self.inner.check(body)

    def reduce(self, body, progress=silent):
        self.counts.append(len(self.kept[0]))
        system = self.inner.reduce(body, progress)
        self.kept[0].add(system.recovery)
        return system


def test_second_body_is_reduced_first_and_keeps_its_matrix_only(case):
    watched = Watched(case.formulation)
    system = reduce(replace(case, formulation=watched, second_body=replace(case.second_body, formulation=watched)))
    assert watched.counts == [0, 0]
    assert len(watched.kept[0]) == 1, "of the body, whose fields are in the result"
    load = np.random.default_rng(3).normal(size=system.offset.shape)
    reaction = second_load(system, load)
    expected = watched.inner.reduce(case.second_body.body).recover(reaction)
    for _ in range(2):
        np.testing.assert_array_equal(system.terms[1].system.recover(reaction).values, expected.values)
    system.recover(load)
    assert len(watched.counts) == 3, "reduced again once"


def test_each_body_is_cached(case, tmp_path):
    made = cached_reduce(case, tmp_path)
    assert len(list(tmp_path.glob("*.h5"))) == 2
    cached_reduce(replace(case, second_body=None), tmp_path)
    assert len(list(tmp_path.glob("*.h5"))) == 2, "a body alone is one of the two"
    cached = cached_reduce(case, tmp_path)
    assert len(cached.terms) == 2
    np.testing.assert_array_equal(cached.dense(), made.dense())
    np.testing.assert_array_equal(cached.dense(), reduce(case).dense())


WRONG = {
    "width": (
        ('contact_width = "5 mm"', 'contact_width = "4 mm"'),
        r"second_body\.mesh: the contact zones .* do not match: 12 of the 16 elements .* with up to 64% of their area",
    ),
    "zone": (('zone = "contact"', 'zone = "kontact"'), r"second_body\.zone = 'kontact': no face group 'kontact'"),
    "group": (('"base"', '"bottom"'), r"second_body\.boundary\[1\]\.group = 'bottom': no face group 'bottom'"),
    "zone group": (
        ('"base"', '"contact"'),
        r"second_body\.boundary\[1\]\.group = 'contact': .* it is the contact zone",
    ),
    "free": (("displacement = [0, 0, 0]", 'displacement = [0, 0, "free"]'), r"second_body\.boundary: .* leave 3 of"),
    "material": (('"pzt-4"', '"pzt-44"'), r"second_body\.material: unknown material 'pzt-44'"),
    "formulation": (('"winkler"', '"winkel"'), r"second_body\.formulation\.name: unknown formulation 'winkel'"),
    "number": (('"3e14 Pa/m"', '"3 m"'), r"second_body\.formulation\.stiffness = '3 m'"),
    "mesh": (("rings = 3", "rings = 0"), r"second_body\.mesh\.rings = 0"),
    "key": (('zone = "contact"', 'zones = "contact"'), r"second_body\.zones"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_errors_name_the_key(write_case, registry, wrong, second_body):
    (old, new), message = WRONG[wrong]
    assert second_body.count(old) == 1
    path = write_case(more=second_body.replace(old, new))
    with pytest.raises(CaseError, match=message) as caught:
        load_case(path, registry)
    assert len(str(caught.value).splitlines()) == 1


def test_problems_of_both_bodies_are_shown_together(write_case, registry, second_body):
    path = write_case(
        ('name = "batio3-cofe2o4"', 'name = "batio"'),
        more=second_body.replace('"pzt-4"', '"pzt"').replace("= 3\n", "= 0\n"),
    )
    with pytest.raises(CaseError) as caught:
        load_case(path, registry)
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    for problem in ("material: unknown", "second_body.material: unknown", "second_body.mesh.rings = 0"):
        assert any(f": {problem}" in line for line in lines)


def test_missing_tables_are_named(write_case, registry):
    with pytest.raises(CaseError, match=r"second_body\.mesh") as caught:
        load_case(write_case(more='\n[second_body]\nmaterial = { name = "pzt-4" }\n'), registry)
    assert len(str(caught.value).splitlines()) == 1


def test_objects_are_checked(case):
    narrow = block_mesh(0.05, 0.12, 0.004, 2, 2, 1, Quad4())
    with pytest.raises(MeshError, match="do not match"):
        replace(case, second_body=replace(case.second_body, mesh=narrow))
    with pytest.raises(CaseError, match="no boundary condition prescribes electric_potential"):
        SecondBody(case.material, narrow)
