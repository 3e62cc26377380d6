"""Cache of reduced systems by content: the same input and the same code are not computed twice."""

import dataclasses
import hashlib
import inspect
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import numpy as np

from meeframe.formulations.base import Formulation, PersistentFormulation, stored_arrays
from meeframe.mesh.body import Body
from meeframe.model.case import Case
from meeframe.model.solve import bodies_of, joined, recovery_of, reduce_for_contact
from meeframe.model.systems import checked
from meeframe.plugin.sources import LOCAL, faults_of_plugins
from meeframe.results.systems import create_folder, read_arrays, read_system, write_arrays, write_system
from meeframe.system.reduced import Progress, ReducedSystem, silent

_ROOMS: Final = ("common", "elements", "fields", "formulations", "greens", "material", "mesh", "model", "system")
_CONTACT_ROOMS: Final = ("contact", "indenters", "laws", "solvers")
_NOTES: Final = ("title", "text", "output")
"""Fields of a case that do not affect its result."""
_LIBRARIES: Final = ("numpy", "scipy", "numba")


def cached_reduce(case: Case, folder: Path, progress: Progress = silent) -> ReducedSystem:
    """Return the reduced system of a case, from files in `folder` if possible; otherwise compute and store it.

    There is a file for each body, found by `system_key`; a damaged one is replaced. A system from a file is
    identical bit for bit; `recover` reduces the body again when it is first called. Systems without a matrix or
    `Persistence` are computed each time. Raises the errors of meeframe.model.solve.reduce, and ResultError if the
    folder cannot be written.
    """
    return joined(case, (cached_body(*body, folder, progress) for body in bodies_of(case)))


def cached_body(
    formulation: Formulation, body: Body, folder: Path, progress: Progress = silent, key: str = ""
) -> ReducedSystem:
    """Return the reduced system of one body, like cached_reduce; key: its system_key, if already known."""
    key = key or system_key(formulation, body)
    path = folder / f"{key}.h5"
    result = read_system(path, key, recovery_of(formulation, body, progress))
    if result is not None:
        return result
    stored = read_arrays(path, key)
    if stored is not None and isinstance(formulation, PersistentFormulation):
        with suppress(ValueError), faults_of_plugins(ValueError):  # not arrays of this formulation
            return checked(formulation, formulation.from_arrays(body, stored), body.fields.size)
    system = reduce_for_contact(formulation, body, progress)
    with faults_of_plugins():
        matrix, arrays = system.dense(), stored_arrays(formulation, system)
    if matrix is not None or arrays is not None:
        create_folder(folder)
        if matrix is not None:
            write_system(path, key, system, matrix)
        elif arrays is not None:
            write_arrays(path, key, arrays)
    return system


def system_key(formulation: Formulation, body: Body) -> str:
    """Return the SHA-256 of everything that determines the reduced system of a body, hexadecimal.

    This covers formulation and body by their content, their classes, the sources of meeframe (and of plugins) that
    compute with them, and the versions of the numerical libraries.
    """
    return _digest(_sources(_ROOMS), (formulation, body))


def distinct_bodies(cases: Iterable[Case]) -> dict[str, tuple[Formulation, Body]]:
    """Return the distinct bodies of all cases, each with its formulation, by their system_key."""
    return {system_key(*body): body for case in cases for body in bodies_of(case)}


def case_key(case: Case) -> str:
    """Return the SHA-256 of everything that determines the result of a case, hexadecimal.

    It extends system_key by the parts of the case that are used after the reduction.
    """
    names = (field.name for field in dataclasses.fields(case) if field.name not in _NOTES)
    return _digest(_sources(_ROOMS + _CONTACT_ROOMS), {name: getattr(case, name) for name in names})


def code_key(value: Any) -> str:
    """Return the SHA-256 of the code alone that computes with a value, hexadecimal.

    Where it agrees, so do all results for the same value. It covers the classes that make up the value, and the sources
    and versions that case_key includes, but not the content of the value.
    """
    digest = hashlib.sha256(_sources(_ROOMS + _CONTACT_ROOMS))
    for content in sorted({_class_content(owner) for owner in _classes(value)}):
        digest.update(content)
    return digest.hexdigest()


def _classes(value: Any) -> Iterator[type]:
    """Yield the dataclasses that make up a value, at any depth."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield type(value)
        value = [getattr(value, field.name) for field in dataclasses.fields(value)]
    if isinstance(value, Mapping):
        value = list(value.values())
    for item in value if isinstance(value, list | tuple) else ():
        yield from _classes(item)


def _digest(sources: bytes, value: Any) -> str:
    digest = hashlib.sha256(sources)
    for piece in _content(value):
        digest.update(len(piece).to_bytes(8) + piece)  # the length separates adjacent pieces
    return digest.hexdigest()


def _content(value: Any) -> Iterator[bytes]:
    """Yield the value as a sequence of bytes that differs for different values."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield _class_content(type(value))
        yield from _content({field.name: getattr(value, field.name) for field in dataclasses.fields(value)})
    elif isinstance(value, Mapping):
        yield f"mapping {len(value)}".encode()
        for key, item in value.items():
            yield from _content(key)
            yield from _content(item)
    elif isinstance(value, list | tuple):
        yield f"sequence {len(value)}".encode()
        for item in value:
            yield from _content(item)
    elif isinstance(value, np.ndarray):
        yield f"array {value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, Path) and value.is_file():
        yield b"file"
        yield value.read_bytes()
    else:  # None, numbers, texts, members of an enumeration: their representation is exact
        yield f"{type(value).__qualname__} {value!r}".encode()


@lru_cache
def _class_content(owner: type) -> bytes:
    """Return the name of a class and, for classes outside meeframe, the source of its package.

    Results then depend on that source. Names of modules of local files contain their hash already; the files may be on
    another machine.
    """
    name = f"{owner.__module__}.{owner.__qualname__}".encode()
    if owner.__module__.startswith(("meeframe.", LOCAL)):
        return name
    top = Path(str(getattr(sys.modules[owner.__module__.partition(".")[0]], "__file__", "")))
    sources = sorted(top.parent.rglob("*.py")) if top.name == "__init__.py" else [Path(inspect.getfile(owner))]
    return name + b"".join(source.read_bytes() for source in sources)


@lru_cache
def _sources(rooms: tuple[str, ...]) -> bytes:
    """Return the versions and the sources of some subpackages."""
    digest = hashlib.sha256(metadata.version("meeframe").encode())
    for library in _LIBRARIES:
        digest.update(f"{library} {metadata.version(library)}".encode())
    root = Path(__file__).parents[1]
    for path in sorted(path for room in rooms for path in (root / room).rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return digest.digest()
