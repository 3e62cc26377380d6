"""Sources of plugins: entry points of installed distributions, and local files named by the user."""

import dataclasses
import hashlib
import importlib
import linecache
import sys
import traceback
from collections.abc import Iterable, Iterator, Mapping, Set
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from types import FrameType, ModuleType
from typing import Final

from packaging.requirements import InvalidRequirement, Requirement

from meeframe.common.errors import MeeframeError, PluginError, PluginFault
from meeframe.common.files import MAX_TEXT_BYTES, check_file
from meeframe.plugin.hookspecs import PROJECT
from meeframe.plugin.watchdog import time_limit

LOCAL: Final = f"{PROJECT}_file_"
"""Prefix of the names of modules from local files."""
BUNDLED_PACKAGES: Final = frozenset({"meeframe_halfspace", "meeframe_hmatrix", "meeframe_laws", "meeframe_skfem"})
"""Plugins of this project; failures in them are defects, reported by a traceback."""
_LIBRARIES: Final = frozenset({"site-packages", "dist-packages"})
_local_modules: Final[set[str]] = set()
"""Names of the modules from local files that this process has begun to load."""


@dataclass(frozen=True)
class Provider:
    """Provider of plugins: name and version of a distribution, or path and shortened SHA-256 of a local file."""

    name: str
    version: str

    def __str__(self) -> str:
        return f"{self.name} {self.version}".strip()


@dataclass(frozen=True)
class Broken:
    """A plugin, or a hook or record of it, that failed.

    Attributes
    ----------
    provider
        Provider of the plugin.
    reason
        Reason of the failure.
    line
        Line of the plugin's module where it failed, if known.
    """

    provider: Provider
    reason: str
    line: int | None = None

    def __str__(self) -> str:
        return f"plugin {self.provider} is broken: {self.reason}"


Plugins = tuple[list[tuple[Provider, object]], list[Broken]]
"""Modules with their providers, and the plugins that failed."""


def installed() -> Plugins:
    """Return the plugins of all distributions with entry points of the group 'meeframe', and those that failed."""
    plugins: list[tuple[Provider, object]] = []
    broken: list[Broken] = []
    for entry_point in metadata.entry_points(group=PROJECT):
        provider = (
            Provider(entry_point.dist.name, entry_point.dist.version)
            if entry_point.dist
            else Provider(entry_point.name, "")
        )
        outdated = _unmet((entry_point.dist.requires if entry_point.dist else None) or ())
        if outdated:
            broken.append(Broken(provider, outdated))
            continue
        try:
            plugins.append((provider, entry_point.load()))
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # plugins may also raise SystemExit and the like
            broken.append(Broken(provider, f"{_location(error)}{reason(error)}"))
    return plugins, broken


def load_file(path: Path) -> tuple[Provider, ModuleType]:
    """Load a plugin from a local file.

    Raises
    ------
    PluginError
        If the file is no Python file, cannot be read or fails; the message names the file, the line and the cause.
    """
    if path.suffix != ".py":
        raise PluginError(f"plugin file {path} is not a Python file; allowed: names that end in .py")
    try:
        check_file(path, MAX_TEXT_BYTES)
        source = path.read_bytes()
    except OSError as error:
        raise PluginError(f"plugin file {path} cannot be read: {error.strerror or error}") from None
    return load_source(path, source)


def load_source(path: Path, source: bytes) -> tuple[Provider, ModuleType]:
    """Load a plugin from source code, whose file need not exist on this machine; otherwise like `load_file`."""
    name = source_name(path, source)
    module = ModuleType(name)
    module.__file__ = str(path.resolve())
    linecache.checkcache(module.__file__)
    sys.modules[name] = module  # annotations are resolved there
    _local_modules.add(name)
    try:
        exec(compile(source, module.__file__, "exec"), module.__dict__)
    except BaseException as error:  # plugins may also raise SystemExit and the like
        del sys.modules[name]
        if isinstance(error, KeyboardInterrupt):
            raise
        raise PluginError(file_fault(path, reason(error), line_in(error, module.__file__))) from None
    return Provider(str(path), f"sha256:{name.rpartition('_')[2]}"), module


def source_name(path: Path, source: bytes) -> str:
    """Return the module name for a local file with this content."""
    return f"{LOCAL}{path.stem}_{hashlib.sha256(source).hexdigest()[:12]}"


def local_files(record: object) -> dict[str, str]:
    """Return the local files whose classes occur in a dataclass object at any depth.

    Returns
    -------
    dict of str to str
        Shortened SHA-256 by file name.
    """
    if isinstance(record, Mapping):
        record = tuple(record.values())
    if isinstance(record, tuple | list):
        return {name: digest for item in record for name, digest in local_files(item).items()}
    if not dataclasses.is_dataclass(record):
        return {}
    files = {}
    module = type(record).__module__
    if module.startswith(LOCAL):
        files[Path(str(sys.modules[module].__file__)).name] = f"sha256:{module.rpartition('_')[2]}"
    for field in dataclasses.fields(record):
        files |= local_files(getattr(record, field.name))
    return files


def file_fault(path: Path | str, cause: str, line: int | None) -> str:
    """Return a message such as 'plugin file laws.py, line 3: cause'."""
    return f"plugin file {path}{'' if line is None else f', line {line}'}: {cause}"


