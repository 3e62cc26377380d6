"""Commands on plugins: plugins, plugins show, plugins check and new-plugin."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from meeframe.cli import console
from meeframe.cli.app import PluginFiles, app

plugins_app = typer.Typer()
app.add_typer(plugins_app, name="plugins")
_KINDS: Final = (
    "contact-law, conductivity-law, wear-law, indenter, solver, element, formulation or fundamental-solution."
)


@plugins_app.callback(invoke_without_command=True)
def plugins(
    context: typer.Context,
    kind: Annotated[str | None, typer.Option(metavar="KIND", help=f"List one kind only: {_KINDS}")] = None,
    plugin: PluginFiles = None,
) -> None:
    """List everything that case files can name; `plugins show NAME` describes one entry and its provider."""
    if context.invoked_subcommand is not None:
        context.obj = plugin
        return
    with console.exit_status():
        from meeframe.plugin.listing import plugin_list
        from meeframe.plugin.registry import Kind
        from meeframe.plugin.scaffold import parse_kind

        kinds = tuple(Kind) if kind is None else (parse_kind(kind),)
        console.stdout().print(plugin_list(console.registry(plugin), kinds))


@plugins_app.command("show")
def show_plugin(
    context: typer.Context,
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name as written in case files.")],
    plugin: PluginFiles = None,
) -> None:
    """Print the parameters of an entry with units, bounds and defaults, its formula and its source."""
    with console.exit_status():
        from meeframe.plugin.listing import plugin_page

        console.stdout().print(plugin_page(console.registry([*(context.obj or ()), *(plugin or ())]), name))


@plugins_app.command("check")
def check_plugin(
    file: Annotated[Path, typer.Argument(metavar="FILE.py", help="The plugin file.")],
    values: Annotated[
        list[str] | None,
        typer.Option("--with", metavar="TABLE", help="Inline table with name and keys of an object; repeatable."),
    ] = None,
    pressure: Annotated[float, typer.Option(metavar="PA", help="Typical pressure of laws in pascal.")] = 1e6,
    gap: Annotated[float, typer.Option(metavar="M", help="Typical gap of laws in metres.")] = 1e-6,
    frictionless: Annotated[
        bool, typer.Option("--frictionless", metavar="", help="Check solvers on frictionless problems only.")
    ] = False,
) -> None:
    """Check that everything that a plugin file registers conforms to its contract.

    Keys without a default get a sample value; --with sets them, such as --with '{name = "my-law", mu = 0.2}'. The exit
    status is 0 if everything conforms, 1 if not, and 2 for invalid input.
    """
    with console.exit_status():
        try:
            from meeframe.testing.plugin_files import Magnitudes, check_entries
        except ImportError as error:
            from meeframe.common.errors import PluginError

            needed = f"the conformance checks need {error.name}; install the extra: pip install 'meeframe[testing]'"
            raise PluginError(needed) from None
        registry, conforms = console.registry([file]), True
        tables = _tables_by_name(
            values or (), {e.record.name for e in registry.entries if e.provider.name == str(file)}
        )
        magnitudes = Magnitudes(pressure, gap, friction=not frictionless)
        for checked in check_entries(registry, str(file), tables, magnitudes):
            conforms &= not checked.failure
            keys = ", ".join(f"{key} = {value}" for key, value in checked.parameters.items())
            outcome = f"fails: {checked.failure}" if checked.failure else "conforms"
            print(f"{checked.kind} {checked.name}{f' ({keys})' * bool(keys)}: {outcome}")
        raise typer.Exit(console.CONVERGED if conforms else console.NOT_CONVERGED)


def _tables_by_name(texts: Sequence[str], names: Collection[str]) -> dict[str, Mapping[str, Any]]:
    """Return inline tables by the name in each; raise CaseError unless it is one of these names."""
    from meeframe.common.errors import CaseError
    from meeframe.study.choices import Choice

    tables: dict[str, Mapping[str, Any]] = {}
    for text in texts:
        table = Choice.read("with", text).value
        if isinstance(table, str) or table.get("name") not in names:
            raise CaseError(f"--with {text}: needs an inline table whose name is one of {', '.join(sorted(names))}")
        tables[table["name"]] = table
    return tables


@app.command("new-plugin")
def new_plugin(
    kind: Annotated[str, typer.Argument(metavar="KIND", help=_KINDS)],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name for use in case files, such as my-law.")],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the package; meeframe-NAME by default.")
    ] = None,
) -> None:
    """Write an installable plugin package with a conformance test, a case file and a README."""
    with console.exit_status():
        from meeframe.plugin.scaffold import new_plugin as write_plugin
        from meeframe.plugin.scaffold import parse_kind

        folder = write_plugin(parse_kind(kind), name, console.registry(None), out)
        print(f"{folder}: {', '.join(sorted(str(p.relative_to(folder)) for p in folder.rglob('*') if p.is_file()))}")
