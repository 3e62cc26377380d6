"""Commands on many cases: compare, verify, sweep, reproduce and validate."""

from pathlib import Path
from typing import Annotated

import typer

from meeframe.cli import console
from meeframe.cli.app import CaseFile, Choices, PictureFormat, PluginFiles, Threads, app


@app.command()
def compare(
    case: CaseFile,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for table and figure; created if it does not exist.")
    ],
    contact_law: Choices = None,
    conductivity_law: Choices = None,
    wear_law: Choices = None,
    solver: Choices = None,
    formulation: Choices = None,
    fundamental_solution: Choices = None,
    step: Annotated[
        str | None,
        typer.Option(
            metavar="STEP",
            help="Increment to compare: load step such as 2, increment such as 2.5, 'last' or 'peak'. By default "
            "the last one, or that of the peak load if nothing touches at the end.",
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", metavar="", help="Replace earlier results in DIR.")] = False,
    format: PictureFormat = "png",
    threads: Threads = None,
    plugin: PluginFiles = None,
) -> None:
    """Run a case with all combinations of laws, solvers and formulations; write compare.json and a figure.

    Each option takes a name or an inline table as in a case file and can be repeated. A name takes its parameters from
    the case file where they apply. The exit status is 0 if every run converged, 1 if not, 2 for invalid input and 130
    if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED):
        from meeframe.model.threads import limited
        from meeframe.study.compare import compare as compare_runs
        from meeframe.study.reports.compare import comparison_table

        options = {
            "contact-law": contact_law or [],
            "conductivity-law": conductivity_law or [],
            "wear-law": wear_law or [],
            "solver": solver or [],
            "formulation": formulation or [],
            "fundamental-solution": fundamental_solution or [],
        }
        registry = console.registry(plugin)
        with limited(threads), console.progress() as progress:
            comparison = compare_runs(case, options, out, overwrite, registry, progress, console.warn, step, format)
        console.stdout().print(comparison_table(comparison))
        raise typer.Exit(
            console.CONVERGED if all(run.status == "converged" for run in comparison.runs) else console.NOT_CONVERGED
        )


@app.command()
def verify(
    case: CaseFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for numbers and figure.")] = Path("verified"),
    formulation: Choices = None,
    levels: Annotated[
        int, typer.Option(metavar="K", help="Number of meshes, at least 3; the finest is that of the case.")
    ] = 3,
    factor: Annotated[float, typer.Option(metavar="X", help="Ratio of the element sizes of successive meshes.")] = 1.5,
    order: Annotated[
        float, typer.Option(metavar="P", help="Theoretical order of totals; 1 for indenters with sharp edges.")
    ] = 2.0,
    every_step: Annotated[
        bool, typer.Option("--every-step", metavar="", help="Compare at the end of every load step.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", metavar="", help="Replace earlier results in DIR.")] = False,
    format: PictureFormat = "png",
    threads: Threads = None,
    plugin: PluginFiles = None,
) -> None:
    """Run a case with several formulations on several meshes and test whether they agree within their errors.

    By default all formulations that accept the case are compared. The results are written to verify.json and
    convergence.png. The exit status is 0 if no two formulations disagree, 1 if some do or if a run does not converge, 2
    for invalid input and 130 if interrupted.
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
            verification = verify_case(
                case,
                out,
                formulation or (),
                meshes,
                every_step,
                overwrite,
                registry,
                progress,
                warn=console.warn,
                suffix=format,
            )
        console.stdout().print(verification_table(verification))
        passed = verification.verdict in (Verdict.AGREE, Verdict.UNRESOLVED)
        raise typer.Exit(console.CONVERGED if passed else console.NOT_CONVERGED)


Workers = Annotated[
    int | None, typer.Option(metavar="N", help="Number of local processes; each point uses one thread.")
]
Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster to use instead of local processes.")
]


@app.command()
def sweep(
    study: Annotated[Path, typer.Argument(metavar="STUDY.toml", help="The study file (docs/howto/sweep.md).")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results; created if it does not exist.")],
    workers: Workers = None,
    scheduler: Scheduler = None,
    format: PictureFormat = "png",
    threads: Threads = None,
    overwrite: Annotated[
        bool,
        typer.Option("--overwrite", metavar="", help="Replace another sweep; points common to both are kept."),
    ] = False,
    systems: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of reduced systems that several sweeps share; by default one in --out."
        ),
    ] = None,
    plugin: PluginFiles = None,
) -> None:
    """Run a parameter study of a case over a grid or lists of values; write sweep.h5, sweep.png and all results.

    By default one process is started for each core. The same command continues a sweep that was interrupted. The exit
    status is 0 if every point converged, 1 if not, 2 for invalid input and 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED, f"nothing was computed; {out} is unchanged"):
        from meeframe.study.reports.sweep import sweep_table
        from meeframe.study.sweep.engine import pool_of
        from meeframe.study.sweep.run import sweep as run_sweep

        registry = console.registry(plugin)
        with console.progress() as progress, pool_of(workers, scheduler, plugin or (), threads) as pool:
            result = run_sweep(study, out, pool, overwrite, registry, progress, console.warn, systems, format)
        console.stdout().print(sweep_table(result))
        passed = bool((result.status == "converged").all())
        raise typer.Exit(console.CONVERGED if passed else console.NOT_CONVERGED)


@app.command()
def reproduce(
    figures: Annotated[list[str], typer.Argument(metavar="FIGURE...", help="Names such as fig-05, or all.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the figures.")] = Path("reproduced"),
    validation: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the studies.")] = Path("validation"),
    workers: Workers = None,
    scheduler: Scheduler = None,
    format: PictureFormat = "png",
    threads: Threads = None,
) -> None:
    """Reproduce figures of the reference paper; write FIGURE.png and FIGURE.json.

    By default the studies are solved in this process. Finished runs are stored in DIR/points and reduced systems in
    DIR/cache; later calls reuse them. The exit status is 0 if every run converged, 1 if not, 2 for invalid
    input and 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED):
        from meeframe.study.reproduce import reproduce as reproduce_figures
        from meeframe.study.sweep.engine import pool_of

        console.registry(None)
        failures: list[str] = []
        processes = 1 if workers is None and scheduler is None else workers
        with console.progress() as progress, pool_of(processes, scheduler, threads=threads) as pool:
            for study in reproduce_figures(figures, validation, out, progress, pool, format):
                print(f"{study.name}: {out / study.name}.{format}, {study.title}")
                failures += [f"{study.name}: {run}: not converged" for run in study.not_converged]
        for line in failures:
            print(line)
        raise typer.Exit(console.NOT_CONVERGED if failures else console.CONVERGED)


@app.command()
def validate(
    quick: Annotated[bool, typer.Option("--quick", metavar="", help="Use coarser grids; takes a few minutes.")] = False,
    only: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Run this case only; repeatable.")] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for numbers and report.")] = Path("validated"),
    validation: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the cases.")] = Path("validation"),
) -> None:
    """Compare results with published ones; write validation.json and report.html, which works offline.

    The exit status is 0 if every check passed, 1 if not, 2 for invalid input and 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED):
        from meeframe.study.reports.validation_table import validation_table
        from meeframe.study.validate import validate as validate_cases

        console.registry(None)
        with console.progress() as progress:
            result = validate_cases(validation, out, only or (), quick, progress)
        console.stdout().print(validation_table(result))
        print(f"report: {out / 'report.html'}")
        raise typer.Exit(console.CONVERGED if result.passed else console.NOT_CONVERGED)
