"""Run the validation cases of a folder one after the other; write the table, numbers and report along the way.

A case is a folder with a module checks.py that defines TITLE, SOURCE (publication of the references) and a generator
`run(quick)` of the records below. At module level it can import modules of its folder and of the folder above by name.
"""

import importlib.util
import platform
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Final, get_args

from meeframe.common.errors import CaseError, MeeframeError, PluginFault
from meeframe.plugin import registry as plugins
from meeframe.plugin.validation import choices
from meeframe.results.output import open_output, remove_files, replacing
from meeframe.study.reports.validation import (
    CaseReport,
    Check,
    Claim,
    Curve,
    Item,
    Map,
    Plot,
    Row,
    Skip,
    Validation,
    Verdict,
)
from meeframe.study.reports.validation_page import page, plot_library
from meeframe.study.reports.validation_table import validation_json
from meeframe.system.reduced import Progress, silent

__all__ = ["Check", "Claim", "Curve", "Item", "Map", "Plot", "Skip", "Verdict", "known_cases", "load_case", "validate"]

MODULE: Final = "checks.py"
NUMBERS_FILE: Final = "validation.json"
REPORT_FILE: Final = "report.html"
_LIBRARIES: Final = ("numpy", "scipy", "numba", "tamaas")


@dataclass(frozen=True, eq=False)
class ValidationCase:
    """A case to run.

    Attributes
    ----------
    name : str
        Name of the folder.
    title : str
        Title of the case.
    source : str
        Publication of the references.
    items : callable
        Function that yields the items of a quick or a full validation.
    """

    name: str
    title: str
    source: str
    items: Callable[[bool], Iterator[Item]]


def known_cases(folder: Path) -> dict[str, Path]:
    """Return the validation cases of a folder.

    Parameters
    ----------
    folder : Path
        The folder.

    Returns
    -------
    dict of str to Path
        Folders of the cases, with FOLDER/*/checks.py, by name.

    Raises
    ------
    CaseError
        If there are none.
    """
    if not folder.is_dir():
        raise CaseError(f"folder of validation cases {folder} does not exist; name another folder with --validation")
    cases = {file.parent.name: file.parent for file in sorted(folder.glob(f"*/{MODULE}"))}
    if not cases:
        raise CaseError(
            f"folder of validation cases {folder} contains no */{MODULE}; name another folder with --validation"
        )
    return cases


def load_case(folder: Path) -> ValidationCase:
    """Import the module of a case.

    Parameters
    ----------
    folder : Path
        Folder of the case.

    Returns
    -------
    ValidationCase
        The case.

    Raises
    ------
    CaseError
        If the module lacks TITLE, SOURCE or run. Errors of the import itself are passed on.
    """
    module = _import(folder / MODULE)
    for name, kind in (("TITLE", str), ("SOURCE", str), ("run", Callable)):
        if not isinstance(getattr(module, name, None), kind):  # type: ignore[arg-type]
            raise CaseError(f"{folder / MODULE}: {name} is missing; a case defines TITLE, SOURCE and run(quick)")
    return ValidationCase(folder.name, module.TITLE, module.SOURCE, module.run)


def validate(
    folder: Path, out: Path, names: Sequence[str] = (), quick: bool = False, progress: Progress = silent
) -> Validation:
    """Run validation cases of a folder; write validation.json and report.html.

    Files of an earlier run in `out` are removed first. The numbers are rewritten after every check and the report after
    every case, each atomically. A case that fails is an error in the table, and the others run nevertheless. A note on
    KeyboardInterrupt says what has been written.

    Parameters
    ----------
    folder : Path
        Folder of the cases.
    out : Path
        Output folder; created if it does not exist and locked until the validation ends.
    names : sequence of str, optional
        Names of the cases to run; by default all.
    quick : bool, optional
        Whether to use coarser grids.
    progress : callable, optional
        Called with the name of the case when it starts.

    Returns
    -------
    Validation
        Outcomes of all cases.

    Raises
    ------
    CaseError
        For an unknown name or a folder without cases.
    ResultError
        If `out` cannot be written, or if another process writes there.
    MeeframeError
        If plotly, which draws the report, is not installed.
    """
    known = known_cases(folder)
    for name in names:
        if name not in known:
            raise CaseError(f"unknown case {name!r}; {choices(name, tuple(known))}")
    chosen = [path for name, path in known.items() if not names or name in names]
    library = plot_library()
    with open_output(out, overwrite=True):
        remove_files(out, (NUMBERS_FILE, REPORT_FILE))
        return _run_all(chosen, out, quick, library, progress)


