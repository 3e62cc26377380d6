"""Random problems, judged from their result files by code that shares nothing with the solvers; faults that the judge
must find; problems that once failed."""

import re
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[3] / "validation" / "campaigns"))

import admissibility
import judge
import problems
import random_problems

import meeframe
from meeframe.contact.problem import Status
from meeframe.model import continuation
from meeframe.model.load import load_case
from meeframe.model.solve import bodies_of, solve_case
from meeframe.results.resultants import resultants
from meeframe.testing import create

CASE = """
material = { name = "batio3-cofe2o4" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 8 }
formulation = { name = "half-space" }
indenter = { name = "sphere", radius = "100 mm" }
contact = { law = { name = "isotropic-coulomb", mu = 0.3 } }
conductivity = { electric = { name = "step", kappa = 1e-6 }, magnetic = { name = "step", kappa = 1e-3 } }
output = { figures = false, vtu = false, fields = ["slip", "total_slip", "slip_path"] }
steps = [{ normal_force = 100 }, { translation = [5e-7, 0], electric_potential = 100, magnetic_flux = 1e-6 }]
"""


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """Return the folder of a result with stick, slip and conduction, and the compliances of its body."""
    folder = tmp_path_factory.mktemp("solved")
    (folder / "case.toml").write_text(CASE, encoding="utf-8")
    case = load_case(folder / "case.toml")
    meeframe.run(case, folder / "out")
    return folder / "out", tuple(random_problems.compliance(*each) for each in bodies_of(case))


def worst(folder, compliances):
    return judge.judge(judge.read(folder), compliances)[-1]


def test_a_correct_result(solved):
    violations = worst(*solved)
    assert max(violations.values()) < 1e-8, violations


