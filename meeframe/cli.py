"""The command line: meeframe run, check, show, plugins, new-plugin, compare, verify, reproduce, validate."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from rich.console import Console

from meeframe.core.errors import MeeframeError

if TYPE_CHECKING:
    from meeframe.core.formulation import Progress
    from meeframe.plugin.registry import Registry

CONVERGED: Final = 0
NOT_CONVERGED: Final = 1
BAD_INPUT: Final = 2
INTERRUPTED: Final = 130

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Three-dimensional frictional contact of anisotropic magneto-electro-elastic solids.",
)

plugins_app = typer.Typer()
app.add_typer(plugins_app, name="plugins")
fclib_app = typer.Typer(no_args_is_help=True, help="Exchange contact problems with other solvers in files of FCLIB.")
app.add_typer(fclib_app, name="fclib")

CaseFile = Annotated[Path, typer.Argument(metavar="CASE.toml", help="The case file (docs/case-files.md).")]
Choices = Annotated[list[str] | None, typer.Option(metavar="NAME", help="Name or inline table; repeatable.")]
PluginFiles = Annotated[
    list[Path] | None, typer.Option("--plugin", metavar="FILE.py", help="Load a plugin from a file; repeatable.")
]


def main() -> None:
    """Entry point of the console script."""
    app()


@app.command()
def run(
    case: CaseFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results; made if it does not exist.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the results that DIR holds.")] = False,
    plugin: PluginFiles = None,
) -> None:
    """Solve a case and write result.h5, summary.json, fields.vtu and figures.

    Exit status 0 if every step converged, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with _exit_status(NOT_CONVERGED, f"nothing was written to {out}"):
        from meeframe.case.load import load_case
        from meeframe.case.run import run as run_case
        from meeframe.core.result import RunStatus
        from meeframe.report.summary import summary_table

        registry = _registry(plugin)
        with _progress() as progress:
            result = run_case(load_case(case, registry) if plugin else case, out, overwrite, progress)
        _console().print(summary_table(result))
        raise typer.Exit(CONVERGED if result.status is RunStatus.CONVERGED else NOT_CONVERGED)


@app.command()
def check(case: CaseFile, plugin: PluginFiles = None) -> None:
    """Validate a case without running it."""
    with _exit_status():
        from meeframe.case.load import load_case

        checked = load_case(case, _registry(plugin))
        steps = len(checked.steps)
        print(
            f"{case}: ok: material {checked.material.name}, {checked.mesh.n_elements} elements, "
            f"contact zone {checked.zone}, {steps} step{'s' * (steps > 1)}"
        )


@app.command()
def show(folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run.")]) -> None:
    """Print the summary of a run as a table."""
    with _exit_status():
        from meeframe.io.results import read_result
        from meeframe.report.summary import summary_table

        _console().print(summary_table(read_result(folder)))


@plugins_app.callback(invoke_without_command=True)
def plugins(context: typer.Context, plugin: PluginFiles = None) -> None:
    """List everything that has a name in case files, with who provides it; `plugins show NAME` says more."""
    if context.invoked_subcommand is not None:
        context.obj = plugin
        return
    with _exit_status():
        from meeframe.report.plugins import plugin_list

        _console().print(plugin_list(_registry(plugin)))


@plugins_app.command("show")
def show_plugin(
    context: typer.Context,
    name: Annotated[str, typer.Argument(metavar="NAME", help="As written in case files.")],
    plugin: PluginFiles = None,
) -> None:
    """Print the parameters of what has this name, with units, bounds and defaults, its formula and its source."""
    with _exit_status():
        from meeframe.report.plugins import plugin_page

        _console().print(plugin_page(_registry([*(context.obj or ()), *(plugin or ())]), name))


@app.command("new-plugin")
def new_plugin(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="contact-law, conductivity-law, solver, indenter, ...")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="As case files will write it: my-law.")],
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder to make; meeframe-NAME if not given.")] = None,
) -> None:
    """Write an installable package that registers something new, with its conformance test, a case and a README."""
    with _exit_status():
        from meeframe.plugin.scaffold import kind_called
        from meeframe.plugin.scaffold import new_plugin as write_plugin

        folder = write_plugin(kind_called(kind), name, _registry(None), out)
        print(f"{folder}: {', '.join(sorted(str(p.relative_to(folder)) for p in folder.rglob('*') if p.is_file()))}")


