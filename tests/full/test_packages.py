"""Test wheels and sdists of all distributions in a separate environment, without uv and without the repository."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import meeframe

ROOT = Path(__file__).parents[2]
NAMES = ("meeframe", "meeframe_laws", "meeframe_halfspace", "meeframe_hmatrix", "meeframe_skfem")

pytestmark = pytest.mark.skipif(shutil.which("uv") is None, reason="uv builds the distributions")


def run(*command, cwd=None, **variables):
    """Return the standard output of a command that succeeds."""
    done = subprocess.run(
        list(map(str, command)), cwd=cwd, capture_output=True, text=True, timeout=1200, env=os.environ | variables
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def distributions(tmp_path_factory):
    """Return a folder with an sdist, and a wheel made from that sdist, of each distribution."""
    folder = tmp_path_factory.mktemp("dist")
    run("uv", "build", "--quiet", "--all-packages", "--out-dir", folder, cwd=ROOT)
    return folder


@pytest.fixture(scope="module")
def run_installed(tmp_path_factory, distributions):
    """Return a function that runs commands of an environment with the wheels only, in an empty folder."""
    folder = tmp_path_factory.mktemp("empty")
    environment = folder / "environment"
    run(sys.executable, "-m", "venv", environment)
    wheels = [next(distributions.glob(f"{name}-*.whl")) for name in NAMES]
    run("uv", "pip", "install", "--quiet", "--python", environment, *wheels, cwd=folder)
    outside = {"PATH": f"{environment / 'bin'}{os.pathsep}{os.defpath}", "PYTHONPATH": "", "VIRTUAL_ENV": ""}
    outside |= {"NUMBA_CACHE_DIR": str(folder / "kernels"), "PYTHONDONTWRITEBYTECODE": ""}
    assert shutil.which("uv", path=outside["PATH"]) is None

    def command(*arguments):
        return run(environment / "bin" / arguments[0], *arguments[1:], cwd=folder, **outside)

    command.folder = folder
    return command


def test_distributions_contain_code_types_and_licence(distributions):
    for name in NAMES:
        check_distribution(distributions, name)


def check_distribution(distributions, name):
    wheel = zipfile.ZipFile(next(distributions.glob(f"{name}-*.whl"))).namelist()
    with tarfile.open(next(distributions.glob(f"{name}-*.tar.gz"))) as archive:
        source = archive.getnames()
    for files in (wheel, [file.partition("/")[2] for file in source]):
        assert f"{name}/__init__.py" in files
        assert f"{name}/py.typed" in files
        assert any(Path(file).name == "LICENSE" for file in files)
        assert not any("tests" in Path(file).parts for file in files)
        assert in_repository(name) <= set(files)
    if name == "meeframe":
        assert len([file for file in wheel if file.startswith("meeframe/examples/")]) > 5


def in_repository(name):
    """Return the files of a package, relative to the folder of its distribution."""
    folder = ROOT if name == "meeframe" else ROOT / "plugins" / name.replace("_", "-")
    paths = [path for path in (folder / name).rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    return {path.relative_to(folder).as_posix() for path in paths}


def test_wheels_run_a_case_and_new_plugins(run_installed, tmp_path):
    """This is a single test, because it needs one environment."""
    check_case(run_installed, tmp_path)
    check_doctor(run_installed)
    run_installed("meeframe", "example", "rough")
    assert "ok" in run_installed("meeframe", "check", "rough.toml")
    check_new_plugin(run_installed, "contact-law")


def check_case(run_installed, tmp_path):
    """Check the results of a case of the half space, whose kernels are compiled in the least time."""
    assert run_installed("meeframe", "--version").strip() == f"meeframe {meeframe.__version__}"
    run_installed("meeframe", "example", "film")
    case = run_installed.folder / "film.toml"
    text = case.read_text(encoding="utf-8")
    assert "divisions = 40" in text
    case.write_text(text.replace("divisions = 40", "divisions = 12"), encoding="utf-8")
    run_installed("meeframe", "run", "film.toml", "--out", "out")
    step = json.loads((run_installed.folder / "out" / "summary.json").read_text(encoding="utf-8"))["steps"][-1]
    assert step["status"] == "converged"
    location = run_installed("python", "-c", "import meeframe; print(meeframe.__file__)").strip()
    assert ROOT not in Path(location).parents
    here = meeframe.run(case, tmp_path).steps[-1].loading
    assert here.scalars["electric_potential"] != 0.0
    computed = [step["approach"], step["electric_potential"]]
    assert computed == pytest.approx([here.approach, here.scalars["electric_potential"]], rel=1e-6)


def check_doctor(run_installed):
    """Check that `doctor` reports no problem and names what is missing."""
    report = run_installed("meeframe", "doctor")
    assert "0 problems" in report
    assert "pip install 'meeframe[sweep]'" in report
    for name in NAMES[1:]:
        assert name.replace("_", "-") in report
    assert str(run_installed.folder / "kernels") in report


def check_new_plugin(run_installed, kind):
    """Check that a new plugin installs beside meeframe from a wheel, is listed, and passes its tests of conformance.

    Its example, which compiles the kernels of boundary elements and of several solvers, is solved by the tests of
    `new-plugin`.
    """
    run_installed("meeframe", "new-plugin", kind, f"new-{kind}")
    package = run_installed.folder / f"meeframe-new-{kind}"
    run_installed("python", "-m", "pip", "--quiet", "--disable-pip-version-check", "install", f"{package}[test]")
    assert f"new-{kind}" in run_installed("meeframe", "plugins")
    module = f"test_meeframe_new_{kind.replace('-', '_')}.py"
    assert " passed" in run_installed("python", "-m", "pytest", "-q", package / "tests" / module)