FAULTS = {
    "pressure": ("traction", lambda values: values * np.array([1, 1, 1 + 1e-5]), "compliance"),
    "friction": ("traction", lambda values: values * np.array([1 + 1e-5, 1, 1]), "friction beyond its limit"),
    "direction": ("traction", lambda values: values[:, [1, 0, 2]], "dissipation"),
    "tension": ("traction", lambda values: values + 1e4 * (values[:, 2:] == 0.0), "tension"),
    "displacement": ("displacement", lambda values: values * (1 + 1e-5), "compliance"),
    "flux": ("electric_flux", lambda values: values * (1 + 1e-5), "electric conduction"),
    "potential": ("electric_potential", lambda values: values * (1 + 1e-5), "compliance"),
    "gap": ("initial_gap", lambda values: values + 1e-10, "complementarity"),
    "slip": ("slip", lambda values: values * 1.001, "slip"),
    "force": ("loading/prescribed/normal_force", lambda values: values * (1 + 1e-5), "prescribed normal_force"),
    "total flux": ("loading/prescribed/magnetic_flux", lambda values: values * (1 + 1e-4), "prescribed magnetic_flux"),
    "motion": ("loading/translation", lambda values: values * (1 + 1e-5), "position"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_found(solved, tmp_path, name):
    source, compliances = solved
    dataset, change, statement = FAULTS[name]
    (tmp_path / "result.h5").write_bytes((source / "result.h5").read_bytes())
    with h5py.File(tmp_path / "result.h5", "r+") as file:
        entry = file[f"steps/0002/{dataset}"]
        entry[...] = change(entry[()])
    assert worst(tmp_path, compliances)[statement] > random_problems.TOLERANCE


@pytest.mark.parametrize(
    ("way", "angle", "share", "is_found"),
    [(1e-5, 0.0, 1.0, False), (1e-5, 1e-5, 1.0, False), (1.0, 1e-5, 1.0, True), (1e-5, 0.0, 0.999, True)],
)
def test_directions_of_short_slips_are_uncertain(way, angle, share, is_found):
    keys = {"mu1": 0.4, "mu2": 0.2, "slip_ratio": 0.4, "angle": -0.7, "slip_angle": 0.1}
    angles = np.linspace(0.0, 2.0 * np.pi, 50)
    trial = np.column_stack([np.cos(angles), np.sin(angles), -np.ones(50)])
    law = create("contact law", {"name": "non-associated-coulomb", **keys})
    friction = law.resolve(trial, np.zeros((50, 3)), (1.0, 1.0))[:, :2]
    slip = (trial[:, :2] - friction) @ np.linalg.inv(law.tangential_scaling())
    slip *= way / np.linalg.norm(slip, axis=1, keepdims=True)
    slip = slip @ [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    ones, zeros = np.ones(50), np.zeros(50)
    nodes = admissibility.Nodes(ones, zeros, share * friction, slip, zeros, 1.0, 1.0, None)
    found = admissibility.friction_violations({"name": "non-associated-coulomb", **keys}, nodes)
    largest = max(violation.max() for violation in found.values())
    assert (largest > random_problems.TOLERANCE) if is_found else (largest < 1e-9)


@pytest.mark.parametrize(
    "seed", [5001, 5002, 6513, 6650, 6959, 7266, 7861, 9210, 20297, 52222, 52387, 71351, 84707, 90589, 98754, 101333]
)
def test_random_problems(seed):
    """The seeds from 6513 on once failed.

    They have conduction that almost insulates, sets in steeply or strongly, floating potentials, a return to no
    approach, a release from friction that is not along the slip, increments solved from states under a part of the
    load or of the conductivity, or with a matrix, a floating potential behind a poor conductor, a gap that conducts
    after the indenter is withdrawn, a gap with potentials far below those that contact would cause, and a single node
    without total charge.
    """
    answer = random_problems.answer(seed, "auto")
    assert answer.outcomes
    assert set(answer.outcomes) <= {"converged", "rejected", "stalled, with a reason"}, answer.notes


@pytest.mark.parametrize("seed", [20561, 71167, 71598, 94149, 96056, 101368])
def test_limits_that_jump(seed):
    """Nodes that shear would lift touch without pressure: these problems had increments without a solution.

    Some of them attract the indenter, conduct, or have a contact edge between nodes.
    """
    answer = random_problems.answer(seed, "auto")
    assert set(answer.outcomes) == {"converged"}, answer.notes


def test_a_large_coefficient(tmp_path):
    """Newton's method finds no state by itself."""
    file = tmp_path / "case.toml"
    file.write_text(problems.draw(82867, tmp_path, "auto").replace("mu = inf", "mu = 50.0"))
    steps = solve_case(load_case(file)).steps
    assert {step.status for step in steps} == {Status.CONVERGED}
    assert any("friction of at most" in step.message for step in steps)


def test_an_attraction_that_exceeds_the_pressure(tmp_path, monkeypatch):
    """A node that sticks under it needs a smaller one, not none. Polygons as limits lead to another state."""
    monkeypatch.setattr(continuation, "solve_from_polyhedral_friction", lambda *arguments: None)
    file = tmp_path / "case.toml"
    history, _, last = problems.draw(88938, tmp_path, "auto").rpartition("[[steps]]")
    file.write_text(f"{history}[[steps]]{last.replace('increments = 3', 'increments = 1')}")
    steps = solve_case(load_case(file)).steps
    assert {step.status for step in steps} == {Status.CONVERGED}
    assert "1 node touches without pressure" in steps[-1].message


def test_steep_conduction_beside_resolved_edges(tmp_path):
    """Conductivities rise more and more suddenly at nodes first, and then with the contact edge found there."""
    file = tmp_path / "case.toml"
    first_step = problems.draw(84349, tmp_path, "auto").rpartition("[[steps]]")[0]
    file.write_text(first_step.replace("increments = 2", "increments = 1"))
    (step,) = solve_case(load_case(file)).steps
    assert step.status is Status.CONVERGED
    assert step.area_fraction is not None
    assert "from a state with gradual conductivities" in step.message


def test_a_force_at_which_potentials_pull_the_surfaces_in(tmp_path):
    """States under larger forces or conductivities mostly end before it, those with an approach do not."""
    file = tmp_path / "case.toml"
    text = problems.draw(86999, tmp_path, "auto").replace('edges = "resolved"\n', "").replace("matrix_up_to = 0\n", "")
    text = re.sub(r"law = \{.*\}", 'law = "signorini"', text).replace("stall_window = 120", "stall_window = 24")
    file.write_text("[[steps]]".join(text.split("[[steps]]")[:2]))
    result = solve_case(load_case(file))
    assert {step.status for step in result.steps} == {Status.CONVERGED}
    assert resultants(result.zone, result.steps[-1]).normal_force == pytest.approx(55.84125084362929, rel=1e-9)


def test_a_campaign_continues_after_a_stop(tmp_path, monkeypatch, capsys):
    record, asked = tmp_path / "answers.jsonl", []

    def answer(seed, solver):
        asked.append(seed)
        return random_problems.Answer(seed, ["converged", "stalled, with a reason"], ["words"], 1e-9, 0.5)

    monkeypatch.setattr(random_problems, "answer", answer)
    for number in (2, 3, 3):
        arguments = ["--seed", "7", "--number", str(number), "--record", str(record)]
        monkeypatch.setattr(sys, "argv", ["random_problems.py", *arguments])
        assert random_problems.main() == 0
        if number == 2:
            record.write_text(record.read_text()[:-5], encoding="utf-8")  # a stop cuts the last line off
    assert asked == [7, 8, 8, 9]
    assert "3 problems, 6 increments" in capsys.readouterr().out
