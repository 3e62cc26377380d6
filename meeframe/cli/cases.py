"""Commands on one case: run, check and show."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from meeframe.cli import console
from meeframe.cli.app import CaseFile, PictureFormat, PluginFiles, Threads, app
from meeframe.common.literal import LiteralConsole, printable


@app.command()
def run(
    case: CaseFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results; created if it does not exist.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", metavar="", help="Replace earlier results in DIR.")] = False,
    threads: Threads = None,
    plugin: PluginFiles = None,
) -> None:
    """Solve a case and write result.h5, summary.json, fields.vtu and figures.

    The exit status is 0 if every step converged, 1 if not, 2 for invalid input and 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED, f"nothing was written to {out}"):
        with console.loading():
            from meeframe.model.threads import limited
            from meeframe.results.overview import overviews
            from meeframe.results.records import RunStatus
            from meeframe.results.summary import AT_BOUNDARY, summary_table
            from meeframe.study.run import run as run_case

            registry = console.registry(plugin)
        with limited(threads), console.progress() as progress:
            result = run_case(case, out, overwrite, progress, held=False, registry=registry)
        output = console.stdout()
        output.print(summary_table(result, width=output.width))
        if any(step.contact_at_zone_boundary for step in overviews(result)):
            console.warn(AT_BOUNDARY)
        raise typer.Exit(console.CONVERGED if result.status is RunStatus.CONVERGED else console.NOT_CONVERGED)


@app.command()
def check(case: CaseFile, plugin: PluginFiles = None) -> None:
    """Check a case file without running it."""
    with console.exit_status():
        with console.loading():
            from meeframe.common.errors import named_in
            from meeframe.mesh import find_contact_zone
            from meeframe.model.load import load_case

            loaded = load_case(case, console.registry(plugin))
            with named_in(str(case)):
                loaded.check_memory_of_run()
        steps = len(loaded.steps)
        nodes = len(find_contact_zone(loaded.mesh, loaded.zone).points)
        name = printable(loaded.material.name or "without a name")
        print(
            f"{case}: ok: material {name}, {loaded.mesh.n_elements} elements, "
            f"contact zone {loaded.zone} of {nodes} nodes, {steps} step{'s' * (steps > 1)}"
        )
        for warning in loaded.warnings:
            console.warn(warning)


@app.command()
def show(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, or of a study of a rough surface.")],
    step: Annotated[
        list[str] | None,
        typer.Option(
            metavar="STEP",
            help="Load step such as 2, increment such as 2.5, 'last' or 'peak'; repeatable. By default the ends of "
            "all load steps, or as many as fit, and the peak load.",
        ),
    ] = None,
    interior: Annotated[
        bool,
        typer.Option(
            "--interior", metavar="", help="Evaluate fields inside the body under the contact; write interior.vtu."
        ),
    ] = False,
    body: Annotated[
        Literal["first", "second"], typer.Option(metavar="BODY", help="'first' or 'second' of two, for --interior.")
    ] = "first",
    case: Annotated[
        Path | None,
        typer.Option(
            metavar="CASE.toml",
            help="The case of the run, for --interior; by default the text stored with the result, whose relative "
            "paths start in the current folder.",
        ),
    ] = None,
    format: PictureFormat = "png",
    threads: Threads = None,
    plugin: PluginFiles = None,
) -> None:
    """Print the summary of a run, or of a study of a rough surface, as a table.

    With --interior, the body of the case is reduced again, and the fields after an increment, by default that of the
    peak load, are evaluated in a box under the contact. Their largest values are printed, and so are the largest
    tension and shear on each interface of a layered body. All fields are written to interior.vtu in DIR, and a section
    through the middle of the contact is drawn in interior.png.
    """
    with console.exit_status():
        from meeframe.results.files import read_result
        from meeframe.results.output import RESULT_FILE
        from meeframe.results.summary import summary_table

        output = console.stdout()
        if not (folder / RESULT_FILE).exists() and _show_study(folder, bool(step or interior), output):
            return
        result = read_result(folder)
        output.print(summary_table(result, step or (), output.width))
        if not interior:
            return
        from meeframe.model.threads import limited
        from meeframe.results.figures import check_format, title_of, write_figure
        from meeframe.results.interfaces import interfaces_table
        from meeframe.results.interior import maxima_table, write_interior
        from meeframe.results.output import INTERIOR_FILE, INTERIOR_PICTURE
        from meeframe.results.selection import select
        from meeframe.study.interior import ReducedRun

        check_format(format)
        registry = console.registry(plugin)
        chosen = select(result, step[0] if step else None)
        with limited(threads), console.progress() as progress:
            reduced = ReducedRun.of(result, case, registry, progress)
            fields, interfaces = reduced.interior(step=chosen, body=body), reduced.interfaces(chosen, body)
        write_interior(folder / INTERIOR_FILE, fields)
        write_figure(fields.figure(title_of(result, chosen)), folder, INTERIOR_PICTURE, format)
        console.stdout().print(maxima_table(fields))
        if interfaces:
            console.stdout().print(interfaces_table(interfaces))
        print(f"fields: {folder / INTERIOR_FILE}, section: {folder / INTERIOR_PICTURE}.{format}")


def _show_study(folder: Path, has_options: bool, output: LiteralConsole) -> bool:
    """Print the table and the files of the study of a rough surface in a folder; return false if there is none."""
    from meeframe.common.errors import CaseError
    from meeframe.study.rough.files import DATASET_FILE, FILES, stored_table

    if not (folder / DATASET_FILE).is_file():
        return False
    if has_options:
        raise CaseError(f"{folder}: holds a study of a rough surface; allowed: --step and --interior for runs only")
    output.print(stored_table(folder))
    print(f"files: {', '.join(str(folder / name) for name in FILES if (folder / name).is_file())}")
    return True


@app.command()
def figures(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run.")],
    step: Annotated[
        str,
        typer.Option(
            metavar="STEP", help="Load step such as 2, increment such as 2.5, 'last', or 'peak' for the peak load."
        ),
    ] = "peak",
    format: PictureFormat = "png",
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the figures; that of the run if not given.")
    ] = None,
) -> None:
    """Draw the figures of an increment of a run again, optionally as vector graphics."""
    with console.exit_status():
        from meeframe.results.figures import write_figures
        from meeframe.results.files import read_result

        for path in write_figures(read_result(folder), out or folder, step, format):
            print(path)


@app.command()
def fields(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run.")],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the files; that of the run if not given.")
    ] = None,
) -> None:
    """Write fields.vtu of a run again, for ParaView, and for several load steps the series fields.pvd.

    A run writes them itself unless it was interrupted or its case file has `vtu = false`.
    """
    with console.exit_status():
        from meeframe.results.files import read_result
        from meeframe.results.vtk import write_fields

        for path in write_fields(read_result(folder), out or folder):
            print(path)
