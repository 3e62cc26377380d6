"""New plugins from templates: an installable package with its conformance test, a case and a README."""

import keyword
import re
from importlib import metadata, resources
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template
from typing import Final

from meeframe.common.errors import PluginError
from meeframe.plugin.faults import NAME, NAME_RULE
from meeframe.plugin.hookspecs import PROJECT
from meeframe.plugin.registry import Kind, Registry
from meeframe.plugin.validation import choices

_HALF_SPACE: Final = {"approach": "20 um", "translation": "4 um"}
_LAYER: Final = {"approach": "1 um", "translation": "0.2 um"}
"""Motions of the example of a formulation, where the contact is about four times as wide as for a half space."""


def parse_kind(text: str) -> Kind:
    """Return the kind for its name on the command line, such as contact-law.

    Raises PluginError that lists the kinds.
    """
    kinds = {kind.value.replace(" ", "-"): kind for kind in Kind}
    if text not in kinds:
        raise PluginError(f"unknown kind {text!r}; {choices(text, kinds)}")
    return kinds[text]


def new_plugin(kind: Kind, name: str, registry: Registry, folder: Path | None = None) -> Path:
    """Write a package that registers a new object of a kind.

    The package works and passes its tests as it is; it is a starting point for changes.

    Parameters
    ----------
    kind
        Kind of the object.
    name
        Name in case files, in lower-case letters, digits and hyphens.
    registry
        Registry of plugins, whose names are taken.
    folder
        Folder of the package; by default meeframe-NAME in the working folder.

    Returns
    -------
    Path
        Folder of the package.

    Raises
    ------
    PluginError
        If the name is taken or invalid, or if the folder is not empty or cannot be written.
    """
    templates = resources.files("meeframe.plugin") / "templates"
    templates_of_kind = templates / kind.value.replace(" ", "-")
    substitutions = _substitutions(kind, name)
    _check_name(
        kind,
        name,
        substitutions["class_name"],
        registry,
        (templates_of_kind / "module.py.template").read_text(encoding="utf-8"),
    )
    target = folder or Path(substitutions["package"])
    try:
        if target.exists() and any(target.iterdir()):
            example = f", such as {folder / substitutions['package']}" if folder else ""
            raise PluginError(f"folder {target} is not empty; name another one with --out{example}")
        (target / "tests").mkdir(parents=True, exist_ok=True)
        substitutions["case"] = _fill(templates_of_kind / "case.toml.template", substitutions).rstrip()
        for file, template in {
            "pyproject.toml": templates / "pyproject.toml.template",
            "README.md": templates / "README.md.template",
            "example.toml": templates / "example.toml.template",
            f"{substitutions['module']}.py": templates_of_kind / "module.py.template",
            f"tests/test_{substitutions['module']}.py": templates_of_kind / "test.py.template",
            f"tests/test_{substitutions['module']}_example.py": templates / "test_example.py.template",
        }.items():
            (target / file).write_text(_fill(template, substitutions), encoding="utf-8")
    except OSError as error:
        raise PluginError(f"folder {target} cannot be written: {error.strerror or error}") from None
    return target


def _substitutions(kind: Kind, name: str) -> dict[str, str]:
    """Return the substitutions for the templates."""
    return {
        "kind": kind.value,
        "name": name,
        "class_name": "".join(part.capitalize() for part in name.split("-")),
        "package": f"{PROJECT}-{name}",
        "module": f"{PROJECT}_{name.replace('-', '_')}",
        "solver": name if kind is Kind.SOLVER else "uzawa-bb",
        "version": metadata.version(PROJECT),
        **(_LAYER if kind is Kind.FORMULATION else _HALF_SPACE),
    }


def _check_name(kind: Kind, name: str, class_name: str, registry: Registry, module: str) -> None:
    if not NAME.fullmatch(name):
        raise PluginError(f"name {name!r}: allowed: {NAME_RULE}")
    if name in registry.names(kind):
        existing = next(entry for entry in registry.entries if entry.kind is kind and entry.record.name == name)
        raise PluginError(f"{kind} {name!r} already exists, provided by {existing.provider}; choose another name")
    if keyword.iskeyword(class_name) or re.search(rf"\b{class_name}\b", module):
        raise PluginError(f"name {name!r} needs a class {class_name}, a name that Python or meeframe uses")


def _fill(template: Traversable, substitutions: dict[str, str]) -> str:
    return Template(template.read_text(encoding="utf-8")).substitute(substitutions)
