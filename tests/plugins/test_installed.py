"""Plugins as installed packages: found by their entry points, and harmless when they are broken."""

import os
import subprocess
import sys
import textwrap

import pytest

import meeframe


@pytest.fixture
def install(tmp_path):
    """Installs a package of one module into a folder of its own; commands see it through PYTHONPATH."""

    def make(name, source):
        module = name.replace("-", "_")
        (tmp_path / f"{module}.py").write_text(textwrap.dedent(source))
        info = tmp_path / f"{module}-1.2.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        (info / "entry_points.txt").write_text(f"[meeframe]\n{name} = {module}\n")

    return make


@pytest.fixture
def command(tmp_path):
    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-c", "from meeframe.cli import main; main()", *map(str, arguments)],
            env={**os.environ, "PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=300,
        )

    return run


GOOD = """
    from dataclasses import dataclass
    import numpy as np
    from meeframe.core.indenter import Indenter
    from meeframe.plugin.hookspecs import Record, hookimpl

    @dataclass(frozen=True)
    class Plane(Indenter):
        def height(self, x, y):
            return np.zeros_like(x)

    @hookimpl
    def meeframe_indenters():
        return [Record("{name}", Plane, "a plane", "Euclid")]
"""

CASE = """
    [material]
    name = "batio3-cofe2o4"
    [mesh]
    half_width = 0.05
    height = 0.12
    contact_width = 0.005
    divisions = 2
    rings = 1
    layers = 1
    [[boundary]]
    group = "base"
    displacement = [0, 0, 0]
    electric_potential = 0
    magnetic_potential = 0
    [indenter]
    name = "{indenter}"
    [[steps]]
    approach = 1e-5
"""


@pytest.fixture
def case_file(tmp_path):
    def write(indenter):
        path = tmp_path / "case.toml"
        path.write_text(textwrap.dedent(CASE).format(indenter=indenter))
        return path

    return write


def test_a_plugin_is_found_and_used(install, command, case_file):
    install("planes", GOOD.format(name="plane"))
    listed = command("plugins")
    assert ["indenter", "plane", "planes", "1.2", "a", "plane", "Euclid"] in [
        line.split() for line in listed.stdout.splitlines()
    ]
    assert command("check", case_file("plane")).returncode == 0


def test_broken_plugins_are_reported_and_fail_only_what_needs_them(install, command, case_file):
    install("planes", GOOD.format(name="plane"))
    install("crash", "raise RuntimeError('wrong weather')")
    install("needs", "import a_module_that_nobody_has")
    listed = command("plugins")
    assert listed.returncode == 0
    warnings = [line for line in listed.stderr.splitlines() if line.startswith("warning: ")]
    assert "warning: plugin crash 1.2 is broken: RuntimeError: wrong weather" in warnings
    assert any("plugin needs 1.2 is broken: ModuleNotFoundError" in line for line in warnings)
    assert command("check", case_file("plane")).returncode == 0
    refused = command("check", case_file("disc"))
    assert refused.returncode == 2
    (error,) = [line for line in refused.stderr.splitlines() if line.startswith("error: ")]
    assert "unknown indenter 'disc'; allowed: cone, " in error
    assert "plugin crash 1.2 is broken" in error


def test_duplicate_names_name_both_providers(install, command, case_file):
    install("spheres", GOOD.format(name="sphere"))
    done = command("check", case_file("cone"))
    assert done.returncode == 2
    assert f"indenter 'sphere' is provided twice: by meeframe {meeframe.__version__} and by spheres 1.2" in done.stderr
    assert "Traceback" not in done.stderr
