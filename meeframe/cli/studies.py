"""Commands on many cases: compare, verify, sweep, reproduce, validate."""

from pathlib import Path
from typing import Annotated

import typer

from meeframe.cli import console
from meeframe.cli.app import CaseFile, Choices, PluginFiles, Threads, app


@app.command()
def compare(
    case: CaseFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for table and figure; made if it does not exist.")],
    contact_law: Choices = None,
    conductivity_law: Choices = None,
    solver: Choices = None,
    formulation: Choices = None,
    fundamental_solution: Choices = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", metavar="", help="Replace what DIR holds.")] = False,
    threads: Threads = None,
    plugin: PluginFiles = None,
) -> None:
    """Run a case with all combinations of laws, solvers and formulations; write compare.json and sections.png.

    Each option takes a name or an inline table as in a case file, and may be repeated; a name takes the keys of the
    case that fit it. Exit status 0 if every run converged, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED):
        from meeframe.model.threads import limited
        from meeframe.study.compare import compare as compare_runs
        from meeframe.study.reports.compare import comparison_table

        options = {
            "contact-law": contact_law or [],
            "conductivity-law": conductivity_law or [],
            "solver": solver or [],
            "formulation": formulation or [],
            "fundamental-solution": fundamental_solution or [],
        }
        registry = console.registry(plugin)
        with limited(threads), console.progress() as progress:
            comparison = compare_runs(case, options, out, overwrite, registry, progress, console.warn)
        console.stdout().print(comparison_table(comparison))
        raise typer.Exit(
            console.CONVERGED if all(run.status == "converged" for run in comparison.runs) else console.NOT_CONVERGED
        )


@app.command()
def verify(
    case: CaseFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for numbers and picture.")] = Path("verified"),
    formulation: Choices = None,
    levels: Annotated[int, typer.Option(metavar="K", help="Meshes, from 3; the finest is the case's.")] = 3,
    factor: Annotated[float, typer.Option(metavar="X", help="Between the element sizes of two meshes.")] = 1.5,
    order: Annotated[float, typer.Option(metavar="P", help="Theoretical order of totals; 1 under sharp edges.")] = 2.0,
    every_step: Annotated[
        bool, typer.Option("--every-step", metavar="", help="Compare at the end of every load step.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", metavar="", help="Replace what DIR holds.")] = False,
    threads: Threads = None,
    plugin: PluginFiles = None,
) -> None:
    """Run a case by several formulations on several meshes and tell whether they agree within their own errors.

    Without --formulation all that take the case. Writes verify.json and convergence.png. Exit status 0 if none
    disagree, 1 if some do or a run did not converge, 2 for bad input, 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED):
        from meeframe.model.threads import limited
        from meeframe.study.reports.verified import Verdict
        from meeframe.study.reports.verify import verification_table
        from meeframe.study.verify import Meshes
        from meeframe.study.verify import verify as verify_case

        meshes = Meshes(levels, factor, order)
        with limited(threads), console.progress() as progress:
            registry = console.registry(plugin)
            found = verify_case(
                case, out, formulation or (), meshes, every_step, overwrite, registry, progress, warn=console.warn
            )
        console.stdout().print(verification_table(found))
        passed = found.verdict in (Verdict.AGREE, Verdict.UNRESOLVED)
        raise typer.Exit(console.CONVERGED if passed else console.NOT_CONVERGED)


Workers = Annotated[int | None, typer.Option(metavar="N", help="Local processes, of one thread for each point.")]
Scheduler = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Of a Dask cluster to use instead.")]


@app.command()
def sweep(
    study: Annotated[Path, typer.Argument(metavar="STUDY.toml", help="The study file (docs/sweep.md).")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results; made if it does not exist.")],
    workers: Workers = None,
    scheduler: Scheduler = None,
    threads: Threads = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", metavar="", help="Replace another sweep; equal points stay.")
    ] = False,
    plugin: PluginFiles = None,
) -> None:
    """Run a case with keys changed: a grid or lists; write sweep.h5, sweep.png and each point's result.

    By default one process for each core. The same command goes on where an earlier one ended, however it did. Exit
    status 0 if every point converged, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED, f"nothing was computed; {out} stays as it was"):
        from meeframe.study.reports.sweep import sweep_table
        from meeframe.study.sweep.engine import pool_of
        from meeframe.study.sweep.run import sweep as run_sweep

        registry = console.registry(plugin)
        with console.progress() as progress, pool_of(workers, scheduler, plugin or (), threads) as pool:
            found = run_sweep(study, out, pool, overwrite, registry, progress, console.warn)
        console.stdout().print(sweep_table(found))
        passed = bool((found.status == "converged").all())
        raise typer.Exit(console.CONVERGED if passed else console.NOT_CONVERGED)


@app.command()
def reproduce(
    figures: Annotated[list[str], typer.Argument(metavar="FIGURE...", help="Names such as fig-05, or all.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the figures.")] = Path("reproduced"),
    validation: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the studies.")] = Path("validation"),
    workers: Workers = None,
    scheduler: Scheduler = None,
    threads: Threads = None,
) -> None:
    """Solve the studies of figures of the reference paper; write FIGURE.png and FIGURE.json.

    By default in this process. Finished runs are kept in DIR/points and reduced systems in DIR/cache, and found there
    again. Exit status 0 if every run converged, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED):
        from meeframe.study.reproduce import reproduce as reproduce_figures
        from meeframe.study.sweep.engine import pool_of

        console.registry(None)
        missed: list[str] = []
        here = 1 if workers is None and scheduler is None else workers
        with console.progress() as progress, pool_of(here, scheduler, threads=threads) as pool:
            for study in reproduce_figures(figures, validation, out, progress, pool):
                print(f"{study.name}: {out / study.name}.png, {study.title}")
                missed += [f"{study.name}: {run}: not converged" for run in study.not_converged]
        for line in missed:
            print(line)
        raise typer.Exit(console.NOT_CONVERGED if missed else console.CONVERGED)


@app.command()
def validate(
    quick: Annotated[bool, typer.Option("--quick", metavar="", help="Coarser grids, in a few minutes.")] = False,
    only: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Run this case; repeatable.")] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for numbers and report.")] = Path("validated"),
    validation: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the cases.")] = Path("validation"),
) -> None:
    """Run published cases and compare; write validation.json and report.html, which works offline.

    Exit status 0 if every check passed, 1 if not, 2 for bad input, 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED):
        from meeframe.study.reports.validation_table import validation_table
        from meeframe.study.validate import validate as validate_cases

        console.registry(None)
        with console.progress() as progress:
            found = validate_cases(validation, out, only or (), quick, progress)
        console.stdout().print(validation_table(found))
        print(f"report: {out / 'report.html'}")
        raise typer.Exit(console.CONVERGED if found.passed else console.NOT_CONVERGED)
