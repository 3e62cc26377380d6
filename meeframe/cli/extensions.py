"""Commands on plugins: plugins, plugins show and new-plugin."""

from pathlib import Path
from typing import Annotated, Final

import typer

from meeframe.cli import console
from meeframe.cli.app import PluginFiles, app

plugins_app = typer.Typer()
app.add_typer(plugins_app, name="plugins")
_KINDS: Final = "contact-law, conductivity-law, indenter, solver, element, formulation or fundamental-solution."


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