@contextmanager
def faults_of_plugins(*passing: type[Exception]) -> Iterator[None]:
    """Turn an exception from the code of a plugin into a PluginFault that names file, line and cause.

    The original exception is its __cause__, and the innermost frame is named if it is not in the plugin. These
    exceptions pass unchanged: those without a plugin frame, which are defects of meeframe; MeeframeError, MemoryError
    and KeyboardInterrupt, if they have a text; and those raised by the caller of the plugin in a callback. SystemExit
    is a fault like any other: it would end the run without a result.

    A call of a law, of wear or of an indenter that exceeds its `time_limit` is a fault as well.

    Parameters
    ----------
    *passing
        Further types of exceptions that pass unchanged.
    """
    packages = _plugin_packages(tuple(sys.path))
    is_used = bool(packages) or bool(_local_modules)
    try:
        with time_limit(lambda frame: _is_plugin_code(frame, packages)) if is_used else nullcontext():
            yield
    except BaseException as error:
        if isinstance(error, (MeeframeError, MemoryError, KeyboardInterrupt, *passing)) and _has_text(error):
            raise
        fault = fault_in(error)
        if fault is None:
            raise
        raise fault from error


def fault_in(error: BaseException) -> PluginFault | None:
    """Return the fault of the plugin whose code raised an exception, or None if no such code did."""
    packages = _plugin_packages(tuple(sys.path))
    frames = list(traceback.walk_tb(error.__traceback__))
    last = max((number for number, (frame, _) in enumerate(frames) if _is_plugin_code(frame, packages)), default=None)
    if last is None or any(_is_caller_code(frame, frames[last][0]) for frame, _ in frames[last + 1 :]):
        return None
    inner = f"; raised in {_where(*frames[-1])}" if last + 1 < len(frames) else ""
    return PluginFault(f"plugin file {_where(*frames[last])}: {reason(error)}{inner}")


@lru_cache(maxsize=1)
def _plugin_packages(_path: tuple[str, ...]) -> Set[str]:
    """Return the installed packages with plugins, but for those of this project, on a search path."""
    return {
        entry_point.module.partition(".")[0] for entry_point in metadata.entry_points(group=PROJECT)
    } - BUNDLED_PACKAGES


def _is_plugin_code(frame: FrameType, packages: Set[str]) -> bool:
    """Return whether a frame is in a local plugin file or in one of these installed packages."""
    module = frame.f_globals.get("__name__", "")
    return module.startswith(LOCAL) or module.partition(".")[0] in packages


def _is_caller_code(frame: FrameType, plugin: FrameType) -> bool:
    """Return whether a frame is in none of meeframe, the libraries and the folder of the plugin."""
    package = frame.f_globals.get("__name__", "").partition(".")[0]
    if package in sys.stdlib_module_names | BUNDLED_PACKAGES | {PROJECT}:
        return False
    file = Path(frame.f_globals.get("__file__") or frame.f_code.co_filename)
    in_plugin_folder = Path(plugin.f_code.co_filename).parent in file.parents
    return package == "__main__" or not (in_plugin_folder or _LIBRARIES & set(file.parts))


def _where(frame: FrameType, line: int) -> str:
    """Return a location such as 'laws.py, line 3, in project'."""
    return f"{frame.f_code.co_filename}, line {line}, in {frame.f_code.co_name}"


def reason(error: BaseException) -> str:
    """Return the description of an exception, also of one whose text is made by faulty code of a plugin."""
    try:
        return _description(error)
    except KeyboardInterrupt:
        raise
    except BaseException as other:
        return f"{type(error).__name__}, whose text cannot be shown: it raises {type(other).__name__}"


def _description(error: BaseException) -> str:
    if isinstance(error, MeeframeError):
        return str(error)
    text = f"{type(error).__name__}: {error.msg if isinstance(error, SyntaxError) else error}"
    missing = error.name if isinstance(error, ImportError) else None
    if missing and missing.partition(".")[0] == PROJECT:
        text += f"; it was written for another version of {PROJECT} than {metadata.version(PROJECT)}"
    return text


def _has_text(error: BaseException) -> bool:
    """Return whether the text of an exception can be made."""
    try:
        str(error)
    except KeyboardInterrupt:
        raise
    except BaseException:
        return False
    return True


def line_in(error: BaseException, file: str | None) -> int | None:
    """Return the last line of a file in the traceback of an exception, or the line of a syntax error in it."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return error.lineno
    return next((f.lineno for f in reversed(traceback.extract_tb(error.__traceback__)) if f.filename == file), None)


def _location(error: BaseException) -> str:
    """Return the location where an import failed, such as 'laws.py, line 3: ', or '' if it is in the import system."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{Path(error.filename).name}, line {error.lineno}: "
    system = str(Path(importlib.__file__).parent)
    frames = [f for f in traceback.extract_tb(error.__traceback__)[1:] if not f.filename.startswith(("<", system))]
    return f"{Path(frames[-1].filename).name}, line {frames[-1].lineno}: " if frames else ""


def _unmet(requirements: Iterable[str]) -> str:
    """Return a message if another version of meeframe is required, else ''."""
    version = metadata.version(PROJECT)
    for text in requirements:
        try:
            required = Requirement(text)
        except InvalidRequirement:
            continue
        if required.name == PROJECT and required.marker is None and not required.specifier.contains(version, True):
            return f"outdated: it needs {PROJECT}{required.specifier}, this is {PROJECT} {version}"
    return ""
