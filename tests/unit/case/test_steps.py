"""Test the keys of [[steps]] in case files, and what is rejected."""

import math
from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.model.load import load_case
from meeframe.model.step import Step

FRICTION = (
    '\n[contact]\nlaw = {name = "isotropic-coulomb", mu = 0.3}\n[conductivity]\nelectric = {name = "step", kappa = 1}\n'
)
CONDUCTION = 'magnetic = {name = "step", kappa = 1}\n'


def second_step(write_case, registry, text):
    """Return the second step of a case in which all motions are resisted."""
    return load_case(write_case(more=f"{FRICTION}{CONDUCTION}[[steps]]\n{text}\n"), registry).steps[1]


TAKEN = {
    'approach = "2 um"': {"approach": 2e-6},
    'normal_force = "3 kN"': {"normal_force": 3e3},
    'translation = ["1 um", -2e-6]': {"translation": (1e-6, -2e-6)},
    'translation = "2 um"\ndirection = "90 deg"': {"translation": (0.0, 2e-6)},
    'tangential_force = [1, "-2 N"]': {"tangential_force": (1.0, -2.0)},
    'tangential_force = "-2 kN"\ndirection = 0': {"tangential_force": (-2e3, 0.0)},
    'force_ratio = 0.5\ndirection = "60 deg"': {"force_ratio": (0.25, math.sqrt(3) / 4)},
    "force_ratio = [0.1, 0.2]": {"force_ratio": (0.1, 0.2)},
    'tilt = ["1 mrad", 0]': {"tilt": (1e-3, 0.0)},
    'moment = ["1 N mm", "2 N*m"]': {"moment": (1e-3, 2.0)},
    'twist = "1 deg"': {"twist": math.radians(1)},
    'torque = "3 N m"': {"torque": 3.0},
    'electric_potential = "2 kV"': {"electric_potential": 2e3},
    'charge = "-1 nC"': {"charge": -1e-9},
    'magnetic_potential = "1 mA"': {"magnetic_potential": 1e-3},
    'magnetic_flux = "1 uWb"': {"magnetic_flux": 1e-6},
    "increments = 7": {},
    'duration = "2 ms"': {},
}


@pytest.mark.parametrize("text", TAKEN)
def test_keys(write_case, registry, text):
    step = second_step(write_case, registry, text)
    assert step.increments == (7 if "increments" in text else 1)
    assert step.duration == (2e-3 if "duration" in text else None)
    assert set(step.prescribed) == set(TAKEN[text])
    for key, value in TAKEN[text].items():
        assert step.prescribed[key] == pytest.approx(value, rel=1e-14, abs=1e-21)


REFUSED = {
    'approach = 0\nnormal_force = "1 N"': "steps[2]: approach and normal_force are both given; allowed: one of them",
    "translation = [0, 0]\ntangential_force = [0, 0]": "steps[2]: translation and tangential_force are both given",
    "tangential_force = [0, 0]\nforce_ratio = [0, 0]": "steps[2]: tangential_force and force_ratio are both given",
    "translation = [0, 0]\nforce_ratio = [0, 0]": "steps[2]: translation and force_ratio are both given",
    "tilt = [0, 0]\nmoment = [0, 0]": "steps[2]: tilt and moment are both given",
    "twist = 0\ntorque = 0": "steps[2]: twist and torque are both given",
    "electric_potential = 0\ncharge = 0": "steps[2]: electric_potential and charge are both given",
    "magnetic_potential = 0\nmagnetic_flux = 0": "steps[2]: magnetic_potential and magnetic_flux are both given",
    "normal_force = -1": "steps[2].normal_force = -1: allowed: numbers >= 0 [N], pressing on the body, unless",
    'normal_force = "1 Pa"': "steps[2].normal_force = '1 Pa': has the wrong unit; expected a number in N",
    'torque = "1 N"': "steps[2].torque = '1 N': has the wrong unit; expected a number in N m",
    'twist = "1 m"': "steps[2].twist = '1 m': has the wrong unit; expected a number in rad",
    'magnetic_flux = "1 T"': "steps[2].magnetic_flux = '1 T': has the wrong unit; expected a number in Wb",
    "charge = inf": "steps[2].charge = inf: must be >= -1e+60 and <= 1e+60",
    "tilt = 1": "steps[2].tilt = 1: should be a list",
    "moment = [1]": "steps[2].moment[2]: missing entry",
    "translation = [1, 2, 3]": "steps[2].translation = [1, 2, 3]: should have 2 entries",
    'translation = "1 um"': "steps[2].translation = '1 um': should be a list of two components, or one number",
    "translation = [1, 2]\ndirection = 0": "steps[2].direction = 0: needs the size of a translation, tan",
    "direction = 1": "steps[2].direction = 1: needs the size of a translation",
    'translation = "1 N"\ndirection = 0': "steps[2].translation = '1 N': has the wrong unit; expected a number in m",
    'force_ratio = "1 N"\ndirection = 0': "steps[2].force_ratio = '1 N': has the wrong unit; expected a number without",
    'force_ratio = 1\ndirection = "x"': "steps[2].direction = 'x': cannot be read as one number and then units",
    "increments = 0": "steps[2].increments = 0: should be greater than or equal to 1",
    "duration = 0": "steps[2].duration = 0: must be > 0",
    'duration = "1 m"': "steps[2].duration = '1 m': has the wrong unit; expected a number in s",
    "increments = 1.5": "steps[2].increments = 1.5: should be a whole number",
    "normalforce = 1": "steps[2].normalforce = 1: unknown key; did you mean 'normal_force'? allowed: approach, ",
}


