"""Test `meeframe doctor`: versions, caches, plugins, optional packages, exit status."""

import sys
from importlib import metadata
from pathlib import Path

import numba
from typer.testing import CliRunner

import meeframe
from meeframe.cli import app, doctor
from meeframe.plugin import registry
from meeframe.plugin.sources import Broken, Provider

ROOT = Path(__file__).parents[3]


def find_row(plugins=None):
    return {finding.name: finding for finding in doctor.findings(plugins or registry.load())}


def test_versions_and_threads():
    report = find_row()
    assert report["meeframe"].text.startswith(meeframe.__version__)
    for name in ("numpy", "scipy", "numba"):
        assert report[name].text == metadata.version(name)
    assert report["numba threads"].text.startswith(f"{numba.get_num_threads()};")
    assert "threads" in report["BLAS"].text


def test_plugins_with_origin_and_names():
    report = find_row()
    name = next(key for key in report if key.startswith("meeframe-laws "))
    assert name == f"meeframe-laws {metadata.version('meeframe-laws')}"
    assert "tresca" in report[name].text
    assert str(Path(metadata.distribution("meeframe-laws").locate_file("")).resolve()) in report[name].text


def test_missing_package_is_named_with_install_command(monkeypatch):
    version = metadata.version

    def without_xarray(name):
        if name == "xarray":
            raise metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(metadata, "version", without_xarray)
    sweep = find_row()["sweep"]
    assert "missing: xarray; pip install 'meeframe[sweep]'" in sweep.text
    assert not sweep.problem


def test_missing_cupy_is_no_problem(monkeypatch):
    monkeypatch.setitem(sys.modules, "cupy", None)
    cupy = find_row()["cupy"]
    assert "device = 'gpu' of half-space: missing" in cupy.text
    assert not cupy.problem


def test_missing_plugin_is_named_with_install_command():
    report = find_row(registry.Registry(()))
    assert report["meeframe-laws"].text == "not installed; pip install meeframe-laws"


def test_broken_plugin_is_reported(monkeypatch):
    broken = Broken(Provider("meeframe-odd", "1.0"), "it does not load")
    monkeypatch.setattr(registry, "load", lambda: registry.Registry((), (broken,)))
    result = CliRunner().invoke(app, ["doctor"])
    assert result.exit_code == 1
    assert "broken: it does not load" in result.stdout
    assert "1 problem" in result.stdout


def test_unwritable_cache_folder_is_reported(monkeypatch, tmp_path):
    from meeframe.greens._kernels import isotropic

    (tmp_path / "file").touch()
    kernel = next(value for value in vars(isotropic).values() if hasattr(value, "stats"))
    blocked = kernel.stats._replace(cache_path=str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(type(kernel), "stats", property(lambda _: blocked))
    cache = find_row()["kernels"]
    assert cache.problem
    assert "NUMBA_CACHE_DIR" in cache.text


def test_installation_whose_kernels_cannot_be_loaded(monkeypatch):
    def refuse():
        raise RuntimeError("cannot cache function 'f': no locator available for file 'f.py'")

    monkeypatch.setattr(registry, "load", refuse)
    result = CliRunner().invoke(app, ["doctor"])
    assert result.exit_code == 2
    assert "set NUMBA_CACHE_DIR to a writable folder" in result.stderr


def test_command_succeeds():
    result = CliRunner().invoke(app, ["doctor"])
    assert result.exit_code == 0, result.stdout
    assert "0 problems" in result.stdout


def test_version_is_defined_once():
    assert metadata.version("meeframe") == meeframe.__version__
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "pyproject.toml", ROOT / "CITATION.cff")]
    assert all(meeframe.__version__ not in text for text in texts)


def test_every_extra_is_reported():
    extras = set(metadata.metadata("meeframe").get_all("Provides-Extra")) - {"all"}
    assert extras | {"instruments"} <= set(find_row())
