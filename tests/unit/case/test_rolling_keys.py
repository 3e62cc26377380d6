"""Test the keys of rolling in case files, and the cases in which material cannot move through the zone."""

import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError
from meeframe.model.load import load_case
from meeframe.system.rolling import CellShift

CASE = """
[material]
name = "isotropic"
young_modulus = "210 GPa"
poisson_ratio = 0.3
[mesh]
type = "half-space"
half_width = "2 cm"
contact_width = ["6 mm", "4 mm"]
divisions = [12, 16]
rings = 1
[indenter]
name = "sphere"
radius = "10 cm"
[contact]
law = {name = "isotropic-coulomb", mu = 0.3}
[formulation]
name = "half-space"
[[steps]]
normal_force = "1 kN"
duration = "1 s"
[[steps]]
"""


def load(tmp_path, step, case=CASE):
    path = tmp_path / "case.toml"
    path.write_text(case + step)
    return load_case(path)


def test_step_has_an_increment_for_each_cell(tmp_path):
    step = (
        'rolling = {direction = [0, -2], distance = "2.1 mm", creepage = ["0.1 %", 0], spin = "2 1/m", speed = "2 m/s"}'
    )
    case = load(tmp_path, step)
    assert case.steps[1].increments == 8, "cells of 0.25 mm"
    assert case.n_increments == 9
    assert case.steps[1].increment_duration == pytest.approx(0.25e-3 / 2.0)
    assert case.steps[1].rolling.creepage == pytest.approx((1e-3, 0.0))
    assert case.steps[1].rolling.spin == 2.0
    along, lateral = case.steps[1].rolling.axes
    assert along == pytest.approx([0.0, -1.0])
    assert lateral == pytest.approx([1.0, 0.0]), "to the left"


REFUSED = {
    "rolling = 3": "steps[2].rolling = 3: ",
    "rolling = {}": "steps[2].rolling: distance is missing",
    'rolling = {distance = "1 mm", steady = true}': "steps[2].rolling: distance and steady are both given",
    'rolling = {distance = "1 N"}': "steps[2].rolling.distance = '1 N': has the wrong unit",
    "rolling = {distance = 0}": "steps[2].rolling.distance = 0: must be > 0",
    "rolling = {distance = 10}": "steps[2].rolling: distance = 10 m: 20000 cells of 0.0005 m; allowed: at most 10000",
    "rolling = {steady = 1}": "steps[2].rolling.steady = 1: should be true or false",
    "rolling = {steady = true, direction = [0, 0]}": "steps[2].rolling: direction = (0.0, 0.0); allowed: a direction",
    "rolling = {steady = true, direction = [1, 2]}": "steps[2].rolling: direction = (1.0, 2.0): the nodes of",
    "rolling = {steady = true, creepage = 1}": "steps[2].rolling.creepage = 1: should be a list",
    "rolling = {steady = true, creep = [1, 1]}": "steps[2].rolling.creep = [1, 1]: unknown key; did you mean 'cr",
    "rolling = {steady = true}\nincrements = 1": "steps[2].increments = 1: is not allowed with rolling",
    "rolling = {steady = true}\ntwist = 0": "steps[2]: twist and rolling are both given; allowed: rolling with its sp",
    "rolling = {steady = true}\ntorque = 0": "steps[2]: torque and rolling are both given",
    "rolling = {steady = true}\ntranslation = [0, 0]": "steps[2]: translation and rolling are both given; allowed:",
    "rolling = {steady = true, creepage = [0, 0]}\nforce_ratio = [0, 0]": "steps[2]: force_ratio and rolling are both",
    "rolling = {steady = true, speed = 1}\nduration = 1": "steps[2]: duration and the speed of rolling are both given",
}


@pytest.mark.parametrize("text", REFUSED)
def test_refused_keys(tmp_path, text):
    with pytest.raises(CaseError) as error:
        load(tmp_path, text)
    assert REFUSED[text] in str(error.value)


