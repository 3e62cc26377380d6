"""The tutorial docs/tutorials/first-friction-law.md works from top to bottom."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

import meeframe
from meeframe.cli import app
from meeframe.plugin.registry import load
from meeframe.testing import check_contact_law

PAGE = Path(__file__).parents[3] / "docs" / "tutorials" / "first-friction-law.md"


def run_block(language: str, text: str) -> None:
    """Save a block that begins with a file name, run a Python block, or run commands line by line."""
    name = re.match(r"# ([\w.]+)\n", text)
    if name:
        Path(name[1]).write_text(text, encoding="utf-8")
    elif language == "python":
        exec(text, {})
    else:
        for line in text.splitlines():
            assert line.startswith("uv run meeframe ")
            done = CliRunner().invoke(app, shlex.split(line)[3:])
            assert done.exit_code == 0, f"{line}\n{done.output}"


@pytest.mark.full
def test_tutorial(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```(python|toml|sh)\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert [language for language, _ in blocks] == ["python", "python", "toml", "sh", "sh", "python", "sh"]
    for language, text in blocks:
        run_block(language, text)
    assert meeframe.read_result(Path("out/dragged")).status == "converged"
    assert Path("meeframe-shear-limit/meeframe_shear_limit.py").exists()


def test_message_shown_on_the_page(tmp_path):
    text = PAGE.read_text(encoding="utf-8")
    source = re.search(r"^```python\n(# shear_limited.py.*?)^```", text, re.DOTALL | re.MULTILINE)[1]
    wrong = tmp_path / "wrong.py"
    wrong.write_text(source.replace("np.minimum(trial[:, 2:], 0.0)", "-np.abs(trial[:, 2:])"), encoding="utf-8")
    law = load(wrong).entries[-1].record.factory(0.4, 2e8)
    with pytest.raises(AssertionError) as caught:
        check_contact_law(law, pressure=5e8)
    assert f"```\n{caught.value}\n```" in text
