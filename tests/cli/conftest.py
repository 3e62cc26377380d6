"""A tiny case for the command line, solved by boundary elements."""

from pathlib import Path

import pytest

CASE = """
title = "tiny"

[material]
name = "batio3-cofe2o4"

[mesh]
half_width = "50 mm"
height = "120 mm"
contact_width = "5 mm"
divisions = 4
rings = 2
layers = 1

[[boundary]]
group = "base"
displacement = [0, 0, 0]
electric_potential = 0
magnetic_potential = 0

[indenter]
name = "sphere"
radius = "100 mm"

[formulation]
name = "dense-bem"
quadrature_tolerance = 1e-3

[solver]
name = "uzawa"
tolerance = 1e-6

[[steps]]
approach = "20 um"

[[steps]]
approach = "40 um"
"""


@pytest.fixture
def case_file(tmp_path) -> Path:
    path = tmp_path / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    return path
