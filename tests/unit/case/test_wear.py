"""Wear in load steps, against closed forms of independent springs; files, restart and rejected cases."""

from dataclasses import dataclass, replace

import h5py
import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError
from meeframe.contact.problem import ContactState
from meeframe.fields import Array
from meeframe.laws import Signorini
from meeframe.laws.wear import WearLaw
from meeframe.model.load import load_case
from meeframe.model.preflight import planned, undeformed
from meeframe.model.solve import solve_case
from meeframe.model.wear import without_wear

STIFFNESS, DEPTH, RADIUS = 1e14, 10e-6, 0.1
"""Stiffness of the springs [Pa/m], approach and radius of the sphere [m]."""
COEFFICIENT = 1e-13
WEAR = '\n[contact.wear]\nname = "archard"\ncoefficient = "1e-13 1/Pa"\n'
PRESS = ('approach = "10 um"', 'approach = "10 um"\nsliding = 0')


def slide(distance="0.2 m", increments=1):
    return f'\n[[steps]]\nsliding = "{distance}"\nincrements = {increments}\n'


def solve(write_case, registry, more, *changes):
    return solve_case(load_case(write_case(PRESS, *changes, more=WEAR + more), registry))


def overlap(zone):
    """Return the overlap (n,) [m] of the sphere with the undeformed surface."""
    height = (zone.points[:, 0] ** 2 + zone.points[:, 1] ** 2) / (2.0 * RADIUS)
    return np.maximum(DEPTH - height, 0.0)


@pytest.mark.parametrize("increments", [1, 5])
def test_springs_wear_as_by_the_implicit_euler_method(write_case, registry, increments):
    """Each spring under a held indenter has p = K (d - w) with dw/ds = k p: p falls by 1 + k K ds in each increment."""
    result = solve(write_case, registry, slide(increments=increments))
    assert result.status == "converged"
    first, *others = result.steps
    assert not first.wear.any(), "a step with sliding = 0 wears nothing"
    factor = 1.0 + COEFFICIENT * STIFFNESS * 0.2 / increments
    for number, step in enumerate(others, 1):
        expected = overlap(result.zone) * (1.0 - factor**-number)
        np.testing.assert_allclose(step.wear, expected, rtol=0.0, atol=1e-9 * DEPTH)
        np.testing.assert_allclose(step.gap[step.touching], 0.0, atol=1e-9 * DEPTH)
        np.testing.assert_allclose(-step.traction[:, 2], STIFFNESS * (overlap(result.zone) - expected), atol=1.0)
        np.testing.assert_allclose(step.slip_path[step.touching], number * 0.2 / increments, rtol=1e-12)


def test_wear_is_of_first_order(write_case, registry):
    """The error at the deepest node against p = K d exp(-k K s) halves with the increments."""
    errors = []
    for increments in (8, 16, 32):
        worn = solve(write_case, registry, slide(increments=increments)).steps[-1].wear.max()
        exact = DEPTH * (1.0 - np.exp(-COEFFICIENT * STIFFNESS * 0.2))
        errors.append(abs(worn - exact))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 1.0, atol=0.1)


@pytest.mark.full
def test_increments_are_divided_for_the_pressure_to_change_little(write_case, registry):
    """Under a held indenter the pressure falls by exp(-k K s): the error goes with the change that is allowed."""
    exact = DEPTH * (1.0 - np.exp(-COEFFICIENT * STIFFNESS * 0.2))
    errors = []
    for change in (0.1, 0.05, 0.025):
        result = solve(write_case, registry, slide(increments=2) + f"max_pressure_change = {change}\n")
        assert result.status == "converged"
        _, first, last = result.steps
        assert "subincrements, for the pressure to change little" in first.message
        np.testing.assert_allclose(last.slip_path[last.touching], 0.2, rtol=1e-12)
        errors.append(abs(last.wear.max() - exact))
    assert errors[0] < 0.05 * exact
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 1.0, atol=0.25)


