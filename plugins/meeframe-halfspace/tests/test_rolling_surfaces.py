"""Surfaces with heights that move through the contact with the material: signals of probes and of rollers."""

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.self_affine import SelfAffine

import meeframe
from meeframe.common.errors import CaseError
from meeframe.indenters.heights import SampledHeights
from meeframe.results.history import curves

RADIUS, WIDTH, CELLS = 10e-3, 0.4e-3, 12
SPACING = WIDTH / CELLS
DISTANCE = 3 * SPACING
TRACK = SelfAffine(4 * WIDTH, WIDTH / 2, 0.8, rms_height=400e-9, seed=3)
"""Track whose shortest wave is resolved by six nodes."""
PRESS = meeframe.Step(normal_force=2.0)
SLIDE = meeframe.Step(rolling={"distance": DISTANCE, "creepage": [1.0, 0.0]})
STEEL = {"name": "isotropic", "young_modulus": "200 GPa", "poisson_ratio": 0.3}


def case(steps, surface=TRACK, law=None, material="pzt-4", indenter=None, **arguments):
    """Return the case of a sphere on a half space with heights."""
    return meeframe.Case(
        **{"formulation": HalfSpace(matrix_up_to=0), **arguments},
        material=material,
        mesh=meeframe.mesh.half_space(WIDTH, divisions=CELLS),
        indenter=indenter or meeframe.Sphere(RADIUS),
        contact=meeframe.Contact(law or meeframe.IsotropicCoulomb(0.0), surface=surface),
        steps=steps,
    )


def solved(*arguments, **changes):
    result = case(*arguments, **changes).solve(progress=False)
    assert result.status == "converged", [step.message for step in result]
    return result


FILES = meeframe.Output(figures=False, vtu=False)
CONDUCTING = {
    "conductivity": {"electric": meeframe.StepConductivity(float("inf"))},
    "potentials": {"electric_potential": 5.0},
}


@pytest.mark.parametrize("direction", [(1.0, 0.0), pytest.param((0.0, -1.0), marks=pytest.mark.full)])
def test_signals_of_a_probe_are_those_of_its_places(direction):
    """Without friction each increment is a contact at rest, of a rigid surface with the sum of the heights."""
    slide = meeframe.Step(rolling={"distance": DISTANCE, "direction": direction, "creepage": [1.0, 0.0], "speed": 1e-3})
    result = solved([PRESS, slide], **CONDUCTING)
    assert len(result) == 4
    x, y = (np.unique(axis.round(12)) for axis in result.zone.points.T[:2])
    grid = np.meshgrid(x, y, indexing="ij")
    sphere = meeframe.Sphere(RADIUS).height(*map(np.ravel, grid))
    charges = []
    for number, step in enumerate(result):
        positions = (axis.ravel() + along * number * SPACING for axis, along in zip(grid, direction, strict=True))
        heights = sphere + TRACK.height(*positions)
        both = SampledHeights.on_grid(x, y, heights.reshape(grid[0].shape))
        (at_rest,) = solved([PRESS], None, indenter=both, **CONDUCTING)
        assert step.traction[:, 2] == pytest.approx(at_rest.traction[:, 2], abs=1e-6 * np.abs(at_rest.traction).max())
        charges.append(meeframe.resultants(result.zone, step).charge)
        assert charges[-1] == pytest.approx(meeframe.resultants(result.zone, at_rest).charge, rel=1e-6)
    assert np.ptp(charges) > 1e-3 * np.abs(charges).max()
    signal = next(curve for curve in curves(result) if curve.name == "charge in rolling")
    assert signal.across[2][:, 0] == pytest.approx(SPACING * np.arange(1, 4))
    assert signal.up[2][:, 0] == pytest.approx(charges[1:])
    table = result.to_dataframe()
    assert table["charge"].to_numpy() == pytest.approx(charges)
    assert table["duration"].to_numpy() == pytest.approx([np.nan] + [SPACING / 1e-3] * 3, nan_ok=True)


@pytest.mark.full
def test_signals_of_a_floating_probe_with_friction():
    """Friction is that of the law; a probe that is held at the last potential has no charge there, either.

    Strains of the places before, at other potentials, change the direction of the slip a little.
    """
    grounded = {"conductivity": CONDUCTING["conductivity"]}
    press = meeframe.Step(normal_force=2.0, scalars={"charge": 0.0})
    result = solved([press, SLIDE], law=meeframe.IsotropicCoulomb(0.2), **grounded)
    signals = result.to_dataframe().iloc[1:]
    assert signals["rolled_distance"].to_numpy() == pytest.approx(SPACING * np.arange(1, 4))
    assert signals["creep_force_longitudinal"].to_numpy() == pytest.approx(0.2 * 2.0, rel=1e-5)
    potential = signals["electric_potential"].to_numpy()
    assert np.ptp(potential) > 0.02 * np.abs(potential).max()
    held = solved(
        [meeframe.Step(normal_force=2.0, scalars={"electric_potential": potential[-1]}), SLIDE],
        law=meeframe.IsotropicCoulomb(0.2),
        **grounded,
    )
    scale = np.abs(held.to_dataframe()["charge"]).max()
    assert held.to_dataframe()["charge"].iloc[-1] == pytest.approx(0.0, abs=1e-4 * scale)
    traction = result[-1].traction
    assert held[-1].traction == pytest.approx(traction, abs=1e-3 * np.abs(traction).max())


