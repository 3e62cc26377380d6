"""Grids that exceed the memory are refused, with an estimate that depends on the laws, before anything is computed."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.common.errors import CaseError, TooLargeError
from meeframe.common.memory import control_group_limits, usable_memory
from meeframe.elements import Quad4
from meeframe.indenters import Sphere
from meeframe.laws import IsotropicCoulomb, Signorini, StepConductivity
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.generators import BASE_BYTES
from meeframe.model.case import Case
from meeframe.model.load import load_case
from meeframe.model.memory import required_memory
from meeframe.model.step import Step
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import Kind
from meeframe.study.run import run

NODES = 200 * 200
FILE = """
[material]
name = "pzt-4"
[mesh]
type = "half-space"
contact_width = "1 mm"
divisions = 199
[formulation]
name = "half-space"
[indenter]
name = "sphere"
radius = "0.1 m"
[contact.law]
name = "isotropic-coulomb"
mu = 0.3
[[steps]]
normal_force = 1.0
"""


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that sets the memory of the machine in bytes."""

    def limit(size: int) -> None:
        for module in ("mesh.generators", "model.memory"):
            monkeypatch.setattr(f"meeframe.{module}.usable_memory", lambda: size)

    return limit


def make(**changes: Any) -> Case:
    case = Case(
        material=library_material("pzt-4"),
        mesh=half_space_mesh(2.0, 1e-3, 199, 1, Quad4()),
        conditions=(),
        indenter=Sphere(0.1),
        formulation=plugins.load().create(Kind.FORMULATION, "half-space"),
        steps=(Step(normal_force=1.0),),
    )
    return replace(case, **changes)


SELF_AFFINE = {
    "name": "self-affine",
    "period": 1e-3,
    "shortest": 1e-4,
    "hurst": 0.8,
    "rms_height": 1e-7,
    "samples": 3000,
}


def test_samples_of_a_surface_beyond_the_memory_are_refused_before_they_are_made(tmp_path, machine, monkeypatch):
    indenter = plugins.load().create(Kind.INDENTER, SELF_AFFINE)
    monkeypatch.setattr(type(indenter), "surface", lambda surface: pytest.fail("heights are made"))
    monkeypatch.setattr(type(indenter), "height", lambda surface, x, y: pytest.fail("heights are made"))
    machine(500_000_000)
    message = (
        "samples = 3000: a surface with 9000000 nodes needs at least 0.702 GB; this process may use 0.5 GB; allowed: "
        "about 2188 x 2188 nodes"
    )
    with pytest.raises(TooLargeError) as caught:
        make(indenter=indenter)
    assert str(caught.value) == message
    lines = "\n".join(f"{key} = {value!r}" for key, value in SELF_AFFINE.items())
    text = FILE.replace('name = "sphere"\nradius = "0.1 m"', lines)
    assert text != FILE
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    for command in (["check"], ["run", "--out", str(tmp_path / "out")]):
        done = CliRunner().invoke(app, [command[0], str(tmp_path / "case.toml"), *command[1:]])
        assert done.exit_code == 2, done.output
        assert f"case.toml: indenter: {message}" in done.output
    assert not (tmp_path / "out").exists()


def test_each_loaded_field_counts():
    law = StepConductivity(1.0)
    conducting = make(conductivity={"electric": law}).channels
    both = make(conductivity={"electric": law, "magnetic": law}).channels
    insulating = make().channels
    frictionless, friction = (required_memory(NODES, law, insulating) for law in (Signorini(), IsotropicCoulomb(0.3)))
    with_charges, with_both = (required_memory(NODES, IsotropicCoulomb(0.3), each) for each in (conducting, both))
    assert BASE_BYTES < frictionless < friction < with_charges
    assert with_both - with_charges == pytest.approx(with_charges - friction)


