"""Compare methods: sections 7.1 to 7.4 by boundary and finite elements, a half space, and the limit of blocks."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

import numpy as np
from meeframe_halfspace import HalfSpace
from scipy.linalg import eigvalsh

from meeframe.contact.problem import Status
from meeframe.elements import Quad4
from meeframe.fields import N_FIELDS, Array
from meeframe.mesh import Grading, block_mesh, half_space_mesh
from meeframe.model.cache import cached_reduce
from meeframe.model.case import Case
from meeframe.model.load import load_case
from meeframe.model.solve import solve_case
from meeframe.plugin import registry as plugins
from meeframe.results.resultants import resultants
from meeframe.study import quantities
from meeframe.study.choices import Choice
from meeframe.study.reports.extrapolation import of_order, richardson
from meeframe.study.reports.verified import Agreement, Estimate, MeasuredQuantity, Verification, VerifiedRun
from meeframe.study.reports.verify import unit_of
from meeframe.study.validate import Check, Claim, Curve, Item, Plot
from meeframe.study.verify import Meshes, PlannedRun, planned_runs, verify
from meeframe.system.reduced import ReducedSystem

TITLE = "Three methods on the same cases: boundary elements, finite elements, half space by FFT"
SOURCE = (
    "Reference paper, sections 7.1 to 7.4, blocks with base and sides grounded. No published numbers are used: the "
    "methods are compared with each other, within 1 % on their finest meshes and within 0.3 % when extrapolated."
)
HERE = Path(__file__).parent
RESULTANTS = ("force", "force_x", "force_y", "charge", "magnetic_flux")
FINEST, EXTRAPOLATED = 0.01, 0.003


WAVERING = (
    "in a body with such strong coupling (Table 3), finite elements are too stiff against pressures that alternate "
    "from node to node (see the body of section 7.2): their pressures oscillate, and nodes near the contact edge open"
)
SCATTERED = WAVERING + "; the force scatters with them, and extrapolation from two meshes magnifies the scatter"
SCATTERED_UP_TO = 0.006
COUNTED = ("max_", "contact_area")
RADIUS = 2.15e-3
PRESSURES: Final[Mapping[str, Callable[[Array], Array]]] = {
    "compliance_under_Hertz": lambda r: np.sqrt(np.maximum(1.0 - (r / RADIUS) ** 2, 0.0)),
    "compliance_under_Gauss": lambda r: np.exp(-((r / 0.9e-3) ** 2)),
}
"""Pressures as functions of the distance from the centre [m], with maximum 1 Pa and the width of the contacts."""
COMPARED = (*RESULTANTS, *PRESSURES)


class Section(NamedTuple):
    """A case file of the paper, relative to the folder of the validation.

    body: True if it is the first case with its body; nodal: reason why values at single nodes may differ slightly;
    explained: reason why limits of resultants differ more.
    """

    name: str
    file: str
    body: bool = False
    nodal: str = ""
    explained: str = ""


SECTIONS = (
    Section("7.1, EMII", "transversely_isotropic_indentation/emii.toml", True),
    Section("7.1, EMCI", "transversely_isotropic_indentation/emci.toml"),
    Section("7.2, EMII", "orthotropic_indentation/emii.toml", True, WAVERING, SCATTERED),
    Section("7.3, EMII, friction 0.3", "orthotropic_friction/emii.toml", nodal=WAVERING),
    Section("7.4, EMII, sliding", "orthotropic_tangential/emii.toml", nodal=WAVERING),
)
CHANGES = (
    ("divisions = 16\nrings = 7\nlayers = 2\n", "divisions = {divisions}\nrings = {around}\nlayers = {around}\n"),
    ('element = "quad4"', 'element = "{element}"'),
    ('name = "uzawa"', 'name = "auto"'),
)
"""Changes of the case files: meshes with a refined far field, and a solver without step lengths."""


class Family(NamedTuple):
    """Meshes: element, divisions, rings and layers of the finest, its finite elements, factor, order of totals."""

    element: str
    divisions: int
    around: int
    volume: str
    factor: float
    order: float


# The totals derive from an energy and have twice the order of its norm. At a smooth contact edge displacements behave
# like r^(3/2), which quadratic elements approximate with order 3/2 and linear ones with order 1: orders 3 and 2.
# Elements have nine nodes because the corners of eight-node elements have negative weights
QUADRATIC = Family("quad9", 8, 4, 'grid = "shells", growth = 1.5', 2.0**0.5, 3.0)
QUICK = Family("quad4", 6, 3, "growth = 2.25", 1.4, 2.0)


def run(quick: bool) -> Iterator[Item]:
    """Check all; if `quick`, one section on coarse meshes, compared within its errors, and the blocks."""
    with TemporaryDirectory() as scratch:
        for section in SECTIONS[:1] if quick else SECTIONS:
            family = QUICK if quick else QUADRATIC
            task = block_task(section, Path(scratch), family)
            result = verify(task.file, task.file.with_suffix(""), task.formulations, task.meshes, cache=task.cache)
            yield converged(f"section {section.name}, {family.element}", result)
            yield from agreement(f"section {section.name}, {family.element}", result, section.nodal)
            if section.body:
                yield from bodies(section.name, task, bool(section.nodal), quick)
            if not quick:
                yield from finest(section.name, result)
                yield from extrapolated(section.name, result, section.explained)
        if not quick:
            both = ("dense-bem", "half-space")
            result = verify(HERE / "half_space.toml", Path(scratch) / "half-space", both, Meshes(factor=2.0))
            yield converged("half space", result)
            yield from agreement("half space", result)
            yield from finest("half space", result)
            yield from extrapolated("half space", result)
    yield from large_blocks(quick)


class Task(NamedTuple):
    """Case to verify; cache: folder of the reduced systems."""

    file: Path
    formulations: tuple[str, ...]
    meshes: Meshes
    cache: Path


def block_task(section: Section, scratch: Path, family: Family) -> Task:
    """Return a case of the paper for boundary and finite elements."""
    file = HERE.parent / section.file
    text = file.read_text(encoding="utf-8")
    for old, new in CHANGES:
        text = text.replace(old, new.format(**family._asdict()))
    copy = scratch / f"{file.parent.name}-{file.stem}-{family.element}.toml"
    copy.write_text(text, encoding="utf-8")
    both = ("dense-bem", f'{{name = "skfem", {family.volume}}}')
    return Task(copy, both, Meshes(factor=family.factor, order=family.order), scratch / "cache")


def bodies(name: str, task: Task, strong: bool, quick: bool) -> Iterator[Item]:
    """Compare both methods under given pressures, without contact; strong: True for strong coupling."""
    chosen = [Choice.read("formulation", text) for text in task.formulations]
    planned, _ = planned_runs(task.file, chosen, task.meshes, plugins.load())
    systems = [cached_reduce(run.case, task.cache) for run in planned]
    result = under_given_pressure(planned, systems, task.meshes.order)
    yield from agreement(f"body of section {name}", result)
    least = short_waves(*systems[-2:])
    words, criterion = ("stiff", "less than 0.1") if strong else ("accurate within a factor of 2", "more than 0.5")
    yield Claim(
        f"body of section {name}: finite elements are {words} against pressures that alternate from node to node",
        f"least work {least:.2g} of the work with boundary elements",
        criterion,
        least < 0.1 if strong else least > 0.5,
    )
    if not quick:
        yield from extrapolated(f"body of section {name}", result)


def under_given_pressure(planned: Sequence[PlannedRun], systems: Sequence[ReducedSystem], order: float) -> Verification:
    """Return compliances in the form of totals of cases."""
    runs = []
    for run, system in zip(planned, systems, strict=True):
        result = {name: compliance(system, pressure) for name, pressure in PRESSURES.items()}
        steps = {1: {name: MeasuredQuantity(value, abs(value)) for name, value in result.items()}}
        runs.append(VerifiedRun(run.formulation, run.size, run.case.mesh.n_elements, Status.CONVERGED, steps=steps))
    return Verification("compliances", "", {}, {}, order, len(runs), tuple(runs))


def compliance(system: ReducedSystem, pressure: Callable[[Array], Array]) -> float:
    """Return the mean displacement under the pressure per force [m/N]: the work divided by the squared force."""
    nodal = pressure(np.linalg.norm(system.points[:, :2], axis=1))
    load = np.zeros((len(nodal), N_FIELDS))
    load[:, 2] = -nodal
    work = -(system.weights * nodal) @ system.apply(load)[:, 2]
    return float(work / (system.weights @ nodal) ** 2)


def short_waves(boundary: ReducedSystem, volume: ReducedSystem) -> float:
    """Return the smallest ratio of the work of a pressure by finite and by boundary elements (see WAVERING)."""
    inner = np.linalg.norm(boundary.points[:, :2], axis=1) < RADIUS
    works = []
    for system in (volume, boundary):
        matrix = system.dense()
        assert matrix is not None
        work = system.weights[inner, None] * matrix[:, 2, :, 2][np.ix_(inner, inner)]
        works.append((work + work.T) / 2.0)
    return float(eigvalsh(*works)[0])


def _compared(result: Verification) -> Iterator[tuple[str, Agreement]]:
    for pair in result.agreements:
        if pair.first.quantity in COMPARED:
            yield pair.first.quantity.replace("_", " "), pair


def _unit(pair: Agreement) -> str:
    return "m/N" if pair.first.quantity in PRESSURES else unit_of(pair.first.quantity)


def finest(name: str, result: Verification) -> Iterator[Check]:
    """Check resultants on the finest meshes."""
    for quantity, pair in _compared(result):
        one, other = pair.first.limit.finest, pair.second.limit.finest
        yield Check(f"{name}: {quantity}, finest meshes", other, one, FINEST, _unit(pair))


def extrapolated(name: str, result: Verification, explained: str = "") -> Iterator[Check]:
    """Check limits extrapolated with the theoretical order from the last two meshes; common scatter cancels."""
    for quantity, pair in _compared(result):
        one, other = (of_order(each.sizes, each.values, result.order) for each in (pair.first, pair.second))
        yield Check(
            f"{name}: {quantity}, extrapolated",
            other,
            one,
            EXTRAPOLATED,
            _unit(pair),
            explained=explained,
            explained_up_to=SCATTERED_UP_TO,
        )


def agreement(name: str, result: Verification, nodal: str = "") -> Iterator[Item]:
    """Check that methods agree within their errors; nodal: reason why values at nodes may differ by twice as much."""
    for pair in result.agreements:
        quantity = f"{name}: {pair.first.quantity.replace('_', ' ')}"
        words = f"{quantity}: methods agree within their errors"
        why = nodal if pair.first.quantity.startswith(COUNTED) else ""
        a_little = abs(pair.difference) <= 2.0 * pair.allowed
        yield Claim(words, _share(pair), "difference not larger than allowed", _holds(pair), why, a_little)
        if pair.first.quantity in COMPARED:
            yield _convergence(quantity, (pair.first, pair.second))


def converged(name: str, result: Verification) -> Claim:
    """Check that all runs converged."""
    holds = all(run.status == "converged" for run in result.runs)
    return Claim(f"{name}: runs", str(result.verdict), "all converge", holds)


def _share(pair: Agreement) -> str:
    difference, allowed = (100 * value / pair.scale for value in (pair.difference, pair.allowed))
    return f"{difference:+.2g} %, allowed {allowed:.2g} %"


def _holds(pair: Agreement) -> bool | None:
    return {"agree": True, "disagree": False}.get(pair.verdict)


def _convergence(title: str, estimates: tuple[Estimate, ...]) -> Plot:
    mean = np.mean([estimate.limit.value for estimate in estimates])
    curves = [
        Curve(
            estimate.formulation,
            np.array([*estimate.sizes, 0.0]),
            100 * (np.array([*estimate.values, estimate.limit.value]) / mean - 1),
            points=True,
        )
        for estimate in estimates
    ]
    return Plot(title, "element over zone, extrapolated at 0", "from the mean limit [%]", tuple(curves))


def large_blocks(quick: bool) -> Iterator[Item]:
    """Check boundary elements on blocks of increasing size, extrapolated to the half space with an error like 1/L.

    Both have the same nodes in the contact zone, which therefore does not contribute to the difference.
    """
    case = load_case(HERE / "half_space.toml")
    divisions, first = (6, 5) if quick else (12, 10)
    zone = half_space_mesh(0.1, 0.005, divisions, 1, Quad4())
    exact = _totals(replace(case, mesh=zone, formulation=HalfSpace()))
    sizes = np.array([1.0, 2.0, 4.0])
    result = [_totals(_block(case, float(size), divisions, first + int(np.log2(size)))) for size in sizes]
    for name, true in exact.items():
        values = [totals[name] for totals in result]
        limit = richardson(1.0 / sizes, values, 1.0)
        tolerance = FINEST if quick else EXTRAPOLATED
        text = f"blocks of increasing size, extrapolated to the half space: {name.replace('_', ' ')}"
        yield Check(text, limit.value, true, tolerance, unit_of(name))
        curve = Curve("block", 1.0 / sizes, 100 * (np.array(values) / true - 1), points=True)
        end = Curve("extrapolated", np.zeros(1), np.array([100 * (limit.value / true - 1)]), points=True)
        yield Plot(text, "50 mm over half width", "from the half space [%]", (curve, end))


def _block(case: Case, size: float, divisions: int, rings: int) -> Case:
    """Return the case on a grounded block like that of the paper, but `size` times as large."""
    paper = load_case(HERE.parent / SECTIONS[0].file)
    mesh = block_mesh(0.05 * size, 0.12 * size, 0.005, divisions, rings, rings // 2, Quad4(), Grading(layer_growth=1.5))
    return replace(case, mesh=mesh, conditions=paper.conditions)


def _totals(case: Case) -> dict[str, float]:
    result = solve_case(case)
    if result.status != "converged":
        raise RuntimeError(f"{case.title}: {result.status}")
    totals = resultants(result.zone, result.steps[-1])
    return {name: quantities.totals()[name](totals) for name in ("force", "charge", "magnetic_flux")}
