"""The compliant law on docs/howto/plugins.md is registered, conforms, and behaves as described."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw
from meeframe.plugin.registry import Kind, load
from meeframe.solvers import BarzilaiBorwein, SemismoothNewton, solve
from meeframe.testing import check_contact_law
from meeframe.testing.contact import check_monotone
from meeframe.testing.half_space import half_space_system, indentation_problem

PAGE = Path(__file__).parents[3] / "docs" / "howto" / "plugins.md"
STIFFNESS = 1e12


@pytest.fixture(scope="module")
def source() -> str:
    return re.search(r"^```python\n# spring_layer.py\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)[1]


@pytest.fixture(scope="module")
def law(source, tmp_path_factory) -> ContactLaw:
    file = tmp_path_factory.mktemp("page") / "spring_layer.py"
    file.write_text(source, encoding="utf-8")
    return load(file).create(Kind.CONTACT_LAW, {"name": "spring-layer", "stiffness": "1e6 MPa/m", "mu": 0.3})


def test_law_has_fewer_than_thirty_lines(source):
    body = source[source.index("@dataclass") : source.index("@hookimpl")].strip()
    assert len(body.splitlines()) < 30


def test_conformance(law):
    check_contact_law(law)
    check_monotone(law)


def test_overlap_is_proportional_to_pressure(law):
    system = half_space_system(np.diag([2.4e-12, 2.2e-12, 2e-12, -2e7, -1e3]), 5e-3, 10)
    x, y, _ = system.points.T
    problem = indentation_problem(system, (x**2 + y**2) / 0.2, 5e-5, law, translation=(3e-6, 0.0))
    newton, other = (solve(problem, solver).state for solver in (SemismoothNewton(), BarzilaiBorwein()))
    np.testing.assert_allclose(other.load, newton.load, atol=1e-7 * np.abs(newton.load).max())
    overlap = newton.displacement[:, 2] - problem.gap
    expected = np.minimum(-STIFFNESS * overlap, 0.0)
    np.testing.assert_allclose(newton.load[:, 2], expected, atol=1e-7 * np.abs(expected).max())


def test_stiff_springs_approach_hard_contact(law):
    trial, gap = np.random.default_rng(0).normal(size=(2, 50, 3))
    stiff = replace(law, stiffness=1e30)
    hard = IsotropicCoulomb(0.3).project(trial)
    np.testing.assert_allclose(stiff.resolve(trial, gap, (1e12, 1e12)), hard, atol=1e-12)
    smooth = replace(stiff, mu=0.0).resolve(trial, gap, (1e12, 1e12))
    np.testing.assert_allclose(smooth, Signorini().project(trial), atol=1e-12)