@pytest.mark.full
def test_rollers_follow_long_waves():
    """Equal bodies under a held force: the approach follows the height below the contact, the force of friction holds.

    The curvature of the wave is a small part of that of the sphere.
    """
    length, amplitude = 20.0 * WIDTH, 0.2e-6
    track = np.linspace(-length / 2, length / 2, 400)
    heights = amplitude * np.sin(2.0 * np.pi * track / length)
    surface = SampledHeights.on_grid(track, [-WIDTH, WIDTH], np.column_stack([heights, heights]))
    rolls = meeframe.Step(rolling={"distance": 20 * SPACING, "creepage": [0.05, 0.0]})
    mesh = meeframe.mesh.half_space(WIDTH, divisions=CELLS)
    second = meeframe.SecondBody(STEEL, mesh, formulation=HalfSpace(matrix_up_to=0))
    law = meeframe.IsotropicCoulomb(0.3)
    first, *others = result = solved([PRESS, rolls], surface, law, STEEL, second_body=second)
    ways = SPACING * np.arange(1, 21)
    exact = amplitude * np.sin(2.0 * np.pi * ways / length)
    approach = np.array([step.loading.approach - first.loading.approach for step in others])
    assert approach == pytest.approx(exact, abs=0.01 * amplitude)
    forces = [meeframe.resultants(result.zone, step).tangential_force[0] for step in others[10:]]
    assert forces == pytest.approx([0.3 * 2.0] * 10, rel=2e-3)


@pytest.mark.full
def test_rough_body_slides_with_the_friction_of_its_law():
    """On a periodic surface the heights return after a period, and so does the contact."""
    period = WIDTH * (CELLS + 1) / CELLS
    rough = SelfAffine(period, period / 4, 0.8, rms_slope=0.05)
    slide = meeframe.Step(rolling={"distance": (CELLS + 1) * SPACING, "creepage": [1.0, 0.0]})
    law, formulation = meeframe.IsotropicCoulomb(0.3), HalfSpace(density="trigonometric", periodic=True)
    flat = meeframe.FlatPunch(1.0)
    result = solved([PRESS, slide, slide], rough, law, STEEL, flat, formulation=formulation)
    once, twice = result[CELLS + 1], result[-1]
    assert twice.traction == pytest.approx(once.traction, abs=1e-5 * np.abs(once.traction).max())
    totals = meeframe.resultants(result.zone, twice)
    assert totals.tangential_force[0] == pytest.approx(0.3 * totals.normal_force, rel=1e-3)
    middle = result[CELLS // 2]
    shifted = np.roll(middle.touching.reshape(CELLS + 1, -1), CELLS // 2 + 1, axis=0).ravel()
    assert (shifted != once.touching).mean() < 0.03, "asperities move with the material"


@pytest.mark.full
def test_run_continues_where_the_contact_is(tmp_path):
    """The way over the surface is in the files, also of a step that does not roll."""
    more = meeframe.Step(normal_force=3.0)
    law = meeframe.IsotropicCoulomb(0.2)
    whole = solved([PRESS, SLIDE, more, SLIDE], law=law)
    case([PRESS, SLIDE, more], law=law, output=FILES).solve(tmp_path / "first", progress=False)
    again = solved([SLIDE], law=law, restart=tmp_path / "first")
    assert again[-1].loading.travel == pytest.approx([2.0 * DISTANCE, 0.0])
    for name in ("traction", "initial_gap"):
        expected = getattr(whole[-1], name)
        assert getattr(again[-1], name) == pytest.approx(expected, abs=1e-7 * np.abs(expected).max()), name


def test_case_files():
    built = case([PRESS, SLIDE])
    again = meeframe.Case.from_toml(built.to_toml())
    assert again.checked.surface == TRACK
    assert again.contact.surface == TRACK


def test_refused_surfaces():
    with pytest.raises(CaseError, match=r"contact.surface: load step 2 rolls steadily over a surface with heights"):
        case([PRESS, meeframe.Step(rolling={"steady": True, "creepage": [0.1, 0.0]})])
    axis = [-WIDTH, WIDTH]
    short = SampledHeights.on_grid(axis, axis, np.zeros((2, 2)))
    far = meeframe.Step(rolling={"distance": 2 * WIDTH, "creepage": [1.0, 0.0]})
    with pytest.raises(CaseError, match=r"contact.surface: no height at x = 0.0006 m, .* in load step 2; allowed"):
        case([PRESS, far], short)
    with pytest.raises(CaseError, match="heights on a zone that is not flat and normal to the axis"):
        case([PRESS], placement=meeframe.Placement(axis=(0.0, 0.1, 1.0)))
