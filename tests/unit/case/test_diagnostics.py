"""Test diagnostics of an increment: large motions, undetermined sliding, coarse contact."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from meeframe_laws.adhesive import DMTCoulomb
from meeframe_laws.evolving import RateAndPressure
from meeframe_laws.friction import CappedCoulomb, Tresca
from rich.console import Console

import meeframe
from meeframe.contact.problem import Status
from meeframe.indenters import FlatPunch
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.model import solve as model
from meeframe.model.diagnostics import count_sides_in_contact, diagnostics, open_sides
from meeframe.model.load import load_case
from meeframe.model.step import Step
from meeframe.results.records import Region
from meeframe.results.summary import summary_table
from meeframe.solvers import StoppingCriteria

LAW = '\n[contact]\nlaw = {name = "isotropic-coulomb", mu = 0.3}\n'
SLIDING = "the whole contact slips under the prescribed force or torque"


@pytest.mark.parametrize(
    ("motion", "text"),
    [
        ("twist = 0.2", "twist of 0.2 rad: beyond small motions, 0.1 rad"),
        ("twist = 0.09", ""),
        ("tilt = [0.09, -0.09]", "tilt of 0.127 rad: beyond small motions, 0.1 rad"),
        ('translation = ["4 mm", "-4 mm"]', "translation of 0.00566 m: beyond small motions, 0.005 m"),
        ('translation = ["4 mm", 0]', ""),
        ('approach = "5.1 mm"', "approach of 0.0051 m: beyond small motions, 0.005 m"),
    ],
)
def test_motions_that_are_not_small(write_case, registry, motion, text):
    *_, step = meeframe.solve_case(load_case(write_case(more=f"{LAW}[[steps]]\n{motion}\n"), registry)).steps
    assert step.status is Status.CONVERGED
    assert text in step.message
    assert ("beyond small motions" in step.message) == bool(text)


@pytest.mark.parametrize(("share", "slides"), [(0.9, False), (0.999, False), (1.0, True)])
def test_force_equal_to_the_friction_limit(write_case, registry, share, slides):
    """On springs, all tangential tractions are parallel to the force, so the contact carries mu P."""
    more = f'{LAW}[[steps]]\nforce_ratio = {0.3 * share}\ndirection = "30 deg"\n'
    *_, step = meeframe.solve_case(load_case(write_case(more=more), registry)).steps
    assert step.status is Status.CONVERGED
    assert (SLIDING in step.message) == slides


@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(0.0), IsotropicCoulomb(0.3)])
@pytest.mark.parametrize(
    "prescribed",
    [{"torque": 0.0}, {"torque": 0.0, "force_ratio": (0.0, 0.0)}, {"tangential_force": (0.0, 0.0), "torque": 0.0}],
)
def test_no_sliding_without_tangential_force(write_case, registry, law, prescribed):
    """Without friction all nodes in contact may slip, but none does without a force."""
    step = Step(approach=1e-5, **prescribed)
    case = replace(load_case(write_case(), registry), contact_law=law, steps=(step,))
    (result,) = meeframe.solve_case(case).steps
    assert result.status is Status.CONVERGED
    assert result.touching.any()
    assert not result.slip.any()
    assert SLIDING not in result.message


def with_rigid_slip(synthetic, law, motion, prescribed):
    """Return the synthetic step with the slip of a rigid motion (two translations, twist) and the corresponding
    tractions."""
    zone, step = synthetic.zone(), synthetic.step(1e-6)
    x, y, _ = zone.points.T
    slip = np.column_stack([motion[0] - motion[2] * y, motion[1] + motion[2] * x])
    trial = np.column_stack([1e20 * slip @ law.tangential_scaling(), step.traction[:, 2]])
    moves = np.linalg.norm(slip, axis=1) > 0
    region = np.where(step.region == Region.OPEN, Region.OPEN, np.where(moves, Region.SLIP, Region.STICK))
    loading = replace(step.loading, translation=np.zeros(2), tilt=np.zeros(2), twist=0.0, prescribed=prescribed)
    return zone, replace(step, slip=slip, traction=law.project(trial), region=region, loading=loading)


FORCE = {"tangential_force": np.zeros(2)}
TORQUE = {"torque": np.zeros(1)}
LAWS = [IsotropicCoulomb(mu=0.3), OrthotropicCoulomb(mu1=0.1, mu2=0.6, angle=0.4)]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    ("motion", "prescribed", "slides"),
    [
        ((1e-6, 2e-6, 0.0), FORCE, True),
        ((1e-6, 2e-6, 0.0), TORQUE, False),  # translations are prescribed
        ((0.0, 0.0, 1e-3), TORQUE, True),  # the node on the axis does not move
        ((0.0, 0.0, 1e-3), FORCE, False),
        ((1e-6, 0.0, 1e-3), FORCE | TORQUE, True),
        ((1e-6, 0.0, 1e-3), FORCE, False),
        ((1e-6, 2e-6, 0.0), {"normal_force": np.zeros(1)}, False),
    ],
)
def test_rigid_slip_along_free_motions(synthetic, law, motion, prescribed, slides):
    zone, step = with_rigid_slip(synthetic, law, motion, prescribed)
    assert (SLIDING in " ".join(diagnostics(zone, step, law))) == slides


@pytest.mark.parametrize("law", LAWS)
def test_node_below_its_limit_prevents_sliding(synthetic, law):
    zone, step = with_rigid_slip(synthetic, law, (1e-6, 0.0, 0.0), FORCE)
    node = int(np.flatnonzero(step.region == Region.SLIP)[0])
    traction, region = step.traction.copy(), step.region.copy()
    traction[node, :2] *= 0.5
    region[node] = Region.STICK
    assert SLIDING not in " ".join(diagnostics(zone, replace(step, traction=traction, region=region), law))


@pytest.mark.parametrize("node", [12, 13])
@pytest.mark.parametrize(("prescribed", "slides"), [(TORQUE, None), (FORCE, True), (FORCE | TORQUE, True)])
def test_a_single_node_twists_freely(synthetic, node, prescribed, slides):
    """The motion is undetermined if it is free about the node; the torque about an axis beside it is resisted."""
    zone, step = with_rigid_slip(synthetic, LAWS[0], (1e-6, 2e-6, 0.0), prescribed)
    region = np.where(np.arange(25) == node, Region.SLIP, Region.OPEN)
    step = replace(step, region=region, traction=np.where((region == Region.SLIP)[:, None], step.traction, 0.0))
    on_axis = not zone.points[node, :2].any()
    assert (SLIDING in " ".join(diagnostics(zone, step, LAWS[0]))) == (on_axis if slides is None else slides)


def test_opposite_slip_is_no_sliding(synthetic):
    """Slip directions are parallel, but slip is opposite on both sides: the force is far below its limit."""
    law = LAWS[0]
    zone, step = with_rigid_slip(synthetic, law, (1e-6, 0.0, 0.0), FORCE)
    sense = np.where(zone.points[:, 0] < 0, -1.0, 1.0)[:, None]
    traction = step.traction * np.hstack([sense, sense, np.ones_like(sense)])
    assert not list(diagnostics(zone, replace(step, slip=sense * step.slip, traction=traction), law))


def test_message_about_sides_has_correct_number(synthetic):
    zone, step = synthetic.zone(), synthetic.step(1e-6)
    region = np.zeros(25, int)
    region[[0, 1]] = Region.STICK
    step = replace(step, region=region)
    (reported,) = diagnostics(zone, step, LAWS[0], count_sides_in_contact(step, open_sides(zone, None)))
    assert re.fullmatch(r"the contact reaches the boundary of its zone at 1 element side", reported)


ONE_INCREMENT = "of the contact formed in one increment"
AREA = "its area is uncertain by about"


def solve_steps(bed, frictional, *steps, poisson=0.3, cells=24, **changes):
    """Return the messages of the last increment of each load step on an elastic half space, and the path."""
    path = bed.follow(frictional, bed.half_space(cells, poisson), *steps, **changes)
    return [step.message for step in path.steps if step.increment == path.case.steps[step.step - 1].increments], path


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("steps", "poisson", "changes", "reported"),
    [
        ([Step(approach=2e-5)], 0.3, {}, ["100%"]),
        ([Step(approach=2e-5, increments=2)], 0.3, {}, ["50%"]),
        ([Step(approach=2e-5, increments=10)], 0.3, {}, [""]),
        ([Step(approach=2e-5)], 0.5, {}, [""]),  # no tangential motion
        ([Step(approach=2e-5)], 0.3, {"contact_law": Signorini()}, [""]),
        ([Step(approach=2e-5)], 0.3, {"indenter": FlatPunch(radius=1e-3)}, [""]),  # in contact from the beginning
        ([Step(approach=2e-5), Step(translation=(1e-6, 0.0))], 0.3, {}, ["100%", ""]),
        ([Step(approach=1e-5, increments=8), Step(approach=2e-5)], 0.3, {}, ["", "46%"]),
    ],
)
def test_contact_formed_in_one_increment(bed, frictional, steps, poisson, changes, reported):
    messages, _ = solve_steps(bed, frictional, *steps, poisson=poisson, **changes)
    for message, share in zip(messages, reported, strict=True):
        assert (ONE_INCREMENT in message) == bool(share)
        assert f"{share} {ONE_INCREMENT}" in message or not share


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("increments", "law", "advised"),
    [(1, IsotropicCoulomb(0.3), "100%"), (2, IsotropicCoulomb(0.3), "100%"), (1, Signorini(), "")],
)
def test_more_increments_are_advised_where_one_fails(bed, frictional, increments, law, advised):
    """No increment converges here, so that all of the contact is new in each."""
    steps = [Step(approach=2e-5, increments=increments)]
    case = replace(frictional, steps=steps, contact_law=law, stopping=StoppingCriteria(max_iterations=1))
    results = list(model.solve_steps(case, bed.half_space(24), boundary=False))
    assert [result.status for result in results] == [Status.ITERATION_LIMIT] * len(results)
    assert ("more `increments` may converge" in results[-1].message) == bool(advised)
    assert f"{advised} of the contact was to form" in results[-1].message or not advised


@pytest.mark.full
def test_single_increment_is_inaccurate(bed, frictional):
    """Spence: for mu = 0.2 the stick radius is 0.73 of the contact radius at every load, if tangential tractions
    cause no normal displacement."""
    exact, law = 0.7334, IsotropicCoulomb(0.2)
    once, often = (
        solve_steps(bed, frictional, Step(approach=2e-5, increments=count), contact_law=law)[1] for count in (1, 20)
    )
    ratio = [(path.totals[-1].stick_area / path.totals[-1].contact_area) ** 0.5 for path in (once, often)]
    assert ratio[1] == pytest.approx(exact, abs=0.08)
    assert ratio[0] < 0.6 * exact
    dissipated = [sum(total.dissipated_energy for total in path.totals) for path in (once, often)]
    assert dissipated[0] > 5.0 * dissipated[1]


@pytest.mark.full
@pytest.mark.parametrize(("cells", "reported"), [(8, 25), (12, 16), (16, 12), (24, 0), (40, 0)])
def test_reported_uncertainty_of_area(bed, frictional, cells, reported):
    """Hertz: the contact is a circle of radius sqrt(R g); 0 stands for no message, below a tenth."""
    (message,), path = solve_steps(bed, frictional, Step(approach=2e-5), cells=cells, contact_law=Signorini())
    match = re.search(rf"{AREA} (\d+)%", message)
    assert (int(match[1]) if match else 0) == reported
    error = path.zone.weights[path.steps[-1].touching].sum() / (np.pi * bed.radius * 2e-5) - 1.0
    assert abs(error) < (1.15 * reported / 100.0 or 0.1)


def test_single_node_in_contact(bed, frictional):
    (message,), _ = solve_steps(bed, frictional, Step(approach=1e-6), cells=9)
    assert "the contact has one node: its area is uncertain by about 50%" in message


def test_advice_stays_with_its_reason(write_case, registry):
    """Two load steps whose contacts have areas of different uncertainty share neither the reason nor the advice."""
    case = load_case(write_case(), registry)
    steps = Step(approach=1e-6), Step(approach=2e-5)
    result = meeframe.solve_case(replace(case, contact_law=Signorini(), steps=steps))
    console = Console(width=300, record=True, file=io.StringIO())
    console.print(summary_table(result))
    lines = [line for line in console.export_text().splitlines() if AREA in line or "use more divisions" in line]
    assert len({line.split(AREA)[1] for line in lines}) == 2
    assert all("use more divisions" in line.split(AREA)[1] for line in lines)


def test_system_without_cells_has_no_boundary(bed, frictional):
    system = replace(bed.half_space(8), cells=())
    path = bed.follow(frictional, system, Step(approach=2e-5))
    (step,) = path.steps
    assert path.totals[0].contact_area == pytest.approx(step.touching.mean() * bed.side**2) != 0.0
    assert "edge of its zone" not in step.message
    assert AREA not in step.message


@pytest.mark.parametrize("status", [Status.CYCLING, Status.STALLED, Status.DIVERGED])
def test_failure_with_a_plugin_law_mentions_plugins_check(synthetic, status):
    """Laws of meeframe are not mentioned."""

    class Law(IsotropicCoulomb):
        pass

    zone, step = synthetic.zone(), replace(synthetic.step(1e-6), status=status)
    assert any("meeframe plugins check FILE.py" in text for text in diagnostics(zone, step, Law(0.3)))
    assert not any("plugins check" in text for text in diagnostics(zone, step, IsotropicCoulomb(0.3)))
    other = replace(step, status=Status.ITERATION_LIMIT)
    assert not any("plugins check" in text for text in diagnostics(zone, other, Law(0.3)))


@pytest.mark.parametrize(
    ("law", "jumps"),
    [
        (Signorini(), False),
        (IsotropicCoulomb(0.9), False),
        (IsotropicCoulomb(np.inf), True),
        (OrthotropicCoulomb(0.1, 0.9), False),
        (Tresca(1e4), True),
        (CappedCoulomb(10.0, 1e4), False),
        (RateAndPressure(0.2, 0.3, 1e-3, pressure_exponent=2 / 3), False),
        (DMTCoulomb(0.3, 1e3), True),
        (DMTCoulomb(0.3, 0.0), False),
    ],
)
def test_friction_limits_that_jump_are_a_reason(synthetic, law, jumps):
    step = synthetic.step(1e-6, Status.STALLED)
    sentences = list(diagnostics(synthetic.zone(), step, law))
    assert any("jumps where contact begins" in sentence for sentence in sentences) == jumps
    assert sentences[-1] == "the next increment starts from the last one that converged"
