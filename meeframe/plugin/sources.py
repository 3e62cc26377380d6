"""Sources of plugins: installed distributions by their entry points, and local files that the user names."""

import dataclasses
import hashlib
import importlib
import linecache
import sys
import traceback
from collections.abc import Iterable, Iterator, Set
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from types import FrameType, ModuleType
from typing import Final

from packaging.requirements import InvalidRequirement, Requirement

from meeframe.common.errors import MeeframeError, PluginError, PluginFault
from meeframe.plugin.hookspecs import PROJECT

LOCAL: Final = f"{PROJECT}_file_"
"""How names of modules that come from local files begin."""
OWN_PACKAGES: Final = frozenset({"meeframe_halfspace", "meeframe_hmatrix", "meeframe_laws", "meeframe_skfem"})
"""Plugins of this project: a failure in them is its own defect, for which there is the traceback."""
_LIBRARIES: Final = frozenset({"site-packages", "dist-packages"})


@dataclass(frozen=True)
class Provider:
    """A provider of plugins: name and version of a distribution, or path and shortened SHA-256 of a local file."""

    name: str
    version: str

    def __str__(self) -> str:
        return f"{self.name} {self.version}".strip()


@dataclass(frozen=True)
class Broken:
    """A plugin, or one part of it, that failed. line: of the plugin's own module where it did, if it can be told."""

    provider: Provider
    reason: str
    line: int | None = None

    def __str__(self) -> str:
        return f"plugin {self.provider} is broken: {self.reason}"


Plugins = tuple[list[tuple[Provider, object]], list[Broken]]
"""Modules with who provides them, and those that failed."""


def installed() -> Plugins:
    """Return the plugins of all distributions with entry points of the group 'meeframe'; one that fails is broken."""
    plugins: list[tuple[Provider, object]] = []
    broken: list[Broken] = []
    for point in metadata.entry_points(group=PROJECT):
        provider = Provider(point.dist.name, point.dist.version) if point.dist else Provider(point.name, "")
        outdated = _unmet((point.dist.requires if point.dist else None) or ())
        if outdated:
            broken.append(Broken(provider, outdated))
            continue
        try:
            plugins.append((provider, point.load()))
        except (Exception, SystemExit) as error:
            broken.append(Broken(provider, f"{_place(error)}{reason(error)}"))
    return plugins, broken


def load_file(path: Path) -> tuple[Provider, ModuleType]:
    """Return the module of a local file, run now.

    Raises PluginError that names the file, the line and the cause if it cannot be read or fails.
    """
    try:
        source = path.read_bytes()
    except OSError as error:
        raise PluginError(f"plugin file {path} cannot be read: {error.strerror or error}") from None
    return load_source(path, source)