@app.command()
def compare(
    case: CaseFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for table and figure; made if it does not exist.")],
    contact_law: Choices = None,
    conductivity_law: Choices = None,
    solver: Choices = None,
    formulation: Choices = None,
    fundamental_solution: Choices = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what DIR holds.")] = False,
    plugin: PluginFiles = None,
) -> None:
    """Run a case with all combinations of laws, solvers and formulations; write compare.json and sections.png.

    Each option takes a name or an inline table as in a case file, and may be repeated; a name takes the keys of the
    case that fit it. Exit status 0 if every run converged, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with _exit_status(NOT_CONVERGED):
        from meeframe.report.compare import comparison_table
        from meeframe.study.compare import compare as compare_runs

        options = {
            "contact-law": contact_law or [],
            "conductivity-law": conductivity_law or [],
            "solver": solver or [],
            "formulation": formulation or [],
            "fundamental-solution": fundamental_solution or [],
        }
        registry = _registry(plugin)
        with _progress() as progress:
            comparison = compare_runs(case, options, out, overwrite, registry, progress)
        _console().print(comparison_table(comparison))
        raise typer.Exit(CONVERGED if all(run.status == "converged" for run in comparison.runs) else NOT_CONVERGED)


@app.command()
def verify(
    case: CaseFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for numbers and picture.")] = Path("verified"),
    formulation: Choices = None,
    levels: Annotated[int, typer.Option(metavar="K", help="Meshes, from 3; the finest is the case's.")] = 3,
    factor: Annotated[float, typer.Option(metavar="X", help="Between the element sizes of two meshes.")] = 1.5,
    order: Annotated[float, typer.Option(metavar="P", help="Theoretical order of totals; 1 under sharp edges.")] = 2.0,
    every_step: Annotated[bool, typer.Option("--every-step", help="Compare at the end of every load step.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what DIR holds.")] = False,
    plugin: PluginFiles = None,
) -> None:
    """Run a case by several formulations on several meshes and tell whether they agree within their own errors.

    Without --formulation all that take the case. Writes verify.json and convergence.png. Exit status 0 if none
    disagree, 1 if some do or a run did not converge, 2 for bad input, 130 if interrupted.
    """
    with _exit_status(NOT_CONVERGED):
        from meeframe.report.verified import Verdict
        from meeframe.report.verify import verification_table
        from meeframe.study.verify import Meshes
        from meeframe.study.verify import verify as verify_case

        meshes = Meshes(levels, factor, order)
        with _progress() as progress:
            found = verify_case(
                case, out, formulation or (), meshes, every_step, overwrite, _registry(plugin), progress
            )
        _console().print(verification_table(found))
        passed = found.verdict in (Verdict.AGREE, Verdict.UNRESOLVED)
        raise typer.Exit(CONVERGED if passed else NOT_CONVERGED)


@app.command()
def reproduce(
    figures: Annotated[list[str], typer.Argument(metavar="FIGURE...", help="Names such as fig-05, or all.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the figures.")] = Path("reproduced"),
    validation: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the studies.")] = Path("validation"),
) -> None:
    """Solve the studies of figures of the reference paper; write FIGURE.png and FIGURE.json.

    Reduced systems are kept in DIR/cache and found there again. Exit status 0 if every run converged, 1 if not, 2 for
    bad input, 130 if interrupted.
    """
    with _exit_status(NOT_CONVERGED):
        from meeframe.study.reproduce import reproduce as reproduce_figures

        _registry(None)
        missed: list[str] = []
        with _progress() as progress:
            for study in reproduce_figures(figures, validation, out, progress):
                print(f"{study.name}: {out / study.name}.png, {study.title}")
                missed += [f"{study.name}: {run}: not converged" for run in study.not_converged]
        for line in missed:
            print(line)
        raise typer.Exit(NOT_CONVERGED if missed else CONVERGED)


@app.command()
def validate(
    quick: Annotated[bool, typer.Option("--quick", help="Coarser grids, in a minute or two.")] = False,
    only: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Run this case; repeatable.")] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for numbers and report.")] = Path("validated"),
    validation: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the cases.")] = Path("validation"),
) -> None:
    """Run published cases and compare; write validation.json and report.html, which works offline.

    Exit status 0 if every check passed, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with _exit_status(NOT_CONVERGED):
        from meeframe.report.validation_table import validation_table
        from meeframe.study.validate import validate as validate_cases

        _registry(None)
        with _progress() as progress:
            found = validate_cases(validation, out, only or (), quick, progress)
        _console().print(validation_table(found))
        print(f"report: {out / 'report.html'}")
        raise typer.Exit(CONVERGED if found.passed else NOT_CONVERGED)