@pytest.mark.parametrize("text", REFUSED)
def test_invalid_entries(write_case, registry, text):
    with pytest.raises(CaseError) as caught:
        second_step(write_case, registry, text)
    (line,) = str(caught.value).splitlines()
    assert REFUSED[text] in line
    assert line.startswith(f"{write_case()}: ")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "tangential_force = [1, 0]",
            "steps[2].tangential_force = [1, 0]: the laws of the contact admit no traction",
        ),
        ("force_ratio = 0.1\ndirection = 0", "steps[2].force_ratio = 0.1: the laws"),
        ('torque = "1 kN m"', "steps[2].torque = '1 kN m': the laws"),
        ("charge = 1", "steps[2].charge = 1: the laws of the contact insulate; allowed: 0, or other laws"),
        ("magnetic_flux = 1", "steps[2].magnetic_flux = 1: the laws of the contact insulate"),
    ],
)
def test_resultants_that_laws_cannot_resist_are_rejected_early(write_case, registry, text, expected):
    with pytest.raises(CaseError) as caught:
        load_case(write_case(more=f"\n[[steps]]\n{text}\n"), registry)
    assert expected in str(caught.value)


def test_first_step_must_establish_contact(write_case, registry):
    with pytest.raises(
        CaseError, match=r"case.toml: steps\[1\]: the first load step gives neither approach nor normal"
    ):
        load_case(write_case(('approach = "10 um"', "twist = 0")), registry)
    pressed = load_case(write_case(('approach = "10 um"', 'normal_force = "1 N"')), registry)
    assert pressed.steps == (Step(normal_force=1.0),)


@pytest.mark.parametrize(
    ("prescribed", "text"),
    [
        ({"approach": math.nan}, r"approach = nan; allowed: one finite number \[m\]"),
        ({"translation": 1.0}, r"translation = 1.0; allowed: two finite numbers \[m\]"),
        ({"twist": 1.0, "torque": 1.0}, "twist and torque are both given"),
        ({"duration": 0.0}, r"duration = 0.0; allowed: finite numbers > 0 \[s\]"),
        ({"increments": 0}, "increments = 0; allowed: whole numbers from 1"),
        ({"normal_force": "5 m"}, "normal_force = '5 m': has the wrong unit; expected a number in N or a text"),
        ({"force_ratio": ("0.1 N", 0.0)}, r"force_ratio = \('0.1 N', 0.0\): has the wrong unit; expected a number"),
        ({"approach": "deep"}, "approach = 'deep': cannot be read as one number"),
        ({"translation": ([1.0], 2.0)}, "translation = "),
        ({"approach": {}}, "approach = {}: expected a number in m"),
        ({"duration": True}, "duration = True: expected a number in s"),
        ({"duration": (1.0, 2.0)}, r"duration = \(1\.0, 2\.0\); allowed: finite numbers > 0"),
        ({"approach": np.zeros((2, 2))}, r"approach = .*; allowed: one finite number \[m\]"),
    ],
)
def test_steps_from_python_are_checked(prescribed, text):
    with pytest.raises(CaseError, match=text):
        Step(**prescribed)


def test_steps_from_python_take_units():
    step = Step(normal_force="5 kN", translation=("1 um", 0.0), force_ratio=None, duration="2 ms")
    assert step == Step(normal_force=5e3, translation=(1e-6, 0.0), duration=2e-3)
    assert step.prescribed["translation"].tolist() == [1e-6, 0.0]


@pytest.mark.parametrize("force", [-5.0, np.float64(-5.0), np.array(-5.0), np.array([-5.0]), [-5], (np.float32(-5),)])
def test_arrays_are_accepted(write_case, registry, force):
    step = Step(normal_force=force, translation=np.array([1e-6, 0.0]), duration=np.array([2.0]))
    assert step == Step(normal_force=-5.0, translation=(1e-6, 0.0), duration=2.0)
    with pytest.raises(CaseError, match=r"^normal_force = -5.0: allowed: numbers >= 0 \[N\], pressing on the body"):
        replace(load_case(write_case(), registry), steps=(step,))
