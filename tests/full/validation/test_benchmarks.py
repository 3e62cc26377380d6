"""docs/performance.md: what validation/benchmarks makes of its records; nothing is measured here."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
BENCHMARKS = ROOT / "validation" / "benchmarks"
MACHINE = {"date": "2026-11-23", "commit": "0d378ea+", "processor": "one", "cores": 2, "load": 0.14}
MACHINE |= {"versions": {"numpy": "2.4.6", "tamaas": "2.9.0"}}


def said(script, folder) -> subprocess.CompletedProcess[str]:
    """What a script prints, in a process of its own: the benchmarks are scripts side by side."""
    script = f"import sys; from pathlib import Path; folder = Path(sys.argv[1]); {script}"
    return subprocess.run([sys.executable, "-c", script, folder], cwd=BENCHMARKS, capture_output=True, text=True)


def page_of(folder, records) -> subprocess.CompletedProcess[str]:
    """The page of these records."""
    for name, record in records.items():
        (folder / f"{name}.json").write_text(json.dumps(record))
    return said("import report; report.RECORDS = folder; print(report.page(folder), end='')", folder)


def test_performance_is_what_the_records_say(tmp_path):
    done = said("import report; print(report.page(folder), end='')", tmp_path)
    assert done.returncode == 0, done.stderr
    page = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    assert page == done.stdout, "write it anew: python validation/benchmarks/report.py --page"
    for picture in tmp_path.iterdir():
        assert (ROOT / "docs" / "images" / picture.name).exists(), picture.name


def test_a_part_with_an_old_record_says_so_on_the_page_of_the_others(tmp_path):
    old = {"machine": {"cores": 2, "processor": "one", "load": 0.1}}
    whole = json.loads((BENCHMARKS / "records" / "start_up.json").read_text(encoding="utf-8"))
    done = page_of(tmp_path, {"kernels": old, "start_up": whole | {"machine": MACHINE}})
    assert done.returncode == 0, done.stderr
    assert "To be measured again" in done.stdout.partition("## Start-up")[0]
    assert "To be measured again" not in done.stdout.partition("## Start-up")[2]
    assert "kernels: its record has no" in done.stderr
    line = "2026-11-23, commit 0d378ea+, on 2 cores of one; load average when it began: 0.1; numpy 2.4.6, tamaas 2.9.0."
    assert line in " ".join(done.stdout.split())


@pytest.mark.parametrize(("changed", "mark"), [("docs", ""), ("meeframe", "+"), ("plugins", "+")])
def test_commits_of_changed_code_are_marked(tmp_path, changed, mark):
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
    done = said("import common; common.ROOT = folder; print(common.circumstances()['commit'])", tmp_path)
    commit = done.stdout.strip()
    assert head.startswith(commit.removesuffix("+")), done.stderr
    assert commit.removesuffix("+")
    assert commit.endswith("+") == bool(mark)


def answer(solved, residual=5e-11, apart=0.0) -> dict:
    return {"built": 0.5, "solved": solved, "clock": solved, "iterations": 7, "turns": 1, "residual": residual} | {
        "apart": apart,
        "area": 0.1,
        "mean_gap": 1e-5,
        "approach_error": 1e-6,
        "pressure_error": 1e-3,
    }


def frictionless(**others) -> dict:
    """A record of 512 x 512 nodes in which ours takes half a second to make and half to solve."""
    row = {"meeframe": answer(0.5)} | others | {"meeframe, two threads": answer(0.4)}
    return {"machine": MACHINE} | {name: {"512": row} for name in ("sphere", "rough, periodic", "rough, free")}


def test_the_better_of_the_others_is_what_counts(tmp_path):
    met = frictionless(Tamaas=answer(20.0), ContactMechanics=answer(6.0, apart=1e-9))
    page = page_of(tmp_path, {"half_space": met}).stdout
    asked = "sphere, 512 x 512: at least 6 times faster than the better of the others"
    assert f"| {asked} | 12.0; operators included 6.5 | met |" in page
    assert "**not met**" not in page
    assert "would still be 12.6 times faster" in " ".join(page.split())
    assert "0.80 to 0.80 times as long by the clock" in " ".join(page.split())
    assert (tmp_path / "half_space_periodic.png").exists()
    slow = frictionless(Tamaas=answer(5.0, residual=1e-12), ContactMechanics=answer(6.0, apart=1e-7))
    page = page_of(tmp_path, {"half_space": slow}).stdout
    assert f"| {asked} | 10.0; operators included 5.5 | **not met** |" in page
    assert "| mean gaps of all codes equal to 1e-08 of the depth | 1e-07 | **not met** |" in page


def test_residuals_are_judged_by_what_all_are_asked_for(tmp_path):
    coarse = frictionless(Tamaas=answer(20.0, 1e-12), ContactMechanics=answer(20.0))
    coarse["sphere"]["512"]["meeframe"]["residual"] = 2e-10
    page = page_of(tmp_path, {"half_space": coarse}).stdout
    assert "or that of the best other code | 2e-10 | **not met** |" in page
    for code in ("Tamaas", "ContactMechanics"):
        coarse["sphere"]["512"][code]["residual"] = 3e-10
    page = page_of(tmp_path, {"half_space": coarse}).stdout
    assert "or that of the best other code | 2e-10 | met |" in page


@pytest.mark.parametrize(("theirs", "word"), [(1e-6, "met"), (1e-9, "**not met**")])
def test_friction_is_to_converge_where_others_do_not(tmp_path, theirs, word):
    def one(residual, products=40):
        times = {"seconds": 1.0, "processor": 1.0, "built": 0.1, "iterations": 5, "products": products}
        return times | {"residual": residual, "force": 1e-12, "traction": 0.07, "difference": 0.01}

    periodic = {"meeframe": one(1e-11), "Tamaas, Condat, 10000 iterations": one(theirs)}
    record = {"machine": MACHINE, "free": {"64": one(1e-11), "512": one(2e-9, 80)}, "periodic": {"64": periodic}}
    page = page_of(tmp_path, {"half_space_friction": record}).stdout
    assert "| residual at most 1e-08 on every grid | 2e-09 | met |" in page
    assert f"| where Tamaas does not reach it | {theirs:.0e} at best | {word} |" in page
    assert "| 2.00, slope 0.33 | **not met** |" in page
