"""The page on rough surfaces shows the example, lists all keys and quantities, and its programs run."""

import re
import tomllib
from pathlib import Path

from meeframe.study.rough.declare import RoughTable
from meeframe.study.rough.files import FILES
from meeframe.study.rough.quantities import QUANTITIES

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "howto" / "rough.md").read_text(encoding="utf-8")
EXAMPLE = ROOT / "plugins" / "meeframe-halfspace" / "examples" / "rough-study.toml"


def test_study_of_the_page_is_the_example():
    shown, _ = re.findall(r"^```toml\n(.*?)^```", PAGE, re.DOTALL | re.M)
    assert tomllib.loads(shown) == tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
    assert RoughTable.model_validate(tomllib.loads(shown)).pressures.count == 9


def test_all_keys_quantities_and_files_are_listed():
    listed = {name for row in re.findall(r"^\| (`.*?) \|", PAGE, re.M) for name in re.findall(r"`([\w.]+)`", row)}
    meanings = set(re.findall(r"`(\w+)`", PAGE))
    assert set(RoughTable.model_fields) - {"title"} <= listed
    assert set(QUANTITIES) - {"max_pressure"} <= meanings
    assert {name for name in FILES if not name.endswith((".pdf", ".svg"))} <= listed


def test_programs_run():
    preparation, study = re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.M)
    computed: dict = {}
    exec(preparation, computed)
    assert computed["finer"].shape == (128, 128)
    exec(study, computed)
    assert (computed["data"].status == "converged").all()
