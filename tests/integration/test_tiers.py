"""`pytest` runs the default tier and reports how many tests it deselects."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def run(tmp_path):
    """Run pytest on eight tests, of which five belong to the full tier, and return its output."""
    shutil.copy(ROOT / "conftest.py", tmp_path)
    (tmp_path / "pyproject.toml").write_text("[tool.pytest.ini_options]\n")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "test_long.py").write_text("def test_it():\n    pass\n")
    (tmp_path / "test_short.py").write_text(
        "import pytest\n\n"
        "@pytest.mark.parametrize('n', [1, pytest.param(1000, marks=pytest.mark.full)])\n"
        "def test_it(n):\n    pass\n\n"
        "@pytest.mark.full(except_for=2)\n@pytest.mark.parametrize('n', range(5))\n"
        "def test_some(n, pytestconfig):\n    assert n in (0, 4) or pytestconfig.getoption('full')\n"
    )

    def command(*options: str) -> str:
        given = [sys.executable, "-m", "pytest", "--strict-markers", "-p", "no:cacheprovider", *options]
        done = subprocess.run(given, cwd=tmp_path, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stdout
        return done.stdout

    return command


@pytest.mark.full
def test_full_tier_runs_on_request_only(run):
    short, everything = run("-n", "1"), run("--full")
    assert "3 passed" in short
    assert "5 tests of the full tier deselected" in short
    assert "8 passed" in everything
    assert "deselected" not in everything
