"""Fields inside the bodies of a finished run and on their interfaces; bodies are reduced again from the stored case."""

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from meeframe.common.errors import CaseError, ResultError
from meeframe.common.toml import toml_tables
from meeframe.fields import Array
from meeframe.model.case import Case
from meeframe.model.load import case_from_tables, load_case
from meeframe.model.second_body import SecondBody
from meeframe.model.solve import reduce
from meeframe.plugin.registry import Registry
from meeframe.results.files import read_result
from meeframe.results.interfaces import InterfaceMaxima, interface_maxima
from meeframe.results.interior import BODIES, Body, InteriorResult, PointGrid
from meeframe.results.interior import interior as interior_of
from meeframe.results.records import Result
from meeframe.results.selection import Which, select
from meeframe.system.reduced import Progress, ReducedSystem, silent
from meeframe.system.two_body import TURN_OVER


@dataclass(frozen=True, eq=False)
class ReducedRun:
    """A finished run whose bodies are reduced when their fields are first needed.

    Attributes
    ----------
    result
        The result.
    case
        Its case.
    progress
        Function that receives a stage and the fraction done.
    """

    result: Result
    case: Case
    progress: Progress = silent

    @classmethod
    def of(
        cls,
        run: Result | Path | str,
        case: Case | Path | str | None = None,
        registry: Registry | None = None,
        progress: Progress = silent,
    ) -> "ReducedRun":
        """Return a run with its case; the arguments are those of `interior`."""
        result = run if isinstance(run, Result) else read_result(Path(run))
        return cls(result, _case(result, case, registry), progress)

    @cached_property
    def system(self) -> ReducedSystem:
        """The reduced system of the bodies."""
        return reduce(self.case, self.progress)

    def interior(
        self, points: Array | PointGrid | None = None, step: Which = None, body: Body = "first"
    ) -> InteriorResult:
        """Return fields inside a body; see the function `interior`."""
        chosen = select(self.result, step)
        if points is None:
            layers = self._body(body).layers
            thickness = math.inf if layers.base is None else float(layers.bottoms[-1])
            points = PointGrid.below_contact(
                self.result.zone, chosen, body, layers.interface_depths.tolist(), thickness
            )
        return interior_of(self.system, chosen, points, body=body, progress=self.progress)

    def interfaces(self, step: Which = None, body: Body = "first") -> list[InterfaceMaxima]:
        """Return the largest tractions on the interfaces of a body, none of a homogeneous one; see `interfaces`."""
        chosen, zone = select(self.result, step), self.result.zone
        one = self._body(body)
        depths = one.layers.interface_depths
        if not len(depths):
            return []
        # a periodic surface has no points beyond its zone, another one those of its mesh
        extent = zone.points
        if not one.formulation.is_periodic():
            extent = one.mesh.points * (TURN_OVER if body == "second" else 1.0)
        return interface_maxima(self.system, zone, chosen, depths, extent, body=body, progress=self.progress)

    def _body(self, body: Body) -> Case | SecondBody:
        """Return one of the bodies of the case. Raises CaseError if it has no such body."""
        if body not in BODIES:
            raise CaseError(f"body {body!r}: allowed: {', '.join(BODIES)}")
        one = self.case if body == "first" else self.case.second_body
        if one is None:
            raise CaseError("there is no second body; allowed: the first")
        return one


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
    run : Result, Path or str
        A result, or the folder of one.
    points : Array or PointGrid, optional
        Positions (m, 3) in global axes [m], or a grid; by default a box under the contact
        (`PointGrid.below_contact`). Large numbers of points take time, which `progress` shows.
    case : Case, Path or str, optional
        The case, or its file; by default the case stored in the result, whose relative paths start in the current
        folder.
    step : int, tuple of int, str or StepResult, optional
        Increment, as for `Result.select`: by default that of the peak load.
    body : {'first', 'second'}, optional
        "first" or "second" of two bodies in contact; see `meeframe.results.interior.interior`.
    registry : Registry, optional
        Registry of plugins for the case, by default that of the installed ones.
    progress : callable, optional
        Function that receives a stage and the fraction done.

    Returns
    -------
    InteriorResult
        Fields at the points.

    Raises
    ------
    ResultError
        If there is no such increment, if the result holds no case or one that is not TOML, or if no node is in contact
        and no points are given.
    CaseError
        If the formulation cannot evaluate fields inside the body, or a point is outside.
    """
    return ReducedRun.of(run, case, registry, progress).interior(points, step, body)


def interfaces(
    run: Result | Path | str,
    *,
    case: Case | Path | str | None = None,
    step: Which = None,
    body: Body = "first",
    registry: Registry | None = None,
    progress: Progress = silent,
) -> list[InterfaceMaxima]:
    """Return the largest tension and shear on each interface of a layered body, from the surface down.

    The interfaces are those below layers, and that with a rigid base. See
    `meeframe.results.interfaces.interface_maxima` for the points that are evaluated.

    Parameters
    ----------
    run, case, step, body, registry, progress
        As for `interior`.

    Returns
    -------
    list of InterfaceMaxima
        One for each interface, with the values and their positions; none for a homogeneous body.

    Raises
    ------
    ResultError
        If there is no such increment, if the result holds no case or one that is not TOML, or if no node is in contact.
    CaseError
        If there is no such body, or the formulation cannot evaluate fields inside it.
    """
    return ReducedRun.of(run, case, registry, progress).interfaces(step, body)


def _case(result: Result, case: Case | Path | str | None, registry: Registry | None) -> Case:
    if isinstance(case, Case):
        return case
    if case is not None:
        return load_case(case, registry)
    text = result.provenance.case_text
    if not text.strip():
        raise ResultError("the result holds no text of a case; allowed: name the case")
    try:
        tables = toml_tables(text)
    except (ValueError, RecursionError) as error:  # results of others may hold any text
        raise ResultError(
            f"the case stored with the result is not a TOML file: {error}; allowed: name the case"
        ) from None
    return case_from_tables(tables, registry, Path(), text, "the case of the result")