def test_subincrements_add_up(write_case, registry):
    """In full slip the pressure falls by exp(-k K s), and the work of friction is its integral times mu."""
    law = '\n[contact]\nlaw = {name = "isotropic-coulomb", mu = 0.2}\n' + WEAR
    drag = '\n[[steps]]\ntranslation = ["0.2 m", 0]\nduration = "2 s"\nmax_pressure_change = 0.1\n'
    result = solve_case(load_case(write_case(PRESS, more=law + drag), registry))
    first, last = result.steps
    assert last.loading.duration == pytest.approx(2.0)
    np.testing.assert_allclose(last.slip, last.total_slip - first.total_slip, rtol=0.0, atol=1e-14)
    decay = 1.0 - np.exp(-COEFFICIENT * STIFFNESS * 0.2)
    work = 0.2 * overlap(result.zone) / COEFFICIENT * decay
    np.testing.assert_allclose(last.dissipation, work, rtol=0.0, atol=0.05 * work.max())
    np.testing.assert_allclose(last.wear, overlap(result.zone) * decay, rtol=0.0, atol=0.05 * DEPTH)


def test_worn_volume_under_a_held_force(write_case, registry):
    """V = k P s, whatever the pressure, and the force stays."""
    press = ('approach = "10 um"', 'normal_force = "2 kN"')
    result = solve_case(load_case(write_case(press, more=WEAR + slide("3 m", 4)), registry))
    totals = meeframe.resultants(result.zone, result.steps[-1])
    assert totals.normal_force == pytest.approx(2e3, rel=1e-9)
    assert totals.worn_volume == pytest.approx(COEFFICIENT * 2e3 * 3.0, rel=1e-8)


def test_slip_of_a_translation_wears(write_case, registry):
    """In full slip under friction the slip is the translation without the shear of the springs, mu p / K."""
    law = '\n[contact]\nlaw = {name = "isotropic-coulomb", mu = 0.2}\n' + WEAR
    drag = '\n[[steps]]\ntranslation = ["50 um", 0]\n'
    result = solve_case(load_case(write_case(PRESS, more=law + drag), registry))
    step = result.steps[-1]
    pressure = -step.traction[:, 2]
    slip = np.where(step.touching, 5e-5 - 0.2 * pressure / STIFFNESS, 0.0)
    np.testing.assert_allclose(step.slip[step.touching, 0], slip[step.touching], rtol=1e-8)
    np.testing.assert_allclose(step.wear, COEFFICIENT * pressure * slip, rtol=0.0, atol=1e-10 * step.wear.max())
    np.testing.assert_allclose(pressure, STIFFNESS * (overlap(result.zone) - step.wear), atol=1.0)
    np.testing.assert_allclose(step.dissipation, 0.2 * pressure * step.slip[:, 0], rtol=1e-3)


@dataclass(frozen=True)
class Saturating(WearLaw):
    """A rate that grows ever less with the pressure, falls with the worn depth, and grows with the speed."""

    needs_duration = True

    def rate(self, pressure: Array, speed: Array, worn: Array) -> Array:
        return 1e-4 * np.tanh(pressure / 4e8) * np.sqrt(speed) / (1.0 + worn / 1e-6)


def test_law_that_is_not_in_proportion_to_the_pressure(write_case, registry):
    """The depth of an increment follows from the pressure at its end, the speed, and the depth at its beginning."""
    timed = ("approach", 'duration = "1 s"\napproach')
    case = load_case(write_case(PRESS, timed, more=WEAR + slide(increments=3)), registry)
    steps = (case.steps[0], replace(case.steps[1], duration=0.1))
    result = solve_case(replace(case, wear=Saturating(), steps=steps))
    assert result.status == "converged"
    for before, step in zip(result.steps, result.steps[1:], strict=False):
        pressure, distance = -step.traction[:, 2], 0.2 / 3
        rate = Saturating().rate(pressure, np.full_like(pressure, 2.0), before.wear)
        np.testing.assert_allclose(step.wear - before.wear, rate * distance, rtol=0.0, atol=1e-9 * DEPTH)
        np.testing.assert_allclose(pressure, STIFFNESS * (overlap(result.zone) - step.wear), atol=1.0)
    with pytest.raises(CaseError, match="load step 1 has no duration, which the wear law Saturating needs"):
        replace(case, wear=Saturating(), steps=(replace(steps[0], duration=None), steps[1]))


