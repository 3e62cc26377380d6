"""Verification of one case by several formulations on several meshes, compared within their error estimates."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from meeframe.common.errors import CaseError, MeeframeError
from meeframe.common.toml import read_toml
from meeframe.contact.problem import Status
from meeframe.fields import N_MECHANICAL, POTENTIALS, FieldScaling
from meeframe.indenters.base import IndenterMotions
from meeframe.model.cache import cached_reduce
from meeframe.model.case import Case, Warn, ignore, warnings_of
from meeframe.model.load import case_from_tables, load_case
from meeframe.model.solve import bodies_of, provenance, reduce, solve_steps
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import Kind, Registry
from meeframe.results.figures import check_format, write_figure
from meeframe.results.output import open_output, rewriting
from meeframe.results.records import StepResult, Zone, zone_of
from meeframe.results.resultants import resultants
from meeframe.study.choices import Choice, enter
from meeframe.study.quantities import totals
from meeframe.study.refinement import coarsen, element_size
from meeframe.study.reports.extrapolation import MESHES, SECOND
from meeframe.study.reports.verified import MeasuredQuantity, Verification, VerifiedRun
from meeframe.study.reports.verify import verification_figure, verification_json
from meeframe.system.reduced import Progress, ReducedSystem, silent

NUMBERS_FILE: Final = "verify.json"
FIGURE: Final = "convergence"

_MAX_MESHES: Final = 20

_TOTALS_OF: Final = {
    "normal_force": ("force",),
    "tangential_force": ("force_x", "force_y"),
    "moment": ("moment_x", "moment_y"),
    "torque": ("torque",),
}
"""Totals that a prescribed mechanical resultant fixes, to which the total flux of a scalar field is added.

