"""Command on the installation: doctor."""

import os
import platform
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Final

import typer

from meeframe.cli import console
from meeframe.cli.app import app

if TYPE_CHECKING:
    from meeframe.plugin.registry import Registry

_LIBRARIES: Final = ("numpy", "scipy", "numba", "llvmlite", "h5py", "pydantic", "pint", "matplotlib", "meshio")
_PURPOSES: Final = {
    "sweep": "meeframe sweep: parameter studies, sweep.h5",
    "skfem": "formulation skfem (finite elements)",
    "data": "Result.to_dataframe and Result.to_xarray",
    "interactive": "progress bars in notebooks, three-dimensional plots",
    "validation": "meeframe validate: plots in the report",
    "testing": "conformance checks of plugins",
}
"""Purpose of each extra of meeframe, in the order in which `doctor` lists them."""
_PLUGINS: Final = ("meeframe-laws", "meeframe-halfspace", "meeframe-hmatrix", "meeframe-skfem")


@dataclass(frozen=True)
class Finding:
    """One line of the report.

    Attributes
    ----------
    section, name, text
        Heading, name and description.
    problem
        True if something does not work as installed; missing optional packages are no problem.
    """

    section: str
    name: str
    text: str
    problem: bool = False


@app.command()
def doctor() -> None:
    """Report versions, threads, caches, plugins and missing optional packages of this installation.

    The exit status is 0 if there is no problem, 1 if a plugin is broken or compiled kernels cannot be cached, and 2 if,
    for that reason, the package cannot be loaded.
    """
    from meeframe.common.literal import LiteralTable

    with console.exit_status():
        from meeframe.plugin import registry  # loads kernels

        results = list(findings(registry.load()))
    table = LiteralTable(box=None, pad_edge=False, show_header=False)
    section = ""
    for finding in results:
        table.add_row(finding.section if finding.section != section else "", finding.name, finding.text)
        section = finding.section
    console.stdout().print(table)
    problems = [finding for finding in results if finding.problem]
    print(f"{len(problems)} problem{'s' * (len(problems) != 1)}")
    raise typer.Exit(console.NOT_CONVERGED if problems else console.CONVERGED)


def findings(registry: "Registry") -> Iterator[Finding]:
    """Yield the findings on this installation.

    Parameters
    ----------
    registry
        Registry of everything that is installed.
    """
    import meeframe

    yield Finding("versions", "meeframe", f"{meeframe.__version__} in {Path(meeframe.__file__).parent}")
    yield Finding("", "python", f"{platform.python_version()}, {sys.executable}")
    yield Finding("", "system", f"{platform.system()} {platform.machine()}")
    for name in _LIBRARIES:
        yield Finding("", name, metadata.version(name))
    yield from _threads()
    yield _kernel_cache()
    yield from _plugins(registry)
    yield from _extras()


def _threads() -> Iterator[Finding]:
    import numba
    import scipy.linalg  # noqa: F401  # loads the BLAS of scipy in addition to that of numpy
    from threadpoolctl import threadpool_info

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    yield Finding("threads", "cores", f"{cores} available to this process")
    yield Finding("", "numba threads", f"{numba.get_num_threads()}; NUMBA_NUM_THREADS sets the number")
    for library in threadpool_info():
        version = f" {library['version']}" if library.get("version") else ""
        if library["user_api"] == "blas":
            text = f"{library['internal_api']}{version}, {library['num_threads']} threads, {library['filepath']}"
            yield Finding("", "BLAS", text)


def _kernel_cache() -> Finding:
    """Return the finding on the folder in which numba stores compiled kernels."""
    try:
        from meeframe.greens._kernels import isotropic

        kernel = next(value for value in vars(isotropic).values() if hasattr(value, "stats"))
        folder = Path(kernel.stats.cache_path)
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except (OSError, RuntimeError) as error:
        remedy = "set NUMBA_CACHE_DIR to a writable folder"
        return Finding("cache", "kernels", f"not writable ({error}): {remedy}", problem=True)
    return Finding("cache", "kernels", f"{folder}, writable")


def _plugins(registry: "Registry") -> Iterator[Finding]:
    section = "plugins"
    for provider in registry.providers:
        if provider.name == "meeframe":
            continue
        names = ", ".join(entry.record.name for entry in registry.entries if entry.provider == provider)
        yield Finding(section, str(provider), f"{_origin(provider.name)}: {names}")
        section = ""
    for broken in registry.broken:
        yield Finding(section, str(broken.provider), f"broken: {broken.reason}", problem=True)
        section = ""
    known = {provider.name for provider in registry.providers} | {broken.provider.name for broken in registry.broken}
    for name in _PLUGINS:
        if name not in known:
            yield Finding(section, name, f"not installed; pip install {name}")
            section = ""


def _origin(distribution: str) -> str:
    """Return the folder of an installed distribution; for an editable one, that of its metadata."""
    return str(Path(str(metadata.distribution(distribution).locate_file(""))).resolve())


def _extras() -> Iterator[Finding]:
    """Yield a finding for each extra of meeframe and of its half space, with the packages that are missing."""
    section = "optional"
    for extra, purpose in _PURPOSES.items():
        yield Finding(section, extra, f"{purpose}: {_state('meeframe', extra)}")
        section = ""
    with suppress(metadata.PackageNotFoundError):  # a plugin
        state = _state("meeframe-halfspace", "instruments")
        yield Finding("", "instruments", f"height maps from files of instruments: {state}")
    yield Finding("", "cupy", f"device = 'gpu' of half-space: {_graphics_processor()}")


def _state(distribution: str, extra: str) -> str:
    """Return whether an extra of a distribution is installed, and how to install it. Raises PackageNotFoundError."""
    missing = sorted(_missing(distribution, extra))
    return f"missing: {', '.join(missing)}; pip install '{distribution}[{extra}]'" if missing else "installed"


def _graphics_processor() -> str:
    try:
        import cupy
    except ImportError as error:
        return f"missing: {error}; pip install the package of CuPy for the CUDA version of this machine"
    try:
        count = cupy.cuda.runtime.getDeviceCount()
    except cupy.cuda.runtime.CUDARuntimeError as error:
        return f"CuPy {cupy.__version__} finds no device: {error}"
    return f"CuPy {cupy.__version__}, devices: {count}"


def _missing(distribution: str, extra: str) -> Iterator[str]:
    """Yield the requirements of an extra that are not installed, or not in a version that it allows."""
    from packaging.requirements import Requirement

    for text in metadata.requires(distribution) or ():
        requirement = Requirement(text)
        marker = requirement.marker
        if marker is None or marker.evaluate({"extra": ""}) or not marker.evaluate({"extra": extra}):
            continue
        try:
            version = metadata.version(requirement.name)
        except metadata.PackageNotFoundError:
            yield requirement.name
            continue
        if not requirement.specifier.contains(version, prereleases=True):
            yield f"{requirement.name}{requirement.specifier}"
        for inner in requirement.extras:
            yield from _missing(requirement.name, inner)