def test_two_bodies_wear_as_one(write_case, registry, second_body):
    """Springs in series, three times as stiff below: the gap opens by the sum of what both lose."""
    result = solve(write_case, registry, slide() + second_body)
    stiffness = 0.75 * STIFFNESS
    step = result.steps[-1]
    expected = overlap(result.zone) * (1.0 - 1.0 / (1.0 + COEFFICIENT * stiffness * 0.2))
    np.testing.assert_allclose(step.wear, expected, rtol=0.0, atol=1e-9 * DEPTH)
    np.testing.assert_allclose(step.gap[step.touching], 0.0, atol=1e-9 * DEPTH)


def test_wear_in_files_and_restart(write_case, registry, tmp_path):
    """A restarted run continues with the worn surface; files, tables and summaries hold it."""
    whole = solve(write_case, registry, slide("0.2 m") + slide("0.3 m", 2))
    output = '\n[output]\nstep = "last"\n'
    meeframe.run(load_case(write_case(PRESS, more=WEAR + slide("0.2 m") + output), registry), tmp_path / "first")
    stored = meeframe.read_result(tmp_path / "first")
    for ours, theirs in zip(stored.steps, whole.steps, strict=False):
        for name in ("wear", "slip_path", "initial_gap"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert (tmp_path / "first" / "wear.png").exists()
    text = (tmp_path / "first" / "summary.json").read_text()
    assert f'"worn_volume": {meeframe.resultants(stored.zone, stored.steps[-1]).worn_volume!r}' in text
    assert stored.to_xarray()["wear"][-1].values.max() == stored.steps[-1].wear.max()
    more = WEAR + '\n[restart]\nfrom = "first"\n' + slide("0.3 m", 2)
    second = solve_case(load_case(write_case(('[[steps]]\napproach = "10 um"\n', ""), more=more), registry))
    for ours, theirs in zip(second.steps, whole.steps[2:], strict=True):
        np.testing.assert_allclose(ours.wear, theirs.wear, rtol=0.0, atol=1e-12 * DEPTH)
        np.testing.assert_allclose(ours.slip_path, theirs.slip_path, rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "more", "message"),
    [
        (
            [],
            slide(),
            r"steps\[2\]: load step 2 has a sliding distance, which concerns wear alone; allowed: with \[contact",
        ),
        (
            [],
            "\n[[steps]]\nmax_pressure_change = 0.1\n",
            r"steps\[2\]: load step 2 has a max_pressure_change, which concerns wear alone",
        ),
        ([], WEAR + "\n[[steps]]\nmax_pressure_change = 0\n", r"max_pressure_change = 0: must be > 0"),
        ([], WEAR + slide("-1 m"), r"steps\[2\]\.sliding = '-1 m': must be >= 0"),
        ([], WEAR + slide("1e18 m"), r"steps\[2\]\.sliding = '1e18 m': must be >= 0 and <= 1e\+12"),
        ([], WEAR.replace("1e-13", "-1"), r"contact\.wear\.coefficient = '-1 1/Pa': must be >= 0"),
        (
            [],
            WEAR.replace("archard", "archer"),
            r"contact\.wear\.name: unknown wear law 'archer'; did you mean 'archard'?",
        ),
        (
            [],
            '\n[contact]\nlaw = {name = "isotropic-coulomb", mu = 0.2}\n' + WEAR + slide(),
            r"steps\[2\]: load step 2 has a sliding distance, which has no direction.*allowed: a translation",
        ),
        (
            [],
            '\n[contact]\nlaw = {name = "dmt", mu = 0, work_of_adhesion = 1, equilibrium_distance = "1 nm"}\n' + WEAR,
            r"contact\.wear: wear under the contact law .* is not available; allowed: contact laws of",
        ),
        (
            [],
            '\n[contact]\nlaw = {name = "compliant", mu = 0, reference_pressure = 1e9, reference_closure = 1e-6}\n'
            + WEAR,
            r"contact\.wear: wear under the contact law .* is not available; allowed: contact laws of",
        ),
    ],
)
def test_rejected_cases(write_case, registry, changes, more, message):
    with pytest.raises(CaseError, match=message):
        load_case(write_case(*changes, more=more), registry)


