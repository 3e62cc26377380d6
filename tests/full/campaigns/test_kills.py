"""A short campaign of kills and interruptions, as the command runs it."""

import subprocess
import sys
from pathlib import Path

KINDS = ("--kind", "run", "--kind", "sweep")
SCRIPT = Path(__file__).parents[3] / "validation" / "campaigns" / "kills.py"


def test_nothing_finished_is_lost():
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--number", "4", "--seed", "9000", *KINDS],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("4 trials, 0 with a violation\n")
