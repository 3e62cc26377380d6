"""Shell completion offers commands and options."""

import pytest
from typer.testing import CliRunner

from meeframe.cli import app


@pytest.mark.parametrize(
    ("typed", "completed"),
    [("meeframe sw", "sweep"), ("meeframe fclib e", "export"), ("meeframe run case.toml --ov", "--overwrite")],
)
def test_commands_and_options_are_completed(typed, completed):
    asked = {"_MEEFRAME_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
    assert CliRunner().invoke(app, env=asked, prog_name="meeframe").stdout.split() == [completed]
