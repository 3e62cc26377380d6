"""docs/validation/performance.md agrees with the records of validation/benchmarks; nothing is measured."""

import importlib
import json
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[3]
BENCHMARKS = ROOT / "validation" / "benchmarks"
MACHINE = {"date": "2026-11-23", "commit": "0d378ea+", "processor": "one", "cores": 2, "load": 0.14}
MACHINE |= {"versions": {"numpy": "2.4.6", "tamaas": "2.9.0"}}


@pytest.fixture(scope="module")
def benchmarks():
    """Return the modules `report` and `common` of the benchmarks, which are no package."""
    before, path = set(sys.modules), str(BENCHMARKS)
    sys.path.insert(0, path)
    yield SimpleNamespace(report=importlib.import_module("report"), common=importlib.import_module("common"))
    sys.path.remove(path)
    for name in set(sys.modules) - before:
        if (getattr(sys.modules[name], "__file__", None) or "").startswith(path):
            del sys.modules[name]


@pytest.fixture
def page_of(benchmarks, tmp_path, monkeypatch):
    """Return a function that returns the page of some records, with its pictures in the temporary folder."""

    def page(records) -> str:
        for name, record in records.items():
            (tmp_path / f"{name}.json").write_text(json.dumps(record))
        monkeypatch.setattr(benchmarks.report, "RECORDS", tmp_path)
        return benchmarks.report.page(tmp_path)

    return page


def test_page_matches_the_records(benchmarks, tmp_path):
    page = (ROOT / "docs" / "validation" / "performance.md").read_text(encoding="utf-8")
    assert page == benchmarks.report.page(tmp_path), "regenerate it: python validation/benchmarks/report.py --page"
    for picture in tmp_path.iterdir():
        assert (ROOT / "docs" / "images" / picture.name).exists(), picture.name


def test_outdated_record_is_marked_on_the_page(page_of, capsys):
    old = {"machine": {"cores": 2, "processor": "one", "load": 0.1}}
    whole = json.loads((BENCHMARKS / "records" / "start_up.json").read_text(encoding="utf-8"))
    page = page_of({"kernels": old, "start_up": whole | {"machine": MACHINE}})
    assert "To be measured again" in page.partition("## Start-up")[0]
    assert "To be measured again" not in page.partition("## Start-up")[2]
    assert "kernels: its record has no" in capsys.readouterr().err
    line = "2026-11-23, commit 0d378ea+, on 2 cores of one; load average at the start 0.1; numpy 2.4.6, tamaas 2.9.0."
    assert line in " ".join(page.split())


@pytest.mark.parametrize(("changed", "mark"), [("docs", ""), ("meeframe", "+"), ("plugins", "+")])
def test_commits_of_changed_code_are_marked(benchmarks, tmp_path, monkeypatch, changed, mark):
    if shutil.which("git") is None:
        pytest.skip("needs git")
    git = ("git", "-c", "user.name=a", "-c", "user.email=a@b", "-C", str(tmp_path))
    for name in ("docs", "meeframe", "plugins"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_text("1")
    for words in (("init", "-q"), ("add", "."), ("commit", "-qm", "all")):
        subprocess.run((*git, *words), check=True)
    head = subprocess.run((*git, "rev-parse", "HEAD"), check=True, capture_output=True, text=True).stdout
    (tmp_path / changed / "file").write_text("2")
    monkeypatch.setattr(benchmarks.common, "ROOT", tmp_path)
    commit = benchmarks.common.circumstances()["commit"]
    assert head.startswith(commit.removesuffix("+"))
    assert commit.removesuffix("+")
    assert commit.endswith("+") == bool(mark)


def answer(solved, residual=5e-11, gap_difference=0.0) -> dict:
    return {
        "setup": 0.5,
        "solution": solved,
        "solution_wall": solved,
        "iterations": 7,
        "repetitions": 1,
        "residual": residual,
    } | {
        "gap_difference": gap_difference,
        "area": 0.1,
        "mean_gap": 1e-5,
        "approach_error": 1e-6,
        "pressure_error": 1e-3,
    }


def frictionless(**others) -> dict:
    """Return a record on 512 x 512 nodes in which meeframe takes half a second each to set up and to solve."""
    row = {"meeframe": answer(0.5)} | others | {"meeframe, two threads": answer(0.4)}
    return {"machine": MACHINE} | {name: {"512": row} for name in ("sphere", "rough, periodic", "rough, free")}


def test_factor_is_relative_to_the_fastest_code(page_of, tmp_path):
    met = frictionless(ASPHER=answer(8.0), Tamaas=answer(20.0), ContactMechanics=answer(6.0, gap_difference=1e-9))
    page = page_of({"half_space": met})
    quantity = "sphere, 512 x 512: speed relative to the fastest of the other codes"
    assert f"| {quantity} | 12.0 times; with set-up 6.5 times |" in page
    assert "meeframe is 12.6 times faster" in " ".join(page.split())
    assert "0.80 to 0.80 times the wall time of one thread" in " ".join(page.split())
    assert (tmp_path / "half_space_periodic.png").exists()
    slow = frictionless(Tamaas=answer(5.0, residual=1e-12), ContactMechanics=answer(6.0, gap_difference=1e-7))
    page = page_of({"half_space": slow})
    assert f"| {quantity} | 10.0 times; with set-up 5.5 times |" in page
    assert "| largest difference of mean gaps between codes, relative to the depth | 1e-07 |" in page


def test_largest_residuals_are_shown(page_of):
    coarse = frictionless(Tamaas=answer(20.0, 1e-12), ContactMechanics=answer(20.0))
    coarse["sphere"]["512"]["meeframe"]["residual"] = 2e-10
    page = page_of({"half_space": coarse})
    assert "| largest residual of meeframe | 2e-10 |" in page
    assert "| largest residual of the other codes | 5e-11 |" in page
    for code in ("Tamaas", "ContactMechanics"):
        coarse["sphere"]["512"][code]["residual"] = 3e-10
    page = page_of({"half_space": coarse})
    assert "| largest residual of the other codes | 3e-10 |" in page


@pytest.mark.parametrize("theirs", [1e-6, 1e-9])
def test_residuals_and_products_of_friction_are_shown(page_of, theirs):
    def one(residual, products=40):
        times = {"seconds": 1.0, "processor": 1.0, "setup": 0.1, "iterations": 5, "products": products}
        return times | {"residual": residual, "force": 1e-12, "traction": 0.07, "difference": 0.01}

    periodic = {"meeframe": one(1e-11), "Tamaas, Condat, 10000 iterations": one(theirs)}
    record = {"machine": MACHINE, "free": {"64": one(1e-11), "512": one(2e-9, 80)}, "periodic": {"64": periodic}}
    page = page_of({"half_space_friction": record})
    assert "| largest residual of meeframe, free surface | 2e-09 |" in page
    assert f"| smallest residual of Tamaas, periodic surface | {theirs:.0e} |" in page
    assert "| 2.00 times at most, slope 0.33 |" in page