@dataclass(frozen=True)
class Faulty(WearLaw):
    fault: str

    def rate(self, pressure: Array, speed: Array, worn: Array) -> Array:
        if self.fault == "changes":
            pressure *= 2.0
        return {"negative": -pressure, "shape": pressure[:-1], "list": list(pressure)}.get(self.fault, pressure)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("negative", "rate of the wear law Faulty is -100000.0 at 100000 Pa; allowed: finite numbers >= 0"),
        ("shape", "rate of the wear law Faulty is .*; allowed: an array of real numbers, one for each pressure"),
        ("list", "rate of the wear law Faulty is .*; allowed: an array of real numbers, one for each pressure"),
        ("changes", "rate of the wear law Faulty changes its arguments; allowed: a new array"),
    ],
)
def test_wear_laws_that_violate_their_contract(write_case, registry, fault, message):
    with pytest.raises(CaseError, match=message):
        replace(load_case(write_case(), registry), wear=Faulty(fault))


def test_case_in_python():
    """The law and the distance are arguments in Python, and entries of the case file that it writes."""
    case = meeframe.Case(
        material="batio3-cofe2o4",
        mesh=meeframe.mesh.half_space("5 mm", divisions=4),
        indenter=meeframe.Sphere("100 mm"),
        contact=meeframe.Contact(wear=meeframe.wear("archard", coefficient="1e-13 1/Pa")),
        steps=[meeframe.Step(approach="10 um", sliding="1 m")],
    )
    read = meeframe.Case.from_toml(case.to_toml()).checked
    assert read.wear == case.checked.wear == meeframe.Archard(1e-13)
    assert read.steps[0].sliding == 1.0


@pytest.mark.parametrize("more", ["", "max_pressure_change = 0.5\n"])
def test_increments_that_do_not_converge_end_with_their_status(write_case, registry, more):
    """Nothing is raised, and the depths are those of the last state."""
    limited = '\n[solver]\nname = "uzawa"\nmax_iterations = 1\n'
    failed = solve(write_case, registry, slide() + more + limited)
    assert failed.status == "not-converged"
    assert "iteration-limit" in [step.status for step in failed]
    assert np.isfinite(failed.steps[-1].wear).all()


def test_states_that_are_not_finite(write_case, registry):
    """The depth of a diverged state is zero where it is not a number."""
    kinematics = undeformed(load_case(write_case(PRESS, more=WEAR + slide()), registry))
    (_, increment) = planned(kinematics)
    n = len(increment.problem.gap)
    values = np.where(np.arange(5 * n).reshape(n, 5) % 7 == 0, np.nan, -1e300)
    problem, depth = without_wear(increment.problem, ContactState(values, values, np.zeros(n)))
    assert np.isfinite(depth).all()
    assert problem.contact_law == Signorini()


def test_files_of_earlier_versions_have_no_wear(write_case, registry, tmp_path):
    case = load_case(write_case(more="\n[output]\nfigures = false\nvtu = false\n"), registry)
    meeframe.run(case, tmp_path / "out")
    with h5py.File(tmp_path / "out" / "result.h5", "r+") as file:
        attributes = file["steps/0001"].attrs
        attributes["zero"] = " ".join(name for name in attributes["zero"].split() if name != "wear")
    (step,) = meeframe.read_result(tmp_path / "out")
    assert step.wear.shape == step.slip_path.shape
    assert not step.wear.any()
