"""Prescribed resultants determine motions: closed forms, limits, undetermined motions."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.contact.problem import Status
from meeframe.indenters import FlatPunch
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.mesh import local_frames
from meeframe.model.solve import solve_steps
from meeframe.model.step import Step
from meeframe.results.records import Region
from meeframe.solvers import SemismoothNewton


def test_torque_of_sticking_flat_punch(bed, frictional):
    """Reissner and Sagoci: T = 16/3 G a^3 beta; cells represent the circle and its edge approximately."""
    system = bed.half_space(24, 0.5)
    radius = 1e-3
    changes = {"indenter": FlatPunch(radius), "contact_law": IsotropicCoulomb(np.inf)}
    twisted = bed.follow(frictional, system, Step(approach=1e-6), Step(twist=1e-4), **changes)
    torque = twisted.total("torque")
    assert torque == pytest.approx(16 / 3 * bed.young / 3 * radius**3 * 1e-4, rel=0.06)
    computed = bed.follow(frictional, system, Step(approach=1e-6), Step(torque=torque), **changes)
    assert computed.motion[1] == pytest.approx(twisted.motion[1], rel=1e-8, abs=1e-16)
    assert (computed.steps[1].region != Region.SLIP).all()


def test_sphere_under_force_is_hertzian_and_separates_at_zero_load(bed, frictional):
    system = bed.half_space(24)
    path = bed.follow(
        frictional, system, Step(normal_force=1e3), Step(normal_force=0.0, increments=2), contact_law=Signorini()
    )
    exact = (1e3 * 3 / (4 * bed.young / (1 - bed.poisson**2) * bed.radius**0.5)) ** (2 / 3)
    assert path.motion[0, 0] == pytest.approx(exact, rel=0.01)
    assert path.resultants[0, 0] == pytest.approx(1e3, rel=1e-9)
    assert path.motion[-1, 0] < 0.02 * exact
    assert not path.steps[-1].traction.any()
    assert path.steps[-1].message.endswith("the indenter does not touch the body")


def test_free_motion_without_contact_is_unchanged(bed, frictional, system):
    """After separation nothing resists the free tangential motion; it keeps its value."""
    path = bed.follow(
        frictional,
        system,
        Step(approach=3e-5, force_ratio=(0.2, 0.0), torque=0.0, scalars={"charge": 0.0}),
        Step(approach=-1e-6),
        Step(approach=2e-5),
    )
    assert path.motion[1, 1:] == pytest.approx(path.motion[0, 1:], rel=1e-12)
    assert path.resultants[2, :3] == pytest.approx(path.resultants[2, 0] * np.array([1.0, 0.2, 0.0]), rel=1e-7)


def test_floating_conductor_preserves_its_charge(bed, frictional, system):
    law = {"conductivity": {"electric": StepConductivity(1e-6), "magnetic": StepConductivity(np.inf)}}
    held = bed.follow(
        frictional, system, Step(approach=3e-5, scalars={"electric_potential": 40.0, "magnetic_potential": -0.2}), **law
    )
    assert min(abs(held.total("charge")), abs(held.total("magnetic_flux"))) > 0
    given = {key: held.total(key) for key in ("charge", "magnetic_flux")}
    computed = bed.follow(
        frictional,
        system,
        Step(approach=3e-5, scalars=given),
        Step(scalars={"charge": 0.0}, increments=2),
        potentials={"electric_potential": 7.0, "magnetic_potential": 1.0},
        **law,
    )
    assert computed.motion[0] == pytest.approx(held.motion[0], rel=1e-8)
    np.testing.assert_allclose(
        computed.steps[0].fluxes, held.steps[0].fluxes, rtol=1e-6, atol=1e-9 * np.abs(held.steps[0].fluxes).max()
    )
    assert computed.resultants[1, 6] == pytest.approx(given["charge"] / 2, rel=1e-8)
    assert computed.motion[2, 6] == pytest.approx(0.0, abs=1e-8 * 40.0)


def test_initial_potentials_and_ramps(bed, frictional, system):
    path = bed.follow(
        frictional,
        system,
        Step(approach=1e-5, increments=2),
        Step(scalars={"electric_potential": 10.0}, increments=2),
        potentials={"electric_potential": 4.0, "magnetic_potential": -1.0},
        conductivity={"electric": StepConductivity(np.inf)},
    )
    assert path.motion[:, 6].tolist() == [4.0, 4.0, 7.0, 10.0]
    assert path.motion[:, 7].tolist() == [-1.0] * 4
    for step in path.steps:
        contact_fraction = step.traction[:, 2] < 0
        np.testing.assert_allclose(step.potentials[contact_fraction, 0], step.loading.electric_potential, rtol=1e-9)


def test_undetermined_motions_are_unchanged_or_rejected(bed, frictional, system):
    path = bed.follow(
        frictional,
        system,
        Step(approach=1e-5, tangential_force=(0.0, 0.0), torque=0.0, scalars={"charge": 0.0}),
        contact_law=Signorini(),
    )
    assert not path.motion[0, 1:].any()
    allowed = r"allowed: 0, or other laws"
    for prescribed in ({"tangential_force": (0.0, 1.0)}, {"force_ratio": (0.1, 0.0)}, {"torque": 1.0}):
        with pytest.raises(CaseError, match=rf"{next(iter(prescribed))} = .*admit no traction.*{allowed}"):
            replace(frictional, contact_law=Signorini(), steps=(Step(approach=1e-5), Step(**prescribed)))
    with pytest.raises(CaseError, match=rf"tangential_force = \[1.0, 0.0\]: .*{allowed}"):
        replace(
            frictional,
            contact_law=OrthotropicCoulomb(0.0, 0.3),
            steps=(Step(approach=1e-5, tangential_force=(1.0, 0.0)),),
        )
    replace(frictional, contact_law=Signorini(), steps=(Step(approach=1e-5, moment=(0.1, 0.0)),))
    with pytest.raises(CaseError, match=rf"charge = 1.0: the laws of the contact insulate; {allowed}"):
        replace(frictional, steps=(Step(approach=1e-5, scalars={"charge": 1.0}),))


def test_increment_after_failure_starts_from_last_converged_state(bed, frictional, system):
    """Above the friction limit there is no state; the next increments proceed as if it had not been attempted."""
    frictional = replace(frictional, solver=SemismoothNewton())
    stopping = replace(frictional.stopping, max_iterations=15)
    steps = Step(approach=3e-5), Step(force_ratio=(0.4, 0.0), increments=2), Step(force_ratio=(0.1, 0.0))
    tried = list(solve_steps(replace(frictional, steps=steps, stopping=stopping), system, boundary=False))
    assert [step.status is Status.CONVERGED for step in tried] == [True, True, False, True]
    assert tried[2].message.endswith("; the next increment starts from the last one that converged")
    untried = bed.follow(
        frictional, system, Step(approach=3e-5), Step(force_ratio=(0.2, 0.0)), Step(force_ratio=(0.1, 0.0))
    )
    for name in ("traction", "slip"):
        expected = getattr(untried.steps[2], name)
        np.testing.assert_allclose(getattr(tried[3], name), expected, atol=1e-9 * np.abs(expected).max())


def test_force_and_approach_agree_on_a_curved_zone(bed, frictional):
    """The cap is as curved as the indenter. The approach under a force recovers the force, and a constant force
    changes nothing."""
    flat = bed.half_space(10)
    x, y = flat.points[:, 0], flat.points[:, 1]
    cap = np.column_stack([x, y, np.sqrt(bed.radius**2 - x**2 - y**2)])
    system = replace(flat, points=cap, frames=local_frames(cap / bed.radius))
    pressed = bed.follow(frictional, system, *3 * [Step(normal_force=1e3)])
    assert pressed.motion[1:] == pytest.approx(np.tile(pressed.motion[0], (2, 1)), rel=1e-8, abs=1e-16)
    driven = bed.follow(frictional, system, Step(approach=pressed.motion[0, 0]))
    assert driven.resultants[0, 0] == pytest.approx(1e3, rel=1e-8)
    (step,) = driven.steps
    np.testing.assert_allclose(step.traction, pressed.steps[0].traction, atol=1e-8 * np.abs(step.traction).max())
