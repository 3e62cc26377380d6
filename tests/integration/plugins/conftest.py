"""Fixtures that install packages into temporary folders and run commands with them."""

import os
import shutil
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest


def install_package(folder: Path, site: Path) -> None:
    """Install a package into a separate folder, without network.

    uv builds it if its build dependencies are available; otherwise it is unpacked as its wheel would be: module,
    metadata, entry points.
    """
    uv = shutil.which("uv")
    command = [uv, "pip", "install", "--offline", "--no-deps", "--target", site, "--python", sys.executable, folder]
    if uv and subprocess.run(list(map(str, command)), capture_output=True, timeout=120).returncode == 0:
        return
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = site / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir(parents=True)
    requires = "".join(f"Requires-Dist: {line}\n" for line in project["dependencies"])
    metadata = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n{requires}"
    (info / "METADATA").write_text(metadata, encoding="utf-8")
    points = "".join(f"{key} = {value}\n" for key, value in project["entry-points"]["meeframe"].items())
    (info / "entry_points.txt").write_text(f"[meeframe]\n{points}", encoding="utf-8")
    for module in folder.glob("*.py"):
        shutil.copy(module, site)


def run_python(*arguments: object, path: Path, cwd: Path | None = None) -> "subprocess.CompletedProcess[str]":
    """Run Python with a folder of installed packages on its path."""
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(path)},
        capture_output=True,
        text=True,
        timeout=900,
        cwd=cwd,
    )


@pytest.fixture(scope="session")
def package_tools():
    """Return the two functions above."""
    return SimpleNamespace(install=install_package, python=run_python)


@pytest.fixture
def install(tmp_path):
    """Return a function that installs a package of one module, version 1.2, with given requirements."""

    def make(name, source, *requires):
        module = name.replace("-", "_")
        package = tmp_path / "packages" / name
        package.mkdir(parents=True)
        (package / f"{module}.py").write_text(textwrap.dedent(source), encoding="utf-8")
        (package / "pyproject.toml").write_text(
            f'[build-system]\nrequires = ["hatchling>=1.25"]\nbuild-backend = "hatchling.build"\n[project]\n'
            f'name = "{name}"\nversion = "1.2"\ndependencies = {list(requires)}\n'
            f'[project.entry-points.meeframe]\n{name} = "{module}"\n'
            f'[tool.hatch.build.targets.wheel]\ninclude = ["{module}.py"]\n',
            encoding="utf-8",
        )
        install_package(package, tmp_path / "site")

    return make


@pytest.fixture
def command(tmp_path):
    """Return a function that runs the command line with the installed packages."""

    def run(*arguments):
        return run_python("-c", "from meeframe.cli import main; main()", *arguments, path=tmp_path / "site")

    return run
