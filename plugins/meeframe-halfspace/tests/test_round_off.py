"""Cases of the campaign of random problems in which round-off was taken for a conductivity, or for a unit."""

import pytest

from meeframe import Case

FLOATING = """
material = { name = "linbo3" }
mesh = { type = "half-space", contact_width = 0.000813202624848075, divisions = 5 }
formulation = { name = "half-space", matrix_up_to = 0, periodic = true }
indenter = { name = "paraboloid", radius_x = 0.22636366740788036, radius_y = 0.1855503176276792 }
contact = { law = { name = "signorini" } }
steps = [
    { approach = 2.2739773217932383e-07, magnetic_potential = 0.01789524936256258, increments = 3 },
    { electric_potential = -672.7579064808154, magnetic_flux = 0.0 },
    { translation = 1.958733330413539e-08, direction = 1.309968392870889, increments = 3 },
]
[conductivity]
electric = { name = "power-law", reference_conductivity = 4.7e-09, reference_pressure = 1.2e8, exponent = 2.0 }
magnetic = { name = "across-gap", gap_constant = 3.3e-07, residual_gap = 5.3e-09, contact_conductivity = 498.0 }
"""
ADHESIVE = """
material = { name = "batio3-cofe2o4" }
mesh = { type = "half-space", contact_width = "3 mm", divisions = 8 }
formulation = { name = "half-space", matrix_up_to = 0, edges = "resolved" }
indenter = { name = "sphere", radius = "100 mm" }
contact = { law = { name = "dugdale", work_of_adhesion = 0.5, adhesive_stress = 1e6, transition = 1.9 } }
steps = [{ approach = "2 um", magnetic_potential = -20.0, increments = 3 }]
[conductivity]
magnetic = { name = "power-law", reference_conductivity = 1.0, reference_pressure = 1e8, exponent = 0.5 }
"""


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("text", [FLOATING, ADHESIVE], ids=["potential that floats", "open nodes under attraction"])
def test_every_increment_converges_in_a_few_steps(text):
    result = Case.from_toml(text).solve()
    assert {str(step.status) for step in result} == {"converged"}
    assert max(step.iterations for step in result) < 20
