"""Hook of the documentation site (mkdocs.yml) that writes the pages of reference/api from the public names.

Each public object is shown once, on the page of the package that defines it. The pages of `meeframe`,
`meeframe.plugin` and `meeframe.testing` also list the names that these packages export.
"""

from collections.abc import Iterable, Iterator
from importlib import import_module
from logging import getLogger
from typing import Final

import griffe
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

Api = griffe.Object | griffe.Alias
LOG: Final = getLogger("mkdocs.api_pages")
PACKAGES: Final = {
    "meeframe": "Cases, steps, runs and results, by their short names.",
    "plugin": "Everything that a plugin may import.",
    "testing": "Conformance checks for plugins, and closed forms for numerical tests.",
    "model": "Cases: load them, change them, solve them.",
    "results": "Results: records, files, figures.",
    "study": "Runs, sweeps, comparisons, verification and validation.",
    "fields": "Field sets, scaling and units.",
    "material": "Materials, rotation and the library.",
    "mesh": "Surface meshes, bodies and contact zones.",
    "elements": "Surface elements and quadrature.",
    "greens": "Fundamental solutions.",
    "system": "Reduced systems and their capabilities.",
    "formulations": "Formulations, from a body to a reduced system.",
    "indenters": "Rigid indenters.",
    "laws": "Contact, conductivity and wear laws.",
    "contact": "Contact problems, residuals and conduction.",
    "solvers": "Contact solvers and the driver loop.",
}
PLUGINS: Final = ("meeframe_laws", "meeframe_halfspace", "meeframe_hmatrix", "meeframe_skfem")
"""Packages of the folder `plugins`, of which the exported and the registered classes are shown."""

EXPORTING: Final = (*PACKAGES, "plugin.surfaces", "plugin.boundary_elements")
MODULES: Final = (
    "common.errors",
    "model.load",
    "model.solve",
    "model.second_body",
    "results.result",
    "results.plots",
    "results.files",
    "results.records",
    "results.schema",
    "results.summary",
    "results.figures",
    "results.vtk",
    "results.fclib",
    "study.verify",
    "study.compare",
    "study.validate",
    "study.reproduce",
    "study.sweep.run",
    "study.reports.validation",
    "study.reports.verified",
    "formulations.base",
    "formulations.dense_bem",
    "indenters.base",
    "plugin.hookspecs",
    "testing.law_properties",
    "testing.closed_forms",
    "testing.closed_forms_friction",
    "testing.closed_forms_adhesion",
    "testing.elastic_half_space",
    "testing.half_space",
    "testing.manufactured",
)
"""Modules that are shown whole, beside the exported names."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages."""
    root = griffe.load("meeframe", search_paths=[str(config.docs_dir) + "/.."], resolve_aliases=True)
    shown = {target.path: target for target in _public(root)}
    for path, target in shown.items():
        if target.docstring is None:
            LOG.warning("%s has no docstring (%s)", path, target.filepath)
    pages: dict[str, list[str]] = {package: [] for package in PACKAGES}
    for path in shown:
        home = path.split(".")[1]
        pages[home if home in pages else "meeframe"].append(path)
    for package, paths in pages.items():
        text = "\n".join(_page(root, package, paths))
        files.append(File.generated(config, f"reference/api/{package}.md", content=text))
    files.append(File.generated(config, "reference/api/plugins.md", content="\n".join(_plugin_page(config))))
    rows = (f"| [`{_name(package)}`]({package}.md) | {summary} |" for package, summary in PACKAGES.items())
    text = "\n".join([INDEX, "| package | content |", "| --- | --- |", *rows, PLUGINS_ROW, ""])
    files.append(File.generated(config, "reference/api/index.md", content=text))
    return files


INDEX: Final = """# Python API

These pages are generated from the docstrings. Plugins import [`meeframe.plugin`](plugin.md) only, and their tests also
[`meeframe.testing`](testing.md); names of other packages may change between versions. Units, signs and index
conventions are those of [theory and conventions](../../explanation/theory.md).
"""


PLUGINS_ROW: Final = "| [`meeframe_laws` and others](plugins.md) | The packages of the folder `plugins`. |"


def _name(package: str) -> str:
    return package if package == "meeframe" else f"meeframe.{package}"


def _exported(package: str) -> list[str]:
    module = import_module(_name(package))
    return [name for name in getattr(module, "__all__", ()) if not name.startswith("__")]


def _target(root: Api, path: str) -> Api:
    found: Api = root[path]
    return found.final_target if isinstance(found, griffe.Alias) else found


def _docstring(target: Api) -> str:
    return target.docstring.value if target.docstring else ""


def _public(root: Api) -> Iterator[Api]:
    """Yield all public objects."""
    for package in EXPORTING:
        prefix = "" if package == "meeframe" else f"{package}."
        yield from (_target(root, prefix + name) for name in _exported(package))
    for path in MODULES:
        for name, member in root[path].members.items():
            if name.startswith("_") or (member.is_alias and name not in (root[path].exports or ())):
                continue
            found = member.final_target if member.is_alias else member
            if found.docstring and not found.is_module:
                yield found


def _page(root: Api, package: str, paths: Iterable[str]) -> Iterator[str]:
    """Yield the lines of the page of a package."""
    module = root if package == "meeframe" else root[package]
    yield f"# `{_name(package)}`\n"
    yield f"{_docstring(module)}\n"
    if package in ("meeframe", "plugin", "testing"):
        yield f"## Names in `{_name(package)}`\n\n| name | content |\n| --- | --- |"
        for name in sorted(_exported(package), key=str.lower):
            target = _target(root, name if package == "meeframe" else f"{package}.{name}")
            summary = _docstring(target).split("\n\n")[0].replace("\n", " ").replace("|", "\\|")
            yield f"| [`{name}`][{target.path}] | {summary} |"
        yield ""
    previous = None
    for path in sorted(paths, key=lambda path: (_module_of(root, path), path.lower())):
        home = _module_of(root, path)
        if home != previous:
            yield f"## Module `{home}`\n"
            previous = home
        yield f"::: {path}\n    options:\n      heading_level: 3\n"


def _module_of(root: Api, path: str) -> str:
    return str(root[path.removeprefix("meeframe.")].module.path)


def _plugin_page(config: MkDocsConfig) -> Iterator[str]:
    """Yield the lines of the page of the plugin packages."""
    yield "# Plugin packages\n\nThe names in case files are those of `meeframe plugins`.\n"
    for package in PLUGINS:
        module = import_module(package)
        exported = [getattr(module, name) for name in module.__all__ if not name.startswith("meeframe_")]
        hooks = [
            getattr(module, name) for name in dir(module) if name.startswith("meeframe_") and name in module.__all__
        ]
        registered = [record.factory for hook in hooks for record in hook()]
        # what a plugin exports of meeframe is on the page of the package that defines it
        defined = [found for found in exported + registered if found.__module__.split(".")[0] == package]
        paths = {f"{found.__module__}.{found.__qualname__}" for found in defined}
        yield f"## `{package}`\n\n{module.__doc__}\n"
        yield from (f"::: {path}\n    options:\n      heading_level: 3\n" for path in sorted(paths))