CHANGES = {
    "formulation": (
        'name = "half-space"\n[[',
        'name = "dense-bem"\n[[',
        "cannot move through the contact zone of the form",
    ),
    "edges": ('name = "half-space"\n[[', 'name = "half-space"\nedges = "resolved"\n[[', "contact edges at the nodes"),
    "spin on a periodic surface": (
        'name = "half-space"\n[[',
        'name = "half-space"\nperiodic = true\n[[',
        "spin = 1 1/m on a periodic surface; allowed: 0",
    ),
    "memory on a periodic surface": (
        '"isotropic-coulomb", mu = 0.3}\n[formulation]\nname = "half-space"',
        '"slip-weakening", mu_static = 0.4, mu_kinetic = 0.2, slip_distance = "1 um"}\n'
        '[formulation]\nname = "half-space"\nperiodic = true',
        "steady rolling on a periodic surface with the contact law SlipWeakening",
    ),
    "axis": ('radius = "10 cm"', 'radius = "10 cm"\naxis = [0, 0.1, 1]', "the axis of the indenter is not normal"),
    "rough surface": (
        'name = "sphere"\nradius = "10 cm"',
        'name = "self-affine"\nhurst = 0.8\nrms_height = "1 um"\nperiod = "6 mm"\nshortest = "1 mm"',
        "do not move with a body that rolls",
    ),
}


@pytest.mark.parametrize("what", CHANGES)
def test_refused_cases(tmp_path, what):
    old, new, message = CHANGES[what]
    assert old in CASE
    spin = "" if "memory" in what else ", spin = 1"
    with pytest.raises(CaseError) as error:
        load(tmp_path, f"rolling = {{steady = true{spin}}}", CASE.replace(old, new))
    assert str(error.value).startswith(f"{tmp_path / 'case.toml'}: steps[2].rolling: ")
    assert message in str(error.value)


def test_python_case_writes_the_same_case_file():
    case = meeframe.Case(
        material={"name": "isotropic", "young_modulus": "210 GPa", "poisson_ratio": 0.3},
        mesh=meeframe.mesh.half_space("6 mm", 12),
        indenter=meeframe.Sphere("10 cm"),
        contact=meeframe.IsotropicCoulomb(0.3),
        formulation=meeframe.formulation("half-space"),
        steps=[
            meeframe.Step(normal_force="1 kN"),
            meeframe.Step(rolling={"distance": "2 mm", "creepage": [1e-3, 0.0]}),
        ],
    )
    again = meeframe.Case.from_toml(case.to_toml())
    assert case.checked.n_increments == again.checked.n_increments == 5
    assert again.checked.steps == case.checked.steps
    with pytest.raises(CaseError, match=r"Step: rolling\.distance = 'x'"):
        meeframe.Step(rolling={"distance": "x"})


@pytest.mark.parametrize("direction", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0)])
@pytest.mark.parametrize("is_periodic", [False, True])
def test_shift_takes_values_from_the_node_ahead(direction, is_periodic):
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(5.0), 2.0 * np.arange(4.0), indexing="ij"))
    order = np.random.default_rng(0).permutation(len(x))
    points = np.column_stack([x, y, np.zeros_like(x)])[order]
    angles = np.linspace(0.0, 3.0, len(points))
    frames = np.zeros((len(points), 3, 3))
    frames[:, 0, 0] = frames[:, 1, 1] = np.cos(angles)
    frames[:, 0, 1], frames[:, 1, 0], frames[:, 2, 2] = np.sin(angles), -np.sin(angles), 1.0
    shift = CellShift.of(points, frames, np.array([*direction, 0.0]), is_periodic)
    length = 1.0 if direction[0] else 2.0
    assert shift.length == length
    extent = (5.0 if direction[0] else 4.0) * length
    ahead = points[:, :2] @ direction + length
    if is_periodic:
        expected = np.where(ahead > (points[:, :2] @ direction).max() + 1e-9, ahead - extent, ahead)
        assert not shift.entering.any()
    else:
        expected = np.minimum(ahead, (points[:, :2] @ direction).max())
        assert shift.entering.sum() == (4 if direction[0] else 5)
    assert shift.values(points[:, :2] @ direction) == pytest.approx(expected)
    uniform = np.einsum("nai,i->na", frames[:, :2, :2], [0.3, -0.4])
    assert shift.tangential(uniform) == pytest.approx(uniform), "a vector that is the same everywhere"
    assert shift.accumulate(np.ones(len(points)))[shift.next_nodes][~shift.entering].min() >= 1.0
