"""A restarted run continues as if it had not stopped, and is rejected where it does not fit."""

import dataclasses

import h5py
import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError
from meeframe.model.load import load_case
from meeframe.model.step import Step

LAW = '\n[contact]\nlaw = {name = "isotropic-coulomb", mu = 0.3}\n[conductivity.electric]\nname = "step"\nkappa = inf\n'
FILES = "\n[output]\nfigures = false\nvtu = false\n"
FIRST = '\n[[steps]]\ntangential_force = [300, 0]\nelectric_potential = "3 V"\nincrements = 2\n'
SECOND = '\n[[steps]]\ntwist = 1e-3\nnormal_force = "2 kN"\nincrements = 2\n'
RESTART = '\n[restart]\nfrom = "first"\n'
LOADED = '[[steps]]\napproach = "10 um"\n'
BEM = ('name = "winkler"\nstiffness = "1e14 Pa/m"', 'name = "dense-bem"\nquadrature_tolerance = 1e-3')


def restarted(write_case, *changes, more=SECOND):
    """Return a case that continues the run in the folder `first`."""
    return write_case(*changes, (LOADED, ""), more=LAW + RESTART + more)


@pytest.fixture
def first(write_case, registry, tmp_path):
    return meeframe.run(load_case(write_case(more=LAW + FILES + FIRST), registry), tmp_path / "first")


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("changes", [[], [BEM]], ids=["springs", "boundary elements"])
def test_restart_matches_a_single_run(write_case, registry, tmp_path, changes):
    whole = meeframe.solve_case(load_case(write_case(*changes, more=LAW + FIRST + SECOND), registry))
    meeframe.run(load_case(write_case(*changes, more=LAW + FILES + FIRST), registry), tmp_path / "first")
    second = meeframe.run(load_case(restarted(write_case, *changes), registry), tmp_path / "second")
    assert str(second.status) == str(whole.status) == "converged"
    assert [(step.step, step.increment) for step in second.steps] == [(1, 1), (1, 2)]
    for ours, theirs in zip(second.steps, whole.steps[3:], strict=True):
        for name in (
            "traction",
            "displacement",
            "potentials",
            "fluxes",
            "slip",
            "total_slip",
            "dissipation",
            "contact_fraction",
        ):
            expected = getattr(theirs, name)
            np.testing.assert_allclose(getattr(ours, name), expected, atol=1e-12 * np.abs(expected).max(), rtol=0)
        np.testing.assert_allclose(ours.loading.motion, theirs.loading.motion, rtol=1e-12, atol=1e-18)
        assert (
            ours.loading.prescribed.keys() == theirs.loading.prescribed.keys() == {"normal_force", "tangential_force"}
        )
    assert second.steps[0].loading.electric_potential == 3.0, "it stays, whatever [indenter] says"


RESOLVED = """
material = {name = "batio3-cofe2o4"}
mesh = {type = "half-space", contact_width = "5 mm", divisions = 11}
formulation = {name = "half-space", edges = "resolved"}
indenter = {name = "sphere", radius = "100 mm", electric_potential = "1 kV"}
conductivity = {electric = {name = "step", kappa = 1e-5}}
contact = {law = {name = "orthotropic-coulomb", mu1 = 0.2, mu2 = 0.4}}
output = {figures = false, vtu = false}
"""


@pytest.mark.full
def test_restart_with_resolved_edges(tmp_path):
    press, drag = '{approach = "20 um", increments = 2}', '{translation = ["1 um", "2 um"]}'

    def run(name, text):
        (tmp_path / f"{name}.toml").write_text(text)
        return meeframe.run(load_case(tmp_path / f"{name}.toml"), tmp_path / name).steps[-1]

    whole = run("whole", f"{RESOLVED}steps = [{press}, {drag}]")
    first = run("first", f"{RESOLVED}steps = [{press}]")
    assert ((first.area_fraction > 0.0) & (first.area_fraction < 1.0)).any()
    second = run("second", f"{RESOLVED}steps = [{drag}]{RESTART}")
    for name in ("traction", "displacement", "potentials", "fluxes", "total_slip"):
        expected = getattr(whole, name)
        np.testing.assert_allclose(getattr(second, name), expected, atol=1e-9 * np.abs(expected).max(), rtol=0)
    other = f"{RESOLVED}steps = [{drag}]{RESTART}".replace("batio3-cofe2o4", "pzt-4")
    with pytest.raises(CaseError, match="the loads of that run cause other displacements in this body"):
        run("other", other)