@fclib_app.command("export")
def fclib_export(
    case: CaseFile,
    out: Annotated[Path, typer.Argument(metavar="OUT.hdf5", help="The file to write.")],
    increment: Annotated[int | None, typer.Option(metavar="K", help="From 1; the last one if not given.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file.")] = False,
    plugin: PluginFiles = None,
) -> None:
    """Run a case up to an increment and write its contact problem, with our solution if it converged.

    Exit status 0 if the increment converged, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with _exit_status(NOT_CONVERGED, f"{out} was not written"):
        from meeframe.case.load import load_case
        from meeframe.study.fclib import export_increment

        with _progress() as progress:
            step = export_increment(load_case(case, _registry(plugin)), out, increment, overwrite, progress)
        print(f"{out}: increment {step.increment} of load step {step.step}: {step.status}: {step.message}")
        raise typer.Exit(CONVERGED if step.status == "converged" else NOT_CONVERGED)


@fclib_app.command("solve")
def fclib_solve(
    file: Annotated[Path, typer.Argument(metavar="FILE.hdf5", help="A local problem of FCLIB.")],
    solver: Annotated[str, typer.Option(metavar="NAME", help="Name or inline table.")] = "auto",
    tolerance: Annotated[float, typer.Option(help="Of the residual.")] = 1e-10,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the solution that the file has.")] = False,
    plugin: PluginFiles = None,
) -> None:
    """Solve a problem and put the solution into its file; one that is there is compared, and stays.

    Exit status 0 if the solver converged, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with _exit_status(NOT_CONVERGED, f"{file} stays as it was"):
        from meeframe.study.fclib import solve_file

        solved = solve_file(file, solver, tolerance, overwrite, _registry(plugin))
        print(f"{file}: {solved.summary}")
        raise typer.Exit(CONVERGED if solved.status == "converged" else NOT_CONVERGED)


def _print_version(wanted: bool) -> None:
    if wanted:
        from meeframe import __version__

        print(f"meeframe {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


@contextmanager
def _exit_status(no_memory: int = BAD_INPUT, untouched: str = "") -> Iterator[None]:
    """Turns what a user can cause into a message and an exit status; a defect of meeframe keeps its traceback.

    no_memory: status if memory runs out; in reading and assembling it is bad input (CaseError) whatever this says;
    untouched: what to say of an interruption that carries no note, as it came before anything was written.
    """
    try:
        yield
    except MeeframeError as error:
        print(f"error: {error}", file=sys.stderr)
        raise typer.Exit(BAD_INPUT) from None
    except MemoryError as error:
        print(f"error: {_with_notes('not enough memory', error, untouched)}", file=sys.stderr)
        raise typer.Exit(no_memory) from None
    except KeyboardInterrupt as error:
        print(_with_notes("interrupted", error, untouched), file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


def _with_notes(what: str, error: BaseException, default: str) -> str:
    return "; ".join(filter(None, [what, *getattr(error, "__notes__", (default,))]))


def _console() -> Console:
    """Standard output; as wide as the text wants where it is not a terminal."""
    return Console(width=None if sys.stdout.isatty() else 240)


def _registry(files: list[Path] | None) -> "Registry":
    """Everything registered, with plugins from files; warns of broken plugins."""
    from meeframe.plugin.registry import load

    registry = load(*(files or ()))
    for broken in registry.broken:
        print(f"warning: {broken}", file=sys.stderr)
    return registry


@contextmanager
def _progress() -> "Iterator[Progress]":
    """A bar for each stage on the terminal, one after the other."""
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:22}"), BarColumn(), TimeElapsedColumn())
    tasks: dict[str, TaskID] = {}
    bars = Progress(*columns, console=Console(stderr=True), transient=False)
    with ExitStack() as started:

        def show(stage: str, fraction: float) -> None:
            if stage not in tasks:
                if not tasks:  # bars that have nothing to show leave an empty line
                    started.enter_context(bars)
                for task in tasks.values():  # whatever came before is done
                    bars.update(task, completed=1.0)
                tasks[stage] = bars.add_task(stage, total=1.0)
            bars.update(tasks[stage], completed=fraction)

        yield show
        for task in tasks.values():
            bars.update(task, completed=1.0)
