"""Commands on files of FCLIB: fclib export, fclib solve."""

from pathlib import Path
from typing import Annotated

import typer

from meeframe.cli import console
from meeframe.cli.app import CaseFile, PluginFiles, app

fclib_app = typer.Typer(no_args_is_help=True, help="Exchange contact problems with other solvers in files of FCLIB.")
app.add_typer(fclib_app, name="fclib")


@fclib_app.command("export")
def fclib_export(
    case: CaseFile,
    out: Annotated[Path, typer.Argument(metavar="OUT.hdf5", help="The file to write.")],
    increment: Annotated[int | None, typer.Option(metavar="K", help="From 1; the last one if not given.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", metavar="", help="Replace the file.")] = False,
    plugin: PluginFiles = None,
) -> None:
    """Run a case up to an increment and write its contact problem, with our solution if it converged.

    Exit status 0 if the increment converged, 1 if not, 2 for bad input, 130 if interrupted.
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
    file: Annotated[Path, typer.Argument(metavar="FILE.hdf5", help="A local problem of FCLIB.")],
    solver: Annotated[str, typer.Option(metavar="NAME", help="Name or inline table.")] = "auto",
    tolerance: Annotated[float, typer.Option(help="Of the residual.")] = 1e-10,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", metavar="", help="Replace the solution that the file has.")
    ] = False,
    plugin: PluginFiles = None,
) -> None:
    """Solve a problem and put the solution into its file; one that is there is compared, and stays.

    Exit status 0 if the solver converged, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED, f"{file} stays as it was"):
        from meeframe.study.fclib import solve_file

        solved = solve_file(file, solver, tolerance, overwrite, console.registry(plugin))
        print(f"{file}: {solved.summary}")
        raise typer.Exit(console.CONVERGED if solved.status == "converged" else console.NOT_CONVERGED)
