"""Result of a run: a sequence of increments with tables, datasets and figures."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, overload

from meeframe.results import records, tables
from meeframe.results.files import read_result as read_records
from meeframe.results.html import summary_html
from meeframe.results.plots import Plots
from meeframe.results.records import StepResult
from meeframe.results.scene import scene
from meeframe.results.selection import Which, select


@dataclass(frozen=True, eq=False, repr=False)
class Result(records.Result):
    """Result of a run, a sequence of the finished increments of its load steps.

    Parameters
    ----------
    provenance : Provenance
        Title and text of the case, versions of the software.
    zone : Zone
        Contact zone.
    planned_steps : int
        Number of increments of the case.
    steps : tuple of StepResult, optional
        Finished increments.
    timings : mapping of str to float, optional
        Seconds by stage.
    peak_memory_mb : float, optional
        Peak memory of the process [MB].
    """

    @classmethod
    def load(cls, folder: str | Path) -> "Result":
        """Read the result in an output folder, of a run that is finished, in progress or stopped.

        Parameters
        ----------
        folder : str or Path
            Output folder.

        Returns
        -------
        Result
            The finished increments.

        Raises
        ------
        ResultError
            If there is no result or it cannot be read.
        """
        return cls.of(read_records(folder))

    @classmethod
    def of(cls, result: records.Result) -> "Result":
        """Return a result with the data of another one.

        Parameters
        ----------
        result : meeframe.results.records.Result
            The other result.

        Returns
        -------
        Result
            The same data.
        """
        return cls(**{entry.name: getattr(result, entry.name) for entry in fields(records.Result)})

    def __len__(self) -> int:
        return len(self.steps)

    def __iter__(self) -> Iterator[StepResult]:
        return iter(self.steps)

    @overload
    def __getitem__(self, index: int) -> StepResult: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[StepResult, ...]: ...
    def __getitem__(self, index: int | slice) -> StepResult | tuple[StepResult, ...]:
        chosen = self.steps[index]
        return chosen if isinstance(chosen, StepResult) else tuple(chosen)

    @property
    def plot(self) -> Plots:
        """Figures of the result: pressure, map, section, stick_slip, history, convergence."""
        return Plots(self)

    def select(self, step: Which = None) -> StepResult:
        """Return an increment: that of the peak load, or of a load step.

        Parameters
        ----------
        step : int, tuple of int, str or StepResult, optional
            Number of a load step, from 1, for its last finished increment; (step, increment), also as a text such as
            '2.5'; 'last' for the last finished increment; 'peak', the default, for the last one of those with the
            largest normal force; or the increment itself.

        Returns
        -------
        StepResult
            The increment.

        Raises
        ------
        ResultError
            If there is no such increment; the message names those that exist.
        """
        return select(self, step)

    def to_dataframe(self) -> Any:
        """Return a table with one row for each finished increment.

        Returns
        -------
        pandas.DataFrame
            Columns are the motions of the indenter, forces, total fluxes, areas, maxima, dissipated energy, iterations
            and status, named as in summary.json with a suffix for each component; `attrs["units"]` has their SI units.
            Tilt and twist with their moments are left out where they are zero and not free.

        Raises
        ------
        ResultError
            If pandas is not installed.
        """
        return tables.dataframe(self)

    def to_xarray(self) -> Any:
        """Return the nodal fields and totals of all finished increments.

        Returns
        -------
        xarray.Dataset
            Fields have the dimensions increment and node, or increment, x and y if the nodes are a rectangular grid;
            vectors have components along e1, e2 and nu of the frames of the zone. Units and labels are attributes.

        Raises
        ------
        ResultError
            If xarray is not installed.
        """
        return tables.dataset(self)

    def to_pyvista(self, step: Which = None, *, warp: float | None = None) -> Any:
        """Return a pyvista.MultiBlock of the 'body', if its fields are known, and the 'zone'; both with their fields.

        Parameters
        ----------
        step : int, tuple of int, str or StepResult, optional
            Increment, as for `select`; fields on the whole boundary are known at the end of each load step.
        warp : float, optional
            Factor on the displacement that is added to the points; by default the largest displacement appears as a
            tenth of the extent of the contact zone.

        Returns
        -------
        pyvista.MultiBlock
            Blocks 'body' and 'zone'.

        Raises
        ------
        ResultError
            Without PyVista, or if there is no such increment.
        """
        return scene(self, select(self, step), warp)

    def _repr_html_(self) -> str:
        return summary_html(self)


def read_result(folder: str | Path) -> Result:
    """Return the result in an output folder.

    Parameters
    ----------
    folder : str or Path
        Output folder of a run.

    Returns
    -------
    Result
        The finished increments.

    Raises
    ------
    ResultError
        As `Result.load`.
    """
    return Result.load(folder)


class Interrupted(KeyboardInterrupt):
    """Interruption of a run, a sweep or a study of a rough surface.

    Parameters
    ----------
    result : Result, xarray.Dataset or RoughResult
        What was finished before: increments, points of a sweep, or pressures.
    *arguments
        Message.
    """

    def __init__(self, result: Any, *arguments: object) -> None:
        super().__init__(*arguments)
        self.result = result
