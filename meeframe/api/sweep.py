"""Parameter sweeps of cases built in Python."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from meeframe.api.case import Case
from meeframe.api.progress import Show, shown
from meeframe.common.errors import CaseError
from meeframe.common.toml import toml_text
from meeframe.plugin import registry as plugins
from meeframe.results.result import Interrupted
from meeframe.results.sweep_files import SWEEP_FILE, dataset
from meeframe.study.sweep import run
from meeframe.study.sweep.engine import pool_of


def sweep(
    case: Case,
    axes: Mapping[str, Any],
    out: str | Path | None = None,
    *,
    fields: Sequence[str] = (),
    every_increment: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    systems: str | Path | None = None,
    overwrite: bool = False,
    progress: Show = None,
) -> Any:
    """Solve a case for all combinations of values of its keys, and return the results as one dataset.

    Parameters
    ----------
    case : Case
        The case that is changed; all its objects have names in case files.
    axes : mapping
        Values by key, such as {"contact.law.mu": [0.1, 0.3]}; or by a name of the axis, the values by key, such as
        {"mu": {"contact.law.mu": [0.1, 0.3]}}; or by a name and labels, the changes. Keys and values are those of
        [axes] in a study file (docs/howto/sweep.md).
    out : str or Path, optional
        Folder that stores the results of all points, from which an interrupted sweep is resumed; by default nothing is
        stored but the dataset.
    fields : sequence of str, optional
        Nodal fields in the dataset, such as "pressure".
    every_increment : bool, optional
        True for all increments in the dataset instead of the last one of each point.
    workers : int, optional
        Number of processes; by default one, which is this process with all its threads.
    scheduler : str, optional
        Address of the scheduler of a Dask cluster that solves the points instead, such as "tcp://host:8786".
    systems : str or Path, optional
        Folder of reduced systems that other sweeps use too; by default they are stored with the results.
    overwrite : bool, optional
        True to replace another sweep in the folder.
    progress : bool or callable, optional
        As for `Case.solve`.

    Returns
    -------
    xarray.Dataset
        Quantities over the axes, and the status of each point; units are attributes.

    Raises
    ------
    Interrupted
        After Ctrl-C, with the dataset of the points that are finished; the others have the status "unfinished".
    MeeframeError
        For keys or values that are not allowed, without xarray, or if the folder cannot be written.
    """
    study = {"case": "case.toml", "fields": list(fields), "every_increment": every_increment, "axes": axes}
    files = [*map(Path, case.plugins)]
    opened = pool_of(1 if workers is None and scheduler is None else workers, scheduler, files)
    try:
        text = toml_text({"title": case.title, **study} if case.title else study)
    except TypeError as error:
        raise CaseError(f"Sweep: {error}") from None
    with TemporaryDirectory() as folder, shown(progress) as report, opened as pool:
        case.to_toml(Path(folder) / "case.toml")
        file = Path(folder) / "study.toml"
        file.write_text(text, encoding="utf-8")
        target = Path(folder) / "out" if out is None else Path(out)
        shared = None if systems is None else Path(systems)
        registry = plugins.load(*files)
        try:
            return dataset(run.sweep(file, target, pool, overwrite, registry, report, systems=shared))
        except CaseError as error:  # without the names of files that the caller did not write
            raise CaseError(str(error).replace(f"{file}: ", "Sweep: ")) from error.__cause__
        except KeyboardInterrupt as error:
            raise _interrupted(error, target, out is not None) from None


def _interrupted(error: KeyboardInterrupt, folder: Path, lasting: bool) -> KeyboardInterrupt:
    """Return an interruption with the dataset of the finished points in a folder; lasting: whether that remains."""
    if not (folder / SWEEP_FILE).is_file():
        return error
    import xarray

    interrupted = Interrupted(xarray.load_dataset(folder / SWEEP_FILE, engine="h5netcdf"))
    remain = "the finished points are in the attribute `result` of this error"
    for note in getattr(error, "__notes__", []) if lasting else [remain]:
        interrupted.add_note(note)
    return interrupted
