"""A short campaign of kills and interruptions, as the command runs it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

KINDS = ("--kind", "run", "--kind", "sweep")
SCRIPT = Path(__file__).parents[3] / "validation" / "campaigns" / "kills.py"


def test_nothing_finished_is_lost():
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--number", "2", "--seed", "9000", *KINDS],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("2 trials, 0 with a violation\n")


def test_interrupted_campaigns_print_their_table(tmp_path):
    """An exception in place of the signal would become a SystemError where h5py reads a file."""
    process = subprocess.Popen(
        [sys.executable, str(SCRIPT), "--number", "10000", "--seed", "1", "--kind", "run"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(tmp_path)},
    )
    while process.poll() is None and not list(tmp_path.glob("*/out/result.h5")):  # of a trial
        time.sleep(0.1)
    time.sleep(1)  # some trials
    process.send_signal(signal.SIGINT)
    printed, errors = process.communicate(timeout=120)
    assert process.returncode == 130, printed + errors
    assert printed.endswith("trials, 0 with a violation\n")
    assert not errors
