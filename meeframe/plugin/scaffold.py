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
"""Of the example: the contact of the example of a formulation, for thin layers, is some four times as wide as that."""


def kind_called(text: str) -> Kind:
    """Return the kind that a command line calls contact-law. Raises PluginError that lists the kinds."""
    kinds = {kind.value.replace(" ", "-"): kind for kind in Kind}
    if text not in kinds:
        raise PluginError(f"unknown kind {text!r}; {choices(text, kinds)}")
    return kinds[text]


def new_plugin(kind: Kind, name: str, registry: Registry, folder: Path | None = None) -> Path:
    """Write a package that registers a new thing of a kind; returns its folder, by default meeframe-NAME here.

    name: as case files will write it, in small letters, digits and hyphens. The package works, and passes its own
    tests, as it is: it is to be changed into what is wanted.
    Raises PluginError if the name is taken or cannot be one, or if the folder holds anything or cannot be written.
    """
    templates = resources.files("meeframe.plugin") / "templates"
    own = templates / kind.value.replace(" ", "-")
    words = _words(kind, name)
    _check_name(kind, name, words["class_name"], registry, (own / "module.py.template").read_text(encoding="utf-8"))
    target = folder or Path(words["package"])
    try:
        if target.exists() and any(target.iterdir()):
            other = f"the folder to make, such as {folder / words['package']}" if folder else "another one to make"
            raise PluginError(f"folder {target} holds files; --out names {other}")
        (target / "tests").mkdir(parents=True, exist_ok=True)
        words["case"] = _filled(own / "case.toml.template", words).rstrip()
        for file, template in {
            "pyproject.toml": templates / "pyproject.toml.template",
            "README.md": templates / "README.md.template",
            "example.toml": templates / "example.toml.template",
            f"{words['module']}.py": own / "module.py.template",
            f"tests/test_{words['module']}.py": own / "test.py.template",
            f"tests/test_{words['module']}_example.py": templates / "test_example.py.template",
        }.items():
            (target / file).write_text(_filled(template, words), encoding="utf-8")
    except OSError as error:
        raise PluginError(f"folder {target} cannot be written: {error.strerror or error}") from None
    return target


def _words(kind: Kind, name: str) -> dict[str, str]:
    """Return what stands in the templates for what."""
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
        taken = next(entry for entry in registry.entries if entry.kind is kind and entry.record.name == name)
        raise PluginError(f"{kind} {name!r} is there already, provided by {taken.provider}; choose another name")
    if keyword.iskeyword(class_name) or re.search(rf"\b{class_name}\b", module):
        raise PluginError(f"name {name!r} would make a class {class_name}, a name that Python or meeframe uses")


def _filled(template: Traversable, words: dict[str, str]) -> str:
    return Template(template.read_text(encoding="utf-8")).substitute(words)
