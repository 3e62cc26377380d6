"""Installed plugins are found by their entry points; broken ones do not affect other plugins."""

import textwrap

import pytest

import meeframe

GOOD = """
    from dataclasses import dataclass
    import numpy as np
    from meeframe.indenters.base import Indenter
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


@pytest.mark.full
def test_installed_plugin_is_used(install, command, case_file):
    install("planes", GOOD.format(name="plane"))
    listed = command("plugins")
    assert ["plane", "a", "plane", "(planes)"] in [line.split() for line in listed.stdout.splitlines()]
    shown = command("plugins", "show", "plane").stdout
    assert "provider: planes 1.2" in shown
    assert "source: Euclid" in shown
    assert command("check", case_file("plane")).returncode == 0


@pytest.mark.full
def test_broken_plugins_affect_only_cases_that_need_them(install, command, case_file):
    install("planes", GOOD.format(name="plane"))
    install("crash", "import math\n\nraise RuntimeError('wrong weather')")
    install("needs", "import a_module_that_nobody_has")
    listed = command("plugins")
    assert listed.returncode == 0
    warnings = [line for line in listed.stderr.splitlines() if line.startswith("warning: ")]
    assert "warning: plugin crash 1.2 is broken: crash.py, line 3: RuntimeError: wrong weather" in warnings
    assert any("plugin needs 1.2 is broken: needs.py, line 1: ModuleNotFoundError" in line for line in warnings)
    assert command("check", case_file("plane")).returncode == 0
    refused = command("check", case_file("disc"))
    assert refused.returncode == 2
    (error,) = [line for line in refused.stderr.splitlines() if line.startswith("error: ")]
    assert "unknown indenter 'disc'; allowed: cone, " in error
    assert "plugin crash 1.2 is broken" in error


OUTDATED = """
    from dataclasses import dataclass
    from meeframe.plugin import ContactLaw, Record, hookimpl

    @dataclass(frozen=True)
    class Old(ContactLaw):
        def project(self, trial):
            return trial

    @hookimpl
    def meeframe_contact_laws():
        return [Record("old", Old, "lacks a method that the contract has now", "yesterday")]
"""

EARLIER = """
    from dataclasses import dataclass
    import numpy as np
    from meeframe.plugin import ConductivityLaw, Record, hookimpl

    @dataclass(frozen=True)
    class Earlier(ConductivityLaw):
        def conductivity(self, normal_traction):
            return np.zeros_like(normal_traction)

    @hookimpl
    def meeframe_conductivity_laws():
        return [Record("earlier", Earlier, "of a contract that knew neither gap nor drop", "yesterday")]
"""


@pytest.mark.full
def test_outdated_plugins_do_not_affect_others(install, command, case_file):
    install("planes", GOOD.format(name="plane"))
    install("ahead", GOOD.format(name="disc"), "meeframe>=99")
    install("behind", OUTDATED)
    install("earlier", EARLIER)
    install("moved", "from meeframe.contact.problem import LawOfYesterday")
    install("misspelt", GOOD.format(name="ring").replace("meeframe_indenters", "meeframe_indenter"))
    listed = command("plugins")
    names = [line.split()[0] for line in listed.stdout.splitlines() if line.startswith("  ") and line.strip()]
    assert "plane" in names
    assert not {"disc", "old", "earlier", "ring"} & set(names)
    warnings = {line.split()[2]: line for line in listed.stderr.splitlines() if line.startswith("warning: plugin ")}
    this = meeframe.__version__
    assert f"outdated: it needs meeframe>=99, this is meeframe {this}" in warnings["ahead"]
    assert f"class Old lacks tangential_scaling, which meeframe {this} requires" in warnings["behind"]
    needs = f"Earlier.conductivity does not accept (normal_traction, gap, drop), which meeframe {this} requires"
    assert needs in warnings["earlier"]
    assert f"it was written for another version of meeframe than {this}" in warnings["moved"]
    assert "unknown hook 'meeframe_indenter'" in warnings["misspelt"]
    assert command("check", case_file("plane")).returncode == 0
    refused = command("plugins", "show", "old")
    assert refused.returncode == 2
    assert "error: unknown name 'old'; " in refused.stderr
    assert "plugin behind 1.2 is broken" in refused.stderr
    path = case_file("plane")
    path.write_text(path.read_text() + '[conductivity]\nelectric = "earlier"\n')
    refused = command("check", path)
    assert refused.returncode == 2
    assert "conductivity.electric.name: unknown conductivity law 'earlier'" in refused.stderr
    assert "Traceback" not in refused.stderr


@pytest.mark.full
def test_duplicate_names_report_both_providers(install, command, case_file):
    install("spheres", GOOD.format(name="sphere"))
    done = command("check", case_file("cone"))
    assert done.returncode == 2
    assert f"indenter 'sphere' is provided twice: by meeframe {meeframe.__version__} and by spheres 1.2" in done.stderr
    assert "Traceback" not in done.stderr
