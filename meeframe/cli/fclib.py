"""Commands on FCLIB files: fclib export and fclib solve."""

from pathlib import Path
from typing import Annotated

import typer

from meeframe.cli import console
from meeframe.cli.app import CaseFile, PluginFiles, app

fclib_app = typer.Typer(no_args_is_help=True, help="Exchange contact problems with other solvers in FCLIB files.")
app.add_typer(fclib_app, name="fclib")


@fclib_app.command("export")
def fclib_export(
    case: CaseFile,
    out: Annotated[Path, typer.Argument(metavar="OUT.hdf5", help="The file to write.")],
    increment: Annotated[
        int | None, typer.Option(metavar="K", help="Increment, counted from 1; by default the last one.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", metavar="", help="Replace the file.")] = False,
    plugin: PluginFiles = None,
) -> None:
    """Run a case up to an increment and write its contact problem, with the solution if it converged.

    The exit status is 0 if the increment converged, 1 if not, 2 for invalid input and 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED, f"{out} was not written"):
        from meeframe.model.load import load_case
        from meeframe.study.fclib import export_increment

        with console.progress() as progress:
            step = export_increment(load_case(case, console.registry(plugin)), out, increment, overwrite, progress)
        print(f"{out}: increment {step.increment} of load step {step.step}: {step.status}: {step.message}")
        raise typer.Exit(console.CONVERGED if step.status == "converged" else console.NOT_CONVERGED)


@fclib_app.command("solve")
def fclib_solve(
    file: Annotated[Path, typer.Argument(metavar="FILE.hdf5", help="A local problem in FCLIB format.")],
    solver: Annotated[str, typer.Option(metavar="NAME", help="Name or inline table of the solver.")] = "auto",
    tolerance: Annotated[float, typer.Option(help="Tolerance of the residual.")] = 1e-10,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", metavar="", help="Replace the solution in the file.")
    ] = False,
    plugin: PluginFiles = None,
) -> None:
    """Solve a problem and store the solution in its file; an existing solution is compared and preserved.

    The exit status is 0 if the solver converged, 1 if not, 2 for invalid input and 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED, f"{file} is unchanged"):
        from meeframe.study.fclib import solve_file

        solved = solve_file(file, solver, tolerance, overwrite, console.registry(plugin))
        print(f"{file}: {solved.summary}")
        raise typer.Exit(console.CONVERGED if solved.status == "converged" else console.NOT_CONVERGED)
