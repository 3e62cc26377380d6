"""Commands on the material library: materials and materials show."""

from typing import Annotated

import typer

from meeframe.cli import console
from meeframe.cli.app import app

materials_app = typer.Typer()
app.add_typer(materials_app, name="materials")


@materials_app.callback(invoke_without_command=True)
def materials(context: typer.Context) -> None:
    """List the material library; `materials show NAME` prints the constants of one material."""
    if context.invoked_subcommand is not None:
        return
    with console.exit_status():
        from meeframe.material.listing import material_list

        console.stdout().print(material_list())


@materials_app.command("show")
def show_material(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name as written in case files.")],
) -> None:
    """Print the constants of a material with units, its source and how reliable they are."""
    with console.exit_status():
        from meeframe.material.listing import material_page

        console.stdout().print(material_page(name))