def test_restart_from_last_converged_increment(write_case, registry, tmp_path, first):
    with h5py.File(tmp_path / "first" / "result.h5", "r+") as file:
        file["steps/0003"].attrs["status"] = "stalled"
    case = load_case(restarted(write_case, more="\n[[steps]]\ntangential_force = [0, 0]\nincrements = 3\n"), registry)
    (one, *_) = meeframe.solve_case(case).steps
    assert one.loading.prescribed["tangential_force"] == pytest.approx([100.0, 0.0], rel=1e-8), "two thirds of 150 N"
    with h5py.File(tmp_path / "first" / "result.h5", "r+") as file:
        for step in file["steps"].values():
            step.attrs["status"] = "diverged"
    error_of(restarted(write_case), registry, f"no increment of the run in {tmp_path / 'first'} converged")


def error_of(path, registry, text):
    with pytest.raises(CaseError) as caught:
        meeframe.solve_case(load_case(path, registry))
    message = str(caught.value)
    assert message.startswith(f"{path}: restart.from = 'first': {text}")
    assert "allowed: " in message or "does not exist" in message


@pytest.mark.full(except_for=1)
@pytest.mark.usefixtures("first")
@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("divisions = 4", "divisions = 5"), "the contact zone of that run has 25 points, this one 36"),
        (
            ('contact_width = "5 mm"', 'contact_width = "6 mm"'),
            "the contact zone of that run has points up to 0.0005 m",
        ),
        (
            ('"1e14 Pa/m"', '"2e14 Pa/m"'),
            "the loads of that run cause other displacements in this body, by 1 of their",
        ),
    ],
)
def test_other_body_is_rejected(write_case, registry, change, text):
    error_of(restarted(write_case, change), registry, text)


AXES = ("mu = 0.3}\n", "mu = 0.3}\naxes = {direction = [0, 1, 0]}\n")


@pytest.mark.usefixtures("first")
def test_other_friction_axes_are_rejected(write_case, registry):
    path = restarted(write_case)
    path.write_text(path.read_text().replace(*AXES))
    text = "the local axis e1 of that run differs on the contact zone by up to 90 deg; allowed: the same [co"
    error_of(path, registry, text)


@pytest.mark.full
def test_restart_with_rotated_axes(write_case, registry, tmp_path):
    path = write_case(more=LAW + FIRST)
    path.write_text(path.read_text().replace(*AXES))
    meeframe.run(load_case(path, registry), tmp_path / "first")
    path = restarted(write_case)
    path.write_text(path.read_text().replace(*AXES))
    assert str(meeframe.solve_case(load_case(path, registry)).status) == "converged"


def test_missing_run_is_rejected(write_case, registry, tmp_path):
    error_of(restarted(write_case), registry, f"no result in {tmp_path / 'first'}")


def test_keys_of_the_table(write_case, registry):
    with pytest.raises(CaseError, match=r"restart\.form = 'first': unknown key; did you mean 'from'\? allowed: from"):
        load_case(write_case(more='\n[restart]\nform = "first"\n'), registry)


def test_from_objects(first, tmp_path, write_case, registry):
    from meeframe.model.restart import read_restart

    case = load_case(write_case(more=LAW + FIRST), registry)
    going_on = dataclasses.replace(case, restart=read_restart(tmp_path / "first"), steps=(Step(twist=0.0),))
    (step,) = meeframe.solve_case(going_on).steps
    expected = first.steps[-1].traction
    np.testing.assert_allclose(step.traction, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.usefixtures("first")
@pytest.mark.parametrize("name", ["approach", "translation", "total_slip"])
def test_damaged_run_is_rejected(name, write_case, registry, tmp_path):
    with h5py.File(tmp_path / "first" / "result.h5", "r+") as file:
        found: list[h5py.Dataset] = []
        file.visititems(lambda path, item: found.append(item) if path.rpartition("/")[2] == name else None)
        for dataset in found:
            dataset[...] = np.nan
    error_of(restarted(write_case), registry, f"{tmp_path / 'first'}: {name} of step 2, increment 2 is not finite")
