"""Packages created by `meeframe new-plugin` install, pass their tests, and work in cases."""

import re
from xml.etree import ElementTree

import meshio
import pytest
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.model.load import load_case
from meeframe.plugin.registry import Kind, load

KINDS = [kind.value.replace(" ", "-") for kind in Kind]


def invoke(*arguments):
    """Return exit status, standard output and standard error."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture(scope="session")
def packages(tmp_path_factory):
    """Return a package of each kind, as created."""
    folder = tmp_path_factory.mktemp("packages")
    for kind in KINDS:
        status, out, err = invoke("new-plugin", kind, f"new-{kind}", "--out", folder / kind)
        assert (status, err) == (0, "")
        assert f"meeframe_new_{kind.replace('-', '_')}.py" in out
    return folder


@pytest.fixture(scope="session")
def results(packages, package_tools, tmp_path_factory):
    """Return results of the packages' tests after installation into a separate folder: name of the test -> failure."""
    site = tmp_path_factory.mktemp("site")
    for kind in KINDS:
        package_tools.install(packages / kind, site)
    report = site / "report.xml"
    folders = [packages / kind / "tests" for kind in KINDS]
    done = package_tools.python("-m", "pytest", "-q", f"--junitxml={report}", *folders, path=site)
    assert report.exists(), done.stdout + done.stderr
    cases = ElementTree.parse(report).iter("testcase")
    return {(case.get("classname"), case.get("name")): [part.get("message") for part in case] for case in cases}


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS)
def test_new_package_passes_its_tests(results, kind):
    module = f"test_meeframe_new_{kind.replace('-', '_')}"
    own = {key: failed for key, failed in results.items() if key[0].split(".")[-1] in (module, f"{module}_example")}
    assert len(own) >= 5
    assert not any(own.values()), own
    assert any(name.startswith("test_conforms") for _, name in own)


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("kind", KINDS)
def test_new_module_works_as_local_file(packages, kind):
    module = packages / kind / f"meeframe_new_{kind.replace('-', '_')}.py"
    status, out, _ = invoke("plugins", "show", f"new-{kind}", "--plugin", module)
    assert status == 0
    assert f"new-{kind}: {kind.replace('-', ' ')}, " in out
    status, out, _ = invoke("check", packages / kind / "example.toml", "--plugin", module)
    assert (status, "ok" in out) == (0, True)
    assert invoke("check", packages / kind / "example.toml")[0] == 2


@pytest.mark.full
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "solver"])
def test_new_module_conforms(packages, kind):
    """The solver, whose check takes longest, is checked by the tests of its package."""
    status, out, _ = invoke("plugins", "check", packages / kind / f"meeframe_new_{kind.replace('-', '_')}.py")
    assert status == 0, out
    assert out.endswith(": conforms\n")


@pytest.mark.full
def test_elements_unknown_to_vtk_are_written_by_their_corners(packages, tmp_path):
    module = packages / "element" / "meeframe_new_element.py"
    case = packages / "element" / "example.toml"
    status, out, err = invoke("run", case, "--plugin", module, "--out", tmp_path / "out")
    assert status == 0, err
    assert "miss equilibrium" not in out, "examples of coarse blocks did, by more than their charge"
    fields = meshio.read(tmp_path / "out" / "fields.vtu")
    assert {block.type for block in fields.cells} == {"triangle"}
    assert sum(len(block.data) for block in fields.cells) == load_case(case, load(module)).mesh.n_elements


def test_friction_law_is_short(packages):
    lines = (packages / "contact-law" / "meeframe_new_contact_law.py").read_text(encoding="utf-8").splitlines()
    assert len([line for line in lines if line.strip()]) < 30


def test_readme_runs_a_case_with_several_solvers(packages):
    text = (packages / "contact-law" / "README.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^meeframe compare .*$", text, re.MULTILINE)
    assert line.count("--solver") >= 2


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        (
            "contct-law",
            "mine",
            "unknown kind 'contct-law'; did you mean 'contact-law'? allowed: fundamental-solution, ",
        ),
        ("solver", "uzawa", "solver 'uzawa' already exists, provided by meeframe "),
        ("solver", "2nd", "name '2nd': allowed: lower-case letters, digits and hyphens"),
        ("solver", "my_solver", "name 'my_solver': allowed"),
        ("solver", "none", "needs a class None"),
        ("contact-law", "contact-law", "needs a class ContactLaw, a name that Python or meeframe uses"),
    ],
)
def test_invalid_names_are_rejected(tmp_path, kind, name, message):
    status, out, err = invoke("new-plugin", kind, name, "--out", tmp_path / "new")
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert message in err
    assert not (tmp_path / "new").exists()


def test_occupied_folders_are_rejected(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    reported = f"folder {tmp_path} is not empty; name another one with --out, such as {tmp_path / 'meeframe-mine'}"
    status, _, err = invoke("new-plugin", "solver", "mine", "--out", tmp_path)
    assert (status, err) == (2, f"error: {reported}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    status, _, err = invoke("new-plugin", "solver", "mine", "--out", tmp_path / "notes.txt")
    assert status == 2
    assert "cannot be written" in err


def test_existing_folder_is_not_overwritten_without_out(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "meeframe-mine").mkdir()
    (tmp_path / "meeframe-mine" / "notes.txt").write_text("mine")
    status, _, err = invoke("new-plugin", "solver", "mine")
    assert (status, err) == (2, "error: folder meeframe-mine is not empty; name another one with --out\n")


@pytest.mark.parametrize("kind", KINDS)
def test_new_module_imports_the_contract_only(packages, kind):
    """A generated module imports only meeframe.plugin, as stated on docs/howto/plugins.md."""
    text = (packages / kind / f"meeframe_new_{kind.replace('-', '_')}.py").read_text(encoding="utf-8")
    assert set(re.findall(r"^(?:from|import) (meeframe[\w.]*)", text, re.MULTILINE)) == {"meeframe.plugin"}


@pytest.mark.parametrize("kind", KINDS)
def test_tests_of_new_package_import_contract_and_kits_only(packages, kind):
    for file in (packages / kind / "tests").glob("*.py"):
        text = file.read_text(encoding="utf-8")
        modules = {
            ".".join(name.split(".")[:2]) for name in re.findall(r"^(?:from|import) (meeframe\.[\w.]*)", text, re.M)
        }
        assert modules <= {"meeframe.plugin", "meeframe.testing"}


def test_example_formulation_has_one_thickness(packages, tmp_path):
    module, example = (packages / "formulation" / name for name in ("meeframe_new_formulation.py", "example.toml"))
    text = example.read_text(encoding="utf-8")
    (tmp_path / "case.toml").write_text(text.replace('thickness = "0.5 mm"', 'thickness = "1 mm"'), encoding="utf-8")
    status, _, err = invoke("check", tmp_path / "case.toml", "--plugin", module)
    assert status == 2
    assert "thickness = 0.001 m of the layer, but the mesh is 0.0005 to 0.0005 m thick" in err
