"""Run the validation cases of a folder one after the other, and write table, numbers and report along the way.

A case is a folder with a module checks.py: TITLE, SOURCE (where the references are published) and a generator
`run(quick)` of the records below. At its top it may import modules beside it, and those beside its folder, by name.
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

from meeframe.common.errors import CaseError, MeeframeError, PluginFault, ResultError
from meeframe.plugin import registry as plugins
from meeframe.plugin.validation import choices
from meeframe.results.output import check_output, replacing
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
    """A case to run. items: function that yields its items, for a quick or a full validation."""

    name: str
    title: str
    source: str
    items: Callable[[bool], Iterator[Item]]


def known_cases(folder: Path) -> dict[str, Path]:
    """Return the case folders by name, FOLDER/*/checks.py. Raises CaseError if there are none."""
    if not folder.is_dir():
        raise CaseError(f"folder of validation cases {folder} does not exist; name another folder with --validation")
    found = {file.parent.name: file.parent for file in sorted(folder.glob(f"*/{MODULE}"))}
    if not found:
        raise CaseError(
            f"folder of validation cases {folder} contains no */{MODULE}; name another folder with --validation"
        )
    return found


def load_case(folder: Path) -> ValidationCase:
    """Import the module of a case. Raises CaseError if it is no case; whatever the import raises passes."""
    module = _import(folder / MODULE)
    for name, kind in (("TITLE", str), ("SOURCE", str), ("run", Callable)):
        if not isinstance(getattr(module, name, None), kind):  # type: ignore[arg-type]
            raise CaseError(f"{folder / MODULE}: {name} is missing; a case defines TITLE, SOURCE and run(quick)")
    return ValidationCase(folder.name, module.TITLE, module.SOURCE, module.run)


def validate(
    folder: Path, out: Path, names: Sequence[str] = (), quick: bool = False, progress: Progress = silent
) -> Validation:
    """Run the named cases of a folder, all if none is named; write validation.json and report.html into `out`.

    What an earlier run left there goes first. The numbers are written anew after every check, the report after every
    case, each whole or as it was before. A case that breaks off is an error in the table, and the others run all the
    same. A note on KeyboardInterrupt says what is there.
    Raises CaseError for an unknown name or a folder without cases, ResultError if `out` cannot be written,
    MeeframeError if the library of the report's plots is not installed.
    """
    known = known_cases(folder)
    for name in names:
        if name not in known:
            raise CaseError(f"unknown case {name!r}; {choices(name, tuple(known))}")
    chosen = [path for name, path in known.items() if not names or name in names]
    library = plot_library()
    check_output(out, overwrite=True)
    _clear(out)
    found = Validation(quick, _versions(), planned=len(chosen))
    try:
        for path in chosen:
            progress(path.name, 0.0)
            for case in _reports(path, quick):
                with replacing(out / NUMBERS_FILE) as file:
                    file.write_text(validation_json(_with(found, case)), encoding="utf-8")
            found = _with(found, case)
            with replacing(out / REPORT_FILE) as file:
                file.write_text(page(found, library), encoding="utf-8")
    except KeyboardInterrupt as error:
        error.add_note(_left(found, out))
        raise
    return found


def _clear(out: Path) -> None:
    """Make the folder, or take the two files of an earlier run out of it. Raises ResultError."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name in (NUMBERS_FILE, REPORT_FILE):
            (out / name).unlink(missing_ok=True)
    except OSError as error:
        raise ResultError(f"output folder {out} cannot be written: {error.strerror or error}") from None


def _left(found: Validation, out: Path) -> str:
    """Return what an interruption leaves."""
    done = f"{len(found.cases)} of {found.planned} cases finished"
    written = [str(out / name) for name in (NUMBERS_FILE, REPORT_FILE) if (out / name).exists()]
    return f"{done}; what was found so far is in {' and '.join(written)}" if written else f"{done}; nothing was written"


def _with(validation: Validation, case: CaseReport) -> Validation:
    return replace(validation, cases=(*validation.cases, case))


def _reports(folder: Path, quick: bool) -> Iterator[CaseReport]:
    """Return the report of a case after every item, and at its end."""
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
        # one broken case is a line of the table: the others tell as much without it
        told = isinstance(error, MeeframeError) and not isinstance(error, PluginFault)
        words = str(error) if told else traceback.format_exc()
        report = replace(report, error=words or type(error).__name__)
    yield replace(report, seconds=time.perf_counter() - begin, finished=True)


def _import(file: Path) -> ModuleType:
    """Return a module by its path, under a name of its own."""
    with _importable(file.parent.resolve()):
        name = f"meeframe_validation_{file.parent.name}"
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None:
            raise CaseError(f"{file}: cannot be imported")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # dataclasses look themselves up there
        spec.loader.exec_module(module)
    return module


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """Let a module import those of its folder and of the one above by their plain names, for as long as this takes.

    Every case may have a study.py: modules of these names are set aside before, and no trace is left after.
    """
    places = (folder, folder.parent)
    names = {file.stem for place in places for file in place.glob("*.py")}
    others = {name: sys.modules.pop(name) for name in names & set(sys.modules)}
    sys.path[:0] = map(str, places)
    try:
        yield
    finally:
        for place in places:
            sys.path.remove(str(place))
        for name in names:
            sys.modules.pop(name, None)
        sys.modules.update(others)


def _versions() -> dict[str, str]:
    """Return the versions of the software that the numbers depend on: libraries, plugins, reference codes."""
    found = {"python": platform.python_version()}
    found |= {provider.name: provider.version for provider in plugins.load().providers}
    for name in _LIBRARIES:
        with suppress(metadata.PackageNotFoundError):  # judges need not be there
            found[name] = metadata.version(name)
    return found