def _run_all(chosen: Sequence[Path], out: Path, quick: bool, library: str, progress: Progress) -> Validation:
    """Run the cases into a locked output folder."""
    validation = Validation(quick, _versions(), planned=len(chosen))
    try:
        for path in chosen:
            progress(path.name, 0.0)
            for case in _reports(path, quick):
                with replacing(out / NUMBERS_FILE) as file:
                    file.write_text(validation_json(_with(validation, case)), encoding="utf-8")
            validation = _with(validation, case)
            with replacing(out / REPORT_FILE) as file:
                file.write_text(page(validation, library), encoding="utf-8")
    except KeyboardInterrupt as error:
        error.add_note(_progress_note(validation, out))
        raise
    return validation


def _progress_note(validation: Validation, out: Path) -> str:
    """Return a note on what an interrupted validation has finished and written."""
    done = f"{len(validation.cases)} of {validation.planned} cases finished"
    written = [str(out / name) for name in (NUMBERS_FILE, REPORT_FILE) if (out / name).exists()]
    return f"{done}; results so far are in {' and '.join(written)}" if written else f"{done}; nothing was written"


def _with(validation: Validation, case: CaseReport) -> Validation:
    return replace(validation, cases=(*validation.cases, case))


def _reports(folder: Path, quick: bool) -> Iterator[CaseReport]:
    """Yield the report of a case after every item and at its end."""
    report = CaseReport(folder.name, folder.name, "")
    begin = time.perf_counter()
    try:
        case = load_case(folder)
        report = replace(report, title=case.title, source=case.source)
        for item in case.items(quick):
            now = time.perf_counter() - begin
            if not isinstance(item, Item):
                allowed = ", ".join(kind.__name__ for kind in get_args(Item))
                raise CaseError(f"{folder / MODULE}: run(quick) yields {item!r}; allowed: {allowed}")
            if isinstance(item, Plot | Map):
                report = replace(report, figures=(*report.figures, item))
            else:
                report = replace(report, rows=(*report.rows, Row(item, now - report.seconds)), seconds=now)
            yield report
        if not report.rows:
            raise CaseError(f"{folder / MODULE}: run(quick) checks nothing")
    except (Exception, SystemExit) as error:
        # a case that fails is one line of the table and does not stop the others
        expected = isinstance(error, MeeframeError) and not isinstance(error, PluginFault)
        message = str(error) if expected else traceback.format_exc()
        report = replace(report, error=message or type(error).__name__)
    yield replace(report, seconds=time.perf_counter() - begin, finished=True)


def _import(file: Path) -> ModuleType:
    """Import a module by path under a unique name."""
    with _importable(file.parent.resolve()):
        name = f"meeframe_validation_{file.parent.name}"
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None:
            raise CaseError(f"{file}: cannot be imported")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # dataclasses look up their module there
        spec.loader.exec_module(module)
    return module


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """Allow a module to import modules of its folder and of the folder above by plain names.

    Several cases may have modules of the same name, such as study.py: modules loaded before are set aside and restored.
    """
    folders = (folder, folder.parent)
    names = {file.stem for parent in folders for file in parent.glob("*.py")}
    modules = {name: sys.modules.pop(name) for name in names & set(sys.modules)}
    sys.path[:0] = map(str, folders)
    try:
        yield
    finally:
        for parent in folders:
            sys.path.remove(str(parent))
        for name in names:
            sys.modules.pop(name, None)
        sys.modules.update(modules)


def _versions() -> dict[str, str]:
    """Return the versions of the software that affects the numbers: libraries, plugins and reference codes."""
    versions = {"python": platform.python_version()}
    versions |= {provider.name: provider.version for provider in plugins.load().providers}
    for name in _LIBRARIES:
        with suppress(metadata.PackageNotFoundError):  # reference codes are optional
            versions[name] = metadata.version(name)
    return versions
