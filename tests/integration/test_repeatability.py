"""Results are the same in other processes, and with other numbers of threads; materials close to inadmissible."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import meeframe
from meeframe.common.errors import MeeframeError
from meeframe.model.load import load_case

CONTACT = """
indenter = { name = "sphere", radius = "100 mm", electric_potential = "1 kV" }
conductivity = { electric = { name = "step", kappa = 1e-5 } }
contact = { law = { name = "orthotropic-coulomb", mu1 = 0.2, mu2 = 0.4 } }
steps = [{ approach = "20 um", increments = 2 }, { translation = ["1 um", "2 um"] }]
"""
BLOCK = """
material = { name = "batio3-cofe2o4" }
mesh = { half_width = "15 mm", height = "20 mm", contact_width = "5 mm", divisions = DIVISIONS, rings = 2, layers = 2 }
formulation = { name = "FORMULATION" }
boundary = [{ group = "base", displacement = [0, 0, 0], electric_potential = 0, magnetic_potential = 0 }]
"""
HALF_SPACE = """
material = { name = "linbo3" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 16 }
formulation = { name = "half-space" }
"""
CASES = {
    "half-space": HALF_SPACE,
    "resolved edges": HALF_SPACE.replace('"half-space" }\n', '"half-space", edges = "resolved" }\n'),
    "hmatrix-bem": BLOCK.replace("FORMULATION", "hmatrix-bem").replace("DIVISIONS", "6"),  # the fewest with a hierarchy
    **{name: BLOCK.replace("FORMULATION", name).replace("DIVISIONS", "5") for name in ("dense-bem", "skfem")},
}
SCRIPT = """
import sys
import numpy as np
import meeframe
from meeframe.model.load import load_case

arrays = {}
for path in sys.argv[2:]:
    for step in meeframe.solve_case(load_case(path)).steps:
        assert step.status == "converged", step.message
        load = np.column_stack([step.traction, step.fluxes])
        displacement = np.column_stack([step.displacement, step.potentials])
        for name, array in (("load", load), ("displacement", displacement), ("slip", step.slip)):
            arrays[f"{path}, {step.step}.{step.increment}, {name}"] = array
np.savez(sys.argv[1], **arrays)
"""


def test_totals_of_results_that_are_read(tmp_path):
    """Products of matrices depend in their last digits on the memory layout of arrays, which files do not keep."""
    case = meeframe.Case.from_toml(
        HALF_SPACE.replace("16", "8") + CONTACT + "output = { figures = false, vtu = false }"
    )
    solved = case.solve(tmp_path / "out")
    read = meeframe.read_result(tmp_path / "out")
    for one, other in zip(solved.steps, read.steps, strict=True):
        totals, again = (meeframe.resultants(result.zone, step) for result, step in ((solved, one), (read, other)))
        assert totals.torque != 0.0
        for name in ("force", "moment", "torque", "scalars", "dissipated_energy", "contact_area", "max_pressure"):
            np.testing.assert_array_equal(getattr(again, name), getattr(totals, name), err_msg=name)


ROUNDED = "dense-bem", "skfem"
"""Cases whose compliance is computed by libraries that round differently with other numbers of threads."""


@pytest.mark.full
def test_processes_and_threads(tmp_path):
    """Results are equal bit for bit, or within 1e-10 where the compliance differs by round-off.

    Hashes of texts, and so the orders of sets, differ between the processes.
    """
    paths = []
    for name, text in CASES.items():
        paths.append(tmp_path / f"{name}.toml")
        paths[-1].write_text(text + CONTACT, encoding="utf-8")
    solved = []
    for number, threads in enumerate(("1", "3", "3")):
        variables = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), threads)
        environment = os.environ | variables | {"PYTHONHASHSEED": str(number)}
        out = tmp_path / f"{number}.npz"
        subprocess.run([sys.executable, "-c", SCRIPT, str(out), *map(str, paths)], env=environment, check=True)
        with np.load(out) as file:
            solved.append(dict(file))
    one, three, again = solved
    assert len(one) == len(CASES) * 3 * 3
    for name, array in three.items():
        np.testing.assert_array_equal(again[name], array, err_msg=name)
        allowed = 1e-10 if Path(name.partition(",")[0]).stem in ROUNDED else 0.0
        largest = np.abs(one[name]).max(axis=0)
        assert (np.abs(array - one[name]).max(axis=0) <= allowed * largest).all(), name


MATERIAL = """
[material]
name = "two potentials"
symmetry = "transversely-isotropic"

[material.components]
c_11 = 150e9
c_12 = 50e9
c_13 = 50e9
c_33 = 150e9
c_44 = 50e9
eps_11 = 4e-9
eps_33 = 4e-9
mu_11 = 9e-5
mu_33 = 9e-5
lambda_11 = {coupling!r}
lambda_33 = {coupling!r}
"""
LAWS = """
[mesh]
type = "half-space"
contact_width = "5 mm"
divisions = 16

[formulation]
name = "half-space"

[conductivity]
electric = { name = "step", kappa = inf }
magnetic = { name = "step", kappa = inf }

[indenter]
name = "sphere"
radius = "100 mm"
electric_potential = 100.0
magnetic_potential = 1.0

[[steps]]
approach = "20 um"
"""


def fluxes(tmp_path, coupling):
    """Return charge and magnetic flux of a contact of which both are conducted, and the normal force."""
    path = tmp_path / "case.toml"
    path.write_text(MATERIAL.format(coupling=coupling) + LAWS, encoding="utf-8")
    result = meeframe.solve_case(load_case(path))
    assert [step.status for step in result.steps] == ["converged"], result.steps[0].message
    totals = meeframe.resultants(result.zone, result.steps[0])
    return np.array([totals.charge, totals.magnetic_flux]), totals.normal_force


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("missing", [1e-3, 1e-6, 1e-7, 1e-8, 1e-9, 1e-12])
def test_nearly_inadmissible_coupling(tmp_path, missing):
    """With lambda^2 = eps mu (1 - missing)^2 the energy of the potentials nearly vanishes for one ratio of them.

    Charges of potentials that act on nothing else are proportional to the matrix of eps, lambda and mu; its factor
    follows from a body without lambda. Materials for which this would be inaccurate are refused.
    """
    potentials, permittivity, permeability = np.array([100.0, 1.0]), 4e-9, 9e-5
    single, force = fluxes(tmp_path, 0.0)
    factor = single / (np.array([permittivity, permeability]) * potentials)
    np.testing.assert_allclose(factor[0], factor[1], rtol=1e-9)
    coupling = float(np.sqrt(permittivity * permeability) * (1.0 - missing))
    expected = factor[0] * np.array([[permittivity, coupling], [coupling, permeability]]) @ potentials
    if missing < 1e-6:
        with pytest.raises(MeeframeError, match=r"is nearly inadmissible|positive definite"):
            fluxes(tmp_path, coupling)
        return
    found, same_force = fluxes(tmp_path, coupling)
    np.testing.assert_allclose(found, expected, rtol=1e-7)
    np.testing.assert_allclose(same_force, force, rtol=1e-9)


def test_inadmissible_coupling_is_refused(tmp_path):
    with pytest.raises(MeeframeError, match="positive definite"):
        fluxes(tmp_path, float(np.sqrt(4e-9 * 9e-5) * 1.001))
