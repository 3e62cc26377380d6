"""Fields inside the body of a finished run, whose body is reduced again from the stored case."""

import tomllib
from pathlib import Path

from meeframe.common.errors import ResultError
from meeframe.fields import Array
from meeframe.model.case import Case
from meeframe.model.load import case_from_tables, load_case
from meeframe.model.solve import reduce
from meeframe.plugin.registry import Registry
from meeframe.results.files import read_result
from meeframe.results.interior import Body, InteriorResult, PointGrid
from meeframe.results.interior import interior as interior_of
from meeframe.results.records import Result
from meeframe.results.selection import Which, select
from meeframe.system.reduced import Progress, silent


def interior(
    run: Result | Path | str,
    points: Array | PointGrid | None = None,
    *,
    case: Case | Path | str | None = None,
    step: Which = None,
    body: Body = "first",
    registry: Registry | None = None,
    progress: Progress = silent,
) -> InteriorResult:
    """Return the fields at points inside the body of a finished run.

    A result holds the loads on the contact zone and the text of the case. The body is reduced again from this text,
    which takes the time of the reduction.

    Parameters
    ----------
    run
        A result, or the folder of one.
    points
        Positions (m, 3) in global axes [m], or a grid; by default a box under the contact
        (`PointGrid.below_contact`). Large numbers of points take time, which `progress` shows.
    case
        The case, or its file; by default the case stored in the result, whose relative paths start in the current
        folder.
    step
        Increment, as for `Result.select`: by default that of the peak load.
    body
        "first" or "second" of two bodies in contact; see `meeframe.results.interior.interior`.
    registry
        Registry of plugins for the case, by default that of the installed ones.
    progress
        Function that receives a stage and the fraction done.

    Raises
    ------
    ResultError
        If there is no such increment, if the result holds no case, or if no node is in contact and no points are given.
    CaseError
        If the formulation cannot evaluate fields inside the body, or a point is outside.
    """
    result = run if isinstance(run, Result) else read_result(Path(run))
    chosen = select(result, step)
    grid = PointGrid.below_contact(result.zone, chosen, body) if points is None else points
    system = reduce(_case(result, case, registry), progress)
    return interior_of(system, chosen, grid, body=body, progress=progress)


def _case(result: Result, case: Case | Path | str | None, registry: Registry | None) -> Case:
    if isinstance(case, Case):
        return case
    if case is not None:
        return load_case(case, registry)
    text = result.provenance.case_text
    if not text.strip():
        raise ResultError("the result holds no text of a case; allowed: name the case")
    return case_from_tables(tomllib.loads(text), registry, Path(), text, "the case of the result")