def test_a_mesh_that_is_too_large_is_not_checked(machine, tmp_path, monkeypatch):
    """The check of a mesh would take the time and the memory that the message saves."""
    file = tmp_path / "case.toml"
    file.write_text(FILE, encoding="utf-8")
    machine(BASE_BYTES)

    def fail(_mesh):
        raise AssertionError("checked")

    monkeypatch.setattr("meeframe.model.locate.check_mesh", fail)
    with pytest.raises(CaseError, match=r"mesh: divisions = 199 x 199"):
        load_case(file)


def test_only_runs_count_figures_and_fields(machine, tmp_path):
    """Solutions in memory, and studies, need the memory of contact alone."""
    file = tmp_path / "case.toml"
    file.write_text(FILE, encoding="utf-8")
    case = load_case(file)
    machine(required_memory(NODES, case.contact_law, case.channels))
    assert load_case(file).mesh.grid == (200, 200)
    with pytest.raises(CaseError, match=r"case\.toml: divisions = 199 x 199: .* allowed"):
        run(file, tmp_path / "out")
    file.write_text(FILE + "[output]\nfigures = false\nvtu = false\n", encoding="utf-8")
    load_case(file).check_memory_of_run()


def test_figures_and_fields_count_where_contact_needs_less():
    law, conducting = StepConductivity(1.0), make(conductivity={"electric": StepConductivity(1.0)}).channels
    assert required_memory(NODES, Signorini(), (), True) > required_memory(NODES, Signorini(), ())
    both = make(conductivity={"electric": law, "magnetic": law}).channels
    friction = IsotropicCoulomb(0.3)
    assert required_memory(NODES, friction, both, True) == required_memory(NODES, friction, both)
    assert required_memory(NODES, friction, conducting, True) < required_memory(NODES, friction, both)


def test_a_case_that_exceeds_the_memory_is_refused(machine):
    required = required_memory(NODES, IsotropicCoulomb(0.3), make().channels)
    machine(required + 1)
    assert any("the run needs about" in text for text in make(contact_law=IsotropicCoulomb(0.3)).preflight)
    machine(required - 1)
    make()
    with pytest.raises(TooLargeError, match=r"divisions = 199 x 199: .* with 40000 nodes .* allowed: about 199 x 199"):
        make(contact_law=IsotropicCoulomb(0.3))
    machine(3 * required)
    assert make(contact_law=IsotropicCoulomb(0.3)).preflight == ()


def test_the_message_names_the_key(machine, tmp_path):
    file = tmp_path / "case.toml"
    file.write_text(FILE, encoding="utf-8")
    load_case(file)
    machine(BASE_BYTES)
    with pytest.raises(CaseError, match=r"case\.toml: mesh: divisions = 199 x 199: .* allowed: about 0 x 0"):
        load_case(file)


@pytest.mark.parametrize(
    ("line", "file"), [("0::/job/step", "memory.max"), ("4:cpu,memory:/job/step", "memory.limit_in_bytes")]
)
def test_limits_of_control_groups(line: str, file: str, tmp_path: Path) -> None:
    """A group has the limits of all groups that hold it, and may have none itself."""
    membership, mount = tmp_path / "cgroup", tmp_path / "groups"
    membership.write_text(f"3:cpuset:/elsewhere\n{line}\n", encoding="utf-8")
    top = mount / "memory" if "memory:" in line else mount
    (top / "job" / "step").mkdir(parents=True)
    assert list(control_group_limits(membership, mount)) == []
    for folder, limit in ((top, "8000"), (top / "job", "5000"), (top / "job" / "step", "max")):
        (folder / file).write_text(f"{limit}\n", encoding="ascii")
    assert list(control_group_limits(membership, mount)) == [5000, 8000]
    assert list(control_group_limits(tmp_path / "none", mount)) == []


def test_a_limit_of_the_process_counts() -> None:
    """Addresses that are mapped but not in memory do not count as memory that may be used."""
    limit = usable_memory() // 2
    words = (
        "import resource; from meeframe.common.memory import usable_memory; "
        f"resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit})); print(usable_memory())"
    )
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert 0 < int(done.stdout) < limit