The work-conjugate motion is compared instead.
"""


@dataclass(frozen=True)
class Meshes:
    """Meshes of a verification.

    Attributes
    ----------
    levels : int
        Number of meshes; the finest is that of the case.
    factor : float
        Ratio of the element sizes of successive meshes.
    order : float
        Theoretical order of totals, used where no order is observed.

    Raises
    ------
    CaseError
        If a value is out of range.
    """

    levels: int = MESHES
    factor: float = 1.5
    order: float = SECOND

    def __post_init__(self) -> None:
        if not MESHES <= self.levels <= _MAX_MESHES:
            needed = f"{MESHES} to {_MAX_MESHES}; an observed order needs {MESHES}"
            raise CaseError(f"levels = {self.levels}: allowed: {needed}")
        if not 1.0 < self.factor <= 4.0:
            raise CaseError(f"factor = {self.factor:g}: allowed: above 1, at most 4")
        if not 0.5 <= self.order <= 4.0:
            raise CaseError(f"order = {self.order:g}: allowed: 0.5 to 4")

    def sizes(self) -> Iterator[float]:
        """Yield the element sizes relative to those of the case, decreasing to 1."""
        return (self.factor**level for level in reversed(range(self.levels)))


@dataclass(frozen=True, eq=False)
class PlannedRun:
    """A run to be done.

    Attributes
    ----------
    formulation : str
        Label of the formulation.
    size : float
        Element size relative to the width of the contact zone.
    case : Case
        The case of the run.
    """

    formulation: str
    size: float
    case: Case


def verify(
    file: Path,
    out: Path,
    formulations: Sequence[str] = (),
    meshes: Meshes | None = None,
    every_step: bool = False,
    overwrite: bool = False,
    registry: Registry | None = None,
    progress: Progress = silent,
    cache: Path | None = None,
    warn: Warn = ignore,
    suffix: str = "png",
) -> Verification:
    """Run a case with several formulations on several meshes; write verify.json and a figure.

    verify.json is rewritten after every run. Runs that do not converge are marked in the verification.

    Parameters
    ----------
    file : Path
        The case file.
    out : Path
        Output folder; created if it does not exist.
    formulations : sequence of str, optional
        Names or inline tables, as for `meeframe compare`. By default all registered formulations; those that refuse the
        case are listed in the verification.
    meshes : Meshes, optional
        Meshes to use.
    every_step : bool, optional
        Whether to compare at the end of every load step instead of the last one only.
    overwrite : bool, optional
        Whether earlier results in `out` are replaced.
    registry : Registry, optional
        Registry of plugins; by default everything that is installed.
    progress : callable, optional
        Called with the stage and the fraction of it that is done.
    cache : Path, optional
        Folder of reduced systems shared with other verifications, see `meeframe.model.cache`.
    warn : callable, optional
        Called first, with the warnings of each formulation on each mesh and of the case.
    suffix : str, optional
        Format of the figure, of meeframe.results.figures.FORMATS.

    Returns
    -------
    Verification
        All runs, extrapolated values and comparisons.

    Raises
    ------
    CaseError, PluginError
        Before anything is computed, for an invalid case, a mesh that cannot be coarsened, a named formulation that
        refuses the case, or if fewer than two formulations accept it.
    ResultError
        For an unknown format, if `out` cannot be written, or if it is not empty and overwrite is false.
    """
    check_format(suffix)
    registry, meshes = registry or plugins.load(), meshes or Meshes()
    case = load_case(file, registry)
    chosen = [Choice.read("formulation", text) for text in formulations or registry.names(Kind.FORMULATION)]
    planned, refusals = planned_runs(file, chosen, meshes, registry)
    if refusals and formulations:
        raise CaseError("\n".join(f"--formulation {name}: {text}" for name, text in refusals.items()))
    if len({run.formulation for run in planned}) < 2:
        reasons = "".join(f"\n{name}: {text}" for name, text in refusals.items())
        raise CaseError(f"{file}: a verification needs at least two formulations that accept the case{reasons}")
    with open_output(out, overwrite):
        for text in (*warnings_of(body for run in planned for body in bodies_of(run.case)), *case.preflight):
            warn(text)
        versions = {name: version for run in planned for name, version in provenance(run.case).versions.items()}
        verification = Verification(
            case.title, case.text, versions, refusals, meshes.order, len(planned), fields=case.fields
        )
        reducer = (
            partial(reduce, progress=progress)
            if cache is None
            else partial(cached_reduce, folder=cache, progress=progress)
        )
        solve = partial(_solve, every_step=every_step, reducer=reducer)
        return _run_all(verification, planned, solve, out, progress, suffix)


def _run_all(
    verification: Verification,
    planned: Sequence[PlannedRun],
    solve: Callable[[PlannedRun], VerifiedRun],
    out: Path,
    progress: Progress,
    suffix: str,
) -> Verification:
    """Solve the planned runs and write the verification into a locked output folder."""
    with rewriting(out / NUMBERS_FILE) as write:
        for number, run in enumerate(planned):
            progress("runs", number / len(planned))
            verification = replace(verification, runs=(*verification.runs, solve(run)))
            write(verification_json(verification))
    progress("runs", 1.0)
    write_figure(verification_figure(verification), out, FIGURE, suffix)
    return verification


def planned_runs(
    file: Path, chosen: Sequence[Choice], meshes: Meshes, registry: Registry
) -> tuple[list[PlannedRun], dict[str, str]]:
    """Return all runs of a verification.

    Parameters
    ----------
    file : Path
        The case file.
    chosen : sequence of Choice
        Formulations to compare.
    meshes : Meshes
        Number and ratio of the meshes.
    registry : Registry
        Registry of plugins.

    Returns
    -------
    list of PlannedRun
        The runs, coarsest meshes first.
    dict of str to str
        Reasons of the formulations that refuse the case, by their labels.

    Raises
    ------
    CaseError
        If the meshes cannot be coarsened or two of them are equal.
    """
    _, tables = read_toml(file)
    runs: list[PlannedRun] = []
    refusals: dict[str, str] = {}
    sizes = [element_size(coarsen(tables, size, registry)) for size in meshes.sizes()]
    if any(coarse <= fine for coarse, fine in pairwise(sizes)):
        counts = ", ".join(f"{1 / size:g}" for size in sizes)
        raise CaseError(
            f"{file}: mesh.divisions = {tables['mesh']['divisions']}: {meshes.levels} meshes that differ by a "
            f"factor of {meshes.factor:g} would have {counts}; allowed: more divisions, a larger factor"
        )
    for choice in chosen:
        try:
            runs += [
                PlannedRun(choice.label, size, _case(file, tables, choice, scale, registry))
                for scale, size in zip(meshes.sizes(), sizes, strict=True)
            ]
        except MeeframeError as error:
            refusals[choice.label] = str(error)
    return sorted(runs, key=lambda run: -run.size), refusals


def _case(file: Path, tables: Mapping[str, Any], choice: Choice, size: float, registry: Registry) -> Case:
    """Return the case with a formulation on a coarser mesh.

    Raises as case_from_tables and meeframe.study.refinement.coarsen.
    """
    changed = coarsen(tables, 1.0, registry)
    enter(changed, "formulation", choice.value, registry)
    return case_from_tables(coarsen(changed, size, registry), registry, file.parent)


def _solve(run: PlannedRun, every_step: bool, reducer: Callable[[Case], ReducedSystem]) -> VerifiedRun:
    """Solve one run and return its quantities, or the reason why a solver, law or formulation refuses it."""
    result = VerifiedRun(run.formulation, run.size, run.case.mesh.n_elements)
    begin = time.perf_counter()
    try:
        system = reducer(run.case)
        increments = tuple(solve_steps(run.case, system, boundary=False))
    except MeeframeError as error:
        return replace(result, status="refused", message=str(error), seconds=time.perf_counter() - begin)
    failed = next((step for step in increments if step.status is not Status.CONVERGED), None)
    ends = [step for step in increments if step.increment == run.case.steps[step.step - 1].increments]
    compared = ends if every_step else ends[-1:]
    return replace(
        result,
        status=str(failed.status if failed else Status.CONVERGED),
        message=failed.message if failed else "",
        steps={step.step: measured(system, step, run.case.material.scaling) for step in compared},
        seconds=time.perf_counter() - begin,
    )


def measured(system: ReducedSystem, step: StepResult, scaling: FieldScaling) -> dict[str, MeasuredQuantity]:
    """Return the quantities of a load step that a verification compares.

    These are `meeframe.study.quantities.totals` and the moments without those that are prescribed, and the motions that
    were found for prescribed resultants.

    Parameters
    ----------
    system : ReducedSystem
        Reduced system of the case.
    step : StepResult
        End of the load step.
    scaling : FieldScaling
        Scaling of the material.

    Returns
    -------
    dict of str to MeasuredQuantity
        Quantities by name, SI units.
    """
    zone = zone_of(system)
    summed = resultants(zone, step)
    values = {name: total(summed) for name, total in totals(step.fields).items()}
    values |= {"moment_x": summed.moment[0], "moment_y": summed.moment[1], "torque": summed.torque}
    for key in step.loading.prescribed:
        for name in _TOTALS_OF.get(key, (key,)):
            values.pop(name, None)
    values |= _free_motions(step)
    scales, noise = _scales(system, step), {"contact_area": _area_uncertainty(zone, summed.contact_area)}
    smallest = _physical_scales(step, scales["force"], scaling)
    return {
        name: MeasuredQuantity(
            float(value), scales.get(name, abs(float(value))), noise.get(name, 0.0), smallest.get(name, 0.0)
        )
        for name, value in values.items()
    }


def _physical_scales(step: StepResult, force: float, scaling: FieldScaling) -> dict[str, float]:
    """Return the fluxes and potentials whose work equals that of the mechanical loads, if the fields were coupled.

    These are the force and the largest displacement in the units that make the constants of the material of order one:
    Q = F sqrt(eps/c) and phi = u sqrt(c/eps), likewise in the other scalar fields.
    """
    displacement = float(np.abs(step.displacement).max())
    ratios = scaling.factors[0] / scaling.factors[N_MECHANICAL:]  # sqrt(eps/c), sqrt(mu/c)
    scales: dict[str, float] = {}
    for scalar, ratio in zip(step.fields.scalars, ratios.tolist(), strict=True):
        scales |= {scalar.resultant: force * ratio, f"max_{scalar.value_name}": displacement / ratio}
    return scales


def _scales(system: ReducedSystem, step: StepResult) -> dict[str, float]:
    """Return the totals without cancellation: forces from moduli of tractions, potentials due to tractions alone."""
    load = step.state.load
    moduli = np.column_stack([np.linalg.norm(step.traction, axis=1), np.abs(step.fluxes)])
    force, *fluxes = (system.weights @ moduli).tolist()
    arm = float(np.ptp(system.points, axis=0).max())
    pressed = system.apply(np.where(np.arange(system.n_fields) < N_MECHANICAL, load, 0.0))
    potentials = np.abs(pressed[:, POTENTIALS]).max(axis=0).tolist()
    scalars = step.fields.scalars
    return {
        **dict.fromkeys(("force", "force_x", "force_y"), force),
        **dict.fromkeys(("moment_x", "moment_y", "torque"), arm * force),
        **{scalar.resultant: flux for scalar, flux in zip(scalars, fluxes, strict=True)},
        **{f"max_{scalar.value_name}": value for scalar, value in zip(scalars, potentials, strict=True)},
    }


def _free_motions(step: StepResult) -> dict[str, float]:
    """Return the components of the motions whose resultants were prescribed, by name."""
    motions: dict[str, float] = {}
    indenter, potentials = IndenterMotions(step.fields), [scalar.value_name for scalar in step.fields.scalars]
    for key in step.loading.prescribed:
        columns_of_motion = indenter.columns[key]
        name = next(motion for motion, columns in indenter.motions.items() if columns == columns_of_motion)
        values = step.loading.motion[columns_of_motion]
        potential = "indenter_" * (name in potentials)
        suffixes = ("",) if len(values) == 1 else ("_1", "_2")
        motions |= {f"{potential}{name}{suffix}": value for suffix, value in zip(suffixes, values, strict=True)}
    return motions


def _area_uncertainty(zone: Zone, area: float) -> float:
    """Return the uncertainty [m^2] of the area of a disc that is counted by elements of this zone.

    Each of the N = P/h elements that its perimeter P crosses counts with an error spread over its area; the sum is h^2
    sqrt(N/12) if the errors were independent, and h^2 sqrt(N) is used because symmetric grids scatter more.
    """
    size = np.sqrt(zone.weights.sum() / sum(len(nodes) for _, nodes in zone.cells))
    crossed = 2.0 * np.sqrt(np.pi * area) / size
    return float(size**2 * np.sqrt(crossed))
