"""From a case to files: result.h5 step by step, then summary.json, figures and fields.vtu from it."""

from dataclasses import replace
from pathlib import Path

from meeframe.common.errors import ResultError
from meeframe.model.case import Case
from meeframe.model.clock import Clock, peak_memory_mb
from meeframe.model.load import load_case
from meeframe.model.solve import provenance, reduce, solve_steps
from meeframe.results.figures import figures, save_figure
from meeframe.results.files import append_step, create_result, finish_result, read_result
from meeframe.results.output import RESULT_FILE, SUMMARY_FILE, check_output, clear_output, replacing
from meeframe.results.records import Result, zone_of
from meeframe.results.summary import summary_json
from meeframe.results.vtk import write_fields
from meeframe.system.reduced import Progress, silent


def run(case: Case | str | Path, out: str | Path, overwrite: bool = False, progress: Progress = silent) -> Result:
    """Solve a case, given as an object or as the path of its file, and write its results into the folder `out`.

    Nothing in `out` is touched before the first step is finished; from then on finished steps are in result.h5 whatever
    happens. An interruption carries a note that says what `out` then holds, and so does an error after a finished step.
    Raises ResultError, before anything is computed, if `out` cannot be written or holds files and overwrite is false;
    errors as load_case and solve_case.
    """
    clock = Clock(progress)
    clock("reading", 0.0)
    case = case if isinstance(case, Case) else load_case(case)
    folder = Path(out)
    check_output(folder, overwrite)
    earlier = _identity(folder)
    try:
        return _run(case, folder, clock)
    except (KeyboardInterrupt, MemoryError) as error:
        error.add_note(_content(folder, earlier))
        raise
    except Exception as error:
        if _identity(folder) != earlier:
            error.add_note(_content(folder, earlier))
        raise


def _run(case: Case, folder: Path, clock: Clock) -> Result:
    system = reduce(case, clock)
    result = Result(provenance(case), zone_of(system), case.n_increments)
    try:
        for step in solve_steps(case, system, clock):
            clock("writing", 0.0)
            longer = replace(result, steps=(*result.steps, step))
            if result.steps:
                append_step(folder, result.zone, step)
            else:
                clear_output(folder)
                create_result(folder, longer)
            result = longer
        _write_reports(folder, case, clock)
    finally:
        result = replace(result, timings=clock.timings(), peak_memory_mb=peak_memory_mb())
        if result.steps:
            finish_result(folder, result)
            _write_summary(folder)
    return result


def _identity(folder: Path) -> tuple[int, int] | None:
    """Tells one result file from another; None if there is none."""
    path = folder / RESULT_FILE
    return (path.stat().st_ino, path.stat().st_mtime_ns) if path.is_file() else None


def _content(folder: Path, earlier: tuple[int, int] | None) -> str:
    """What the folder holds now, in words; earlier: identity of its result file before the run."""
    now = _identity(folder)
    if now is None and earlier is None:
        return f"no step was finished; nothing was written to {folder}"
    if now == earlier:
        return f"no step was finished; {folder} holds the results of an earlier run as before"
    if now is None:
        return f"no step was finished; the results of an earlier run are gone from {folder}"
    try:
        result = read_result(folder)
    except ResultError as error:
        return str(error)
    return f"{len(result.steps)} of {result.planned_steps} increments are finished and in {folder}"


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