def load_source(path: Path, source: bytes) -> tuple[Provider, ModuleType]:
    """Load a plugin from source text, whose file need not be on this machine; otherwise as `load_file`."""
    name = source_name(path, source)
    module = ModuleType(name)
    module.__file__ = str(path.resolve())
    linecache.checkcache(module.__file__)
    sys.modules[name] = module  # annotations are looked up there
    try:
        exec(compile(source, module.__file__, "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise PluginError(file_fault(path, reason(error), line_in(error, module.__file__))) from None
    return Provider(str(path), f"sha256:{name.rpartition('_')[2]}"), module


def source_name(path: Path, source: bytes) -> str:
    """Return the name of the module that a local file of this content becomes."""
    return f"{LOCAL}{path.stem}_{hashlib.sha256(source).hexdigest()[:12]}"


def local_files(record: object) -> dict[str, str]:
    """Return the names and shortened SHA-256 of the local files whose classes a dataclass object is made of, at any
    depth."""
    if isinstance(record, tuple | list):
        return {name: digest for item in record for name, digest in local_files(item).items()}
    if not dataclasses.is_dataclass(record):
        return {}
    found = {}
    module = type(record).__module__
    if module.startswith(LOCAL):
        found[Path(str(sys.modules[module].__file__)).name] = f"sha256:{module.rpartition('_')[2]}"
    for field in dataclasses.fields(record):
        found |= local_files(getattr(record, field.name))
    return found


def file_fault(path: Path | str, cause: str, line: int | None) -> str:
    """Return 'plugin file laws.py, line 3: cause'."""
    return f"plugin file {path}{'' if line is None else f', line {line}'}: {cause}"


@contextmanager
def faults_of_plugins(*said: type[Exception]) -> Iterator[None]:
    """Turn an exception that came through the code of a plugin into a PluginFault that names file, line and cause.

    The exception itself is its __cause__; the innermost frame is named too where it is not the plugin's. One in which
    no plugin had a part passes, as a defect of meeframe, and so does what a user can mend, and what the plugin's caller
    raised where it called back. said: further kinds of exceptions by which plugins say that.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, (MeeframeError, MemoryError, *said)):
            raise
        packages = {point.module.partition(".")[0] for point in metadata.entry_points(group=PROJECT)} - OWN_PACKAGES
        frames = list(traceback.walk_tb(error.__traceback__))
        last = max((number for number, (frame, _) in enumerate(frames) if _of_plugin(frame, packages)), default=None)
        if last is None or any(_of_caller(frame, frames[last][0]) for frame, _ in frames[last + 1 :]):
            raise
        inner = f"; raised in {_where(*frames[-1])}" if last + 1 < len(frames) else ""
        raise PluginFault(f"plugin file {_where(*frames[last])}: {reason(error)}{inner}") from error


def _of_plugin(frame: FrameType, packages: Set[str]) -> bool:
    """Return whether its code is a plugin's, of a local file or of one of these installed packages."""
    module = frame.f_globals.get("__name__", "")
    return module.startswith(LOCAL) or module.partition(".")[0] in packages


def _of_caller(frame: FrameType, plugin: FrameType) -> bool:
    """Return whether its code is neither meeframe's, nor a library's, nor in the folder of a plugin, from which it
    came."""
    package = frame.f_globals.get("__name__", "").partition(".")[0]
    if package in sys.stdlib_module_names | OWN_PACKAGES | {PROJECT}:
        return False
    file = Path(frame.f_globals.get("__file__") or frame.f_code.co_filename)
    beside = Path(plugin.f_code.co_filename).parent in file.parents
    return package == "__main__" or not (beside or _LIBRARIES & set(file.parts))


def _where(frame: FrameType, line: int) -> str:
    """Return 'laws.py, line 3, in project'."""
    return f"{frame.f_code.co_filename}, line {line}, in {frame.f_code.co_name}"


def reason(error: BaseException) -> str:
    """Return an exception in words."""
    if isinstance(error, MeeframeError):
        return str(error)
    text = f"{type(error).__name__}: {error.msg if isinstance(error, SyntaxError) else error}"
    missing = error.name if isinstance(error, ImportError) else None
    if missing and missing.partition(".")[0] == PROJECT:
        text += f"; it is written for another version of {PROJECT} than {metadata.version(PROJECT)}"
    return text


def line_in(error: BaseException, file: str | None) -> int | None:
    """Return the last line of a file through which an exception came, or where its syntax is wrong."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return error.lineno
    return next((f.lineno for f in reversed(traceback.extract_tb(error.__traceback__)) if f.filename == file), None)


def _place(error: BaseException) -> str:
    """Return 'laws.py, line 3: ', where an import came to its end, or '' if that was in the import system."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{Path(error.filename).name}, line {error.lineno}: "
    system = str(Path(importlib.__file__).parent)
    frames = [f for f in traceback.extract_tb(error.__traceback__)[1:] if not f.filename.startswith(("<", system))]
    return f"{Path(frames[-1].filename).name}, line {frames[-1].lineno}: " if frames else ""


def _unmet(requirements: Iterable[str]) -> str:
    """Return which version of meeframe is required if it is not this one, else ''."""
    version = metadata.version(PROJECT)
    for text in requirements:
        try:
            required = Requirement(text)
        except InvalidRequirement:
            continue
        if required.name == PROJECT and required.marker is None and not required.specifier.contains(version, True):
            return f"outdated: it needs {PROJECT}{required.specifier}, this is {PROJECT} {version}"
    return ""
