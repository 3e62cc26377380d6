"""From a case to files: result.h5 step by step, then summary.json, figures and fields.vtu from it."""

from dataclasses import replace
from pathlib import Path

from meeframe.case.case import Case
from meeframe.case.clock import Clock, peak_memory_mb
from meeframe.case.load import load_case
from meeframe.case.solve import provenance, solve_steps, zone_of
from meeframe.core.formulation import Progress, silent
from meeframe.core.result import Result
from meeframe.io.output import SUMMARY_FILE, check_output, clear_output, replacing
from meeframe.io.results import append_step, create_result, finish_result, read_result
from meeframe.io.vtk import write_fields
from meeframe.report.figures import figures, save_figure
from meeframe.report.summary import summary_json


def run(case: Case | str | Path, out: str | Path, overwrite: bool = False, progress: Progress = silent) -> Result:
    """Solve a case, given as an object or as the path of its file, and write its results into the folder `out`.

    Finished steps are in result.h5 whatever happens later. Raises ResultError, before anything is computed, if `out`
    cannot be written or holds files and overwrite is false; errors as load_case and solve_case.
    """
    clock = Clock(progress)
    clock("reading", 0.0)
    case = case if isinstance(case, Case) else load_case(case)
    folder = Path(out)
    check_output(folder, overwrite)
    system = case.formulation.reduce(case.body, clock)
    result = Result(provenance(case), zone_of(system), len(case.steps))
    clear_output(folder)
    create_result(folder, result)
    try:
        for step in solve_steps(case, system, clock):
            clock("writing", 0.0)
            append_step(folder, result.zone, step)
            result = replace(result, steps=(*result.steps, step))
        _write_reports(folder, case, clock)
    finally:
        result = replace(result, timings=clock.timings(), peak_memory_mb=peak_memory_mb())
        finish_result(folder, result)
        _write_summary(folder)
    return result


def _write_reports(folder: Path, case: Case, clock: Clock) -> None:
    """Figures and fields of the result file as it stands."""
    result = read_result(folder)
    if case.output.figures:
        clock("figures", 0.0)
        for name, figure in figures(result).items():
            with replacing(folder / name) as path:
                save_figure(figure, path)
    if case.output.vtu:
        clock("fields", 0.0)
        write_fields(folder, result)


def _write_summary(folder: Path) -> None:
    with replacing(folder / SUMMARY_FILE) as path:
        path.write_text(summary_json(read_result(folder)), encoding="utf-8")
