"""Commands, examples, links and names on the README and the pages of docs/ are correct."""

import importlib.util
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import meeframe
from meeframe.cli import app
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.model.load import load_case
from meeframe.plugin.registry import load
from meeframe.plugin.sources import BUNDLED_PACKAGES
from meeframe.study.validate import known_cases

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TOP_PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
PAGES = [*TOP_PAGES, *sorted((ROOT / "docs").rglob("*.md"))]
EMII = ROOT / "validation" / "transversely_isotropic_indentation" / "emii.toml"
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def blocks(text: str, *languages: str) -> list[tuple[str, str]]:
    """Return fenced blocks in these languages, as (language, content), in order."""
    matches = re.findall(r"^```(\w+)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return [(language, content) for language, content in matches if language in languages]


def anchors(page: Path) -> set[str]:
    """Return the anchors of the headings of a page, as code hosting sites create them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@each_page
def test_links_have_targets(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if target.startswith(("http://", "https://")):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if (
            file.parent == ROOT / "docs" / "reference" / "api"
        ):  # generated with the site, whose build checks links to it
            continue
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


@each_page
def test_tables_follow_a_blank_line(page):
    """Without one, the site shows a table as text with bars."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert not re.findall(r"^(?! *\|).*\S.*\n *\|.*\|\n *\|[ :|-]+\|$", text, flags=re.MULTILINE)


def names(page: Path, pattern: str) -> Iterator[str]:
    """Yield the matches of a pattern in code of a page, in blocks or inline."""
    for code in re.findall(r"```.*?```|`[^`\n]+`|^    .*$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE):
        yield from re.findall(pattern, code)


@each_page
def test_named_files_exist(page):
    for name in names(page, r"\b(?:[\w-]+/)+[\w.-]+\.(?:py|toml|sh)\b"):
        assert any((folder / name).exists() for folder in (ROOT, ROOT / "meeframe", ROOT / "docs")), name


@each_page
def test_named_modules_and_objects_exist(page):
    for name in names(page, r"(?<![\w/.])meeframe(?:\.\w+)+(?![\w/])"):
        computed = meeframe
        for number, part in enumerate(name.split(".")[1:], 2):
            try:
                computed = importlib.import_module(".".join(name.split(".")[:number]))
            except ModuleNotFoundError:
                assert hasattr(computed, part), name
                computed = getattr(computed, part)


def test_trust_page_lists_every_case():
    """validation/trust.py writes the page from the results of all cases and from trust_head.md: a summary, and all
    checks."""
    page, checks = ((ROOT / "docs" / "validation" / name).read_text("utf-8") for name in ("trust.md", "checks.md"))
    before, after = (ROOT / "validation" / "trust_head.md").read_text("utf-8").split("<!-- summary -->")
    assert page.startswith(before)
    assert page.endswith(after)
    assert len(re.findall(r"\]\(checks\.md#", page)) == len(known_cases(ROOT / "validation"))
    matches = re.findall(r"^`meeframe validate --only (\w+)`$", checks, re.MULTILINE)
    assert matches == sorted(known_cases(ROOT / "validation"))


def test_every_page_is_in_the_index_of_its_section():
    for page in PAGES[len(TOP_PAGES) :]:
        if page.name != "index.md":
            assert f"({page.name})" in (page.parent / "index.md").read_text(encoding="utf-8"), page.name


def test_pictures_exist_and_are_small():
    assert README.index("![") < README.index("## ")
    for name in re.findall(r"\]\((\S+\.png)\)", README):
        assert (ROOT / name).stat().st_size < 300_000


def test_two_commands_do_all_setup():
    """One command runs the main example, the other the tests; continuous integration adds the full tier."""
    (_, job), (_, tests) = blocks(README, "sh")
    setup = "pip install uv && "
    assert job.strip().startswith(setup)
    command = shlex.split(job.strip().removeprefix(setup))
    assert command[:4] == ["uv", "run", "meeframe", "run"]
    assert (ROOT / command[4]) == EMII
    assert f"{tests.strip().removeprefix(setup)} --full" in (ROOT / ".ci" / "run").read_text("utf-8").splitlines()


def test_readme_lists_everything_registered():
    inside = README.split("## What is inside")[1].split("\n## ")[0]
    listed = set(re.findall(r"`([\w-]+)`", inside))
    own = {"meeframe", *(package.replace("_", "-") for package in BUNDLED_PACKAGES)}
    assert listed == {entry.record.name for entry in load().entries if entry.provider.name in own}


def test_law_of_the_readme_fits_the_main_case(tmp_path):
    ((_, text),) = blocks(README, "toml")
    (tmp_path / "case.toml").write_text(EMII.read_text(encoding="utf-8") + text, encoding="utf-8")
    case = load_case(tmp_path / "case.toml")
    assert case.contact_law.mu2 == 0.3
    assert case.conductivity["electric"].kappa == np.inf


def test_defaults_of_the_formulation():
    page = (ROOT / "docs" / "explanation" / "formulation.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| `([^`]+)` \|", page, re.MULTILINE))
    default = DenseBEM()
    assert rows["fundamental_solution"] == type(default.fundamental_solution).__name__.lower()
    assert float(rows["quadrature_tolerance"]) == default.quadrature_tolerance
    assert rows["edge_angle"] == f"{np.degrees(default.edge_angle):g} deg"


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """Return a folder in which the path of the examples leads to the main case on a coarse mesh."""
    copy, text = tmp_path / EMII.relative_to(ROOT), EMII.read_text(encoding="utf-8")
    for fine, coarse in (("divisions = 16", "divisions = 8"), ("rings = 7", "rings = 2")):
        assert fine in text
        text = text.replace(fine, coarse)
    copy.parent.mkdir(parents=True)
    copy.write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.full
def test_python_example_of_the_readme(workplace):
    ((_, text),) = blocks(README, "python")
    namespace: dict = {}
    exec(text, namespace)
    assert namespace["result"].status == "converged"
    assert namespace["pressure"].max() > 0 > namespace["electric_potential"].min()
    assert meeframe.read_result(workplace / "out" / "python").status == "converged"


def tables(text: str) -> dict[str, str]:
    """Return the texts of a case file by table header; tables of one array are joined, top-level keys are under ''."""
    parts: dict[str, str] = {}
    for part in re.split(r"^(?=\[)", text, flags=re.MULTILINE):
        header = part.partition("\n")[0] if part.startswith("[") else ""
        parts[header] = parts.get(header, "") + part.rstrip() + "\n"
    return parts


def save(text: str) -> None:
    """Save a case file of the page: '# new.toml' completely, '# new.toml = old.toml with' tables added or replaced."""
    name, old = re.match(r"# ([\w.]+)(?: = ([\w.]+) with)?\n", text).groups()
    if old:
        text = "".join((tables(Path(old).read_text(encoding="utf-8")) | {**tables(text), "": ""}).values())
    Path(name).write_text(text, encoding="utf-8")


def invoke(command: str) -> None:
    """Run a command of the page, except for installation and the main case, which is tested with the README."""
    arguments = shlex.split(command)
    if arguments[:3] != ["uv", "run", "meeframe"] or (arguments[3] != "check" and Path(arguments[-1]).stem == "emii"):
        return
    done = CliRunner().invoke(app, arguments[3:])
    assert done.exit_code == 0, f"{command}\n{done.output}"


@pytest.mark.full
def test_getting_started(workplace):
    """All case files, commands and programs of the page run in order."""
    page = (ROOT / "docs" / "tutorials" / "getting-started.md").read_text(encoding="utf-8")
    for language, content in blocks(page, "toml", "sh", "python"):
        if language == "toml":
            save(content)
        elif language == "sh":
            for line in content.splitlines():
                invoke(line)
        else:
            exec(content, {})
    results = {path.name: meeframe.read_result(path) for path in (workplace / "out").iterdir()}
    assert set(results) == {"first", "conducting", "friction", "tabulated", "residue"}
    matches = re.findall(r"uncertain\s+by\s+about\s+(\d+) ?%", page + results["first"].steps[-1].message)
    assert len(matches) == 2
    assert matches[0] == matches[1]
    totals = {name: meeframe.resultants(result.zone, result.steps[-1]) for name, result in results.items()}
    assert 0 < totals["friction"].force[0] <= -0.1 * totals["friction"].force[2]
    assert -totals["conducting"].force[2] < -totals["first"].force[2]
    assert totals["conducting"].charge != 0 == totals["first"].charge


def test_each_picture_of_the_pages_has_one_source():
    """docs/make_images.py draws every picture again, by scripts that exist."""
    spec = importlib.util.spec_from_file_location("make_images", ROOT / "docs" / "make_images.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    drawn = [picture for source in module.SOURCES.values() for picture in module.pictures(source)]
    assert sorted(drawn) == sorted((ROOT / "docs").rglob("*.png"))
    for source in module.SOURCES.values():
        assert module.pictures(source)
        for script in source.scripts:
            assert (ROOT / script.split()[0]).is_file()
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert [
        picture.name for picture in drawn if f"/{picture.name})" not in text and f"({picture.name})" not in text
    ] == []
