"""Result of a run: a sequence of increments with tables, datasets and figures."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import overload

from meeframe.results import records
from meeframe.results.files import read_result as read_records
from meeframe.results.records import StepResult


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

        Raises ResultError if there is none or it cannot be read.
        """
        return cls.of(read_records(folder))

    @classmethod
    def of(cls, result: records.Result) -> "Result":
        """Return a result with the data of another one."""
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
        return self.steps[index]


def read_result(folder: str | Path) -> Result:
    """Return the result in an output folder; see `Result.load`."""
    return Result.load(folder)


class Interrupted(KeyboardInterrupt):
    """Interruption of a run.

    Parameters
    ----------
    result : Result
        Result with the increments that were finished before.
    *arguments
        Message.
    """

    def __init__(self, result: Result, *arguments: object) -> None:
        super().__init__(*arguments)
        self.result = result
