"""Kill and interrupt commands at random moments, and check that nothing that was finished is lost.

    uv run python validation/campaigns/kills.py --number 200 --seed 1 [--kind run --kind sweep]

Each trial starts a command in a process of its own and ends it, after a random part of its usual duration, by
SIGKILL, SIGTERM, SIGINT, or SIGINT twice. Then the increments or points that can be read must be those of an
undisturbed command, bit for bit; an interruption must end with status 130 and one message. Finally, the same command,
with --overwrite for a run, must complete the work with the same results and leave nothing else in the folder. A
violation is printed with the seed of its trial, and the exit status is 1.
"""

import argparse
import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from threading import Event
from typing import Any, Final, NoReturn

import h5py
import numpy as np

from meeframe.cli import main as command_line
from meeframe.common.errors import ResultError
from meeframe.results.files import read_result
from meeframe.results.records import StepResult

ENDS: Final = ("SIGKILL", "SIGKILL", "SIGTERM", "SIGINT", "SIGINT twice")
INTERRUPTIONS: Final = (signal.SIGINT, signal.SIGTERM)
OUTSIDE_COMMAND: Final = 98
"""Status of a process that is interrupted before its command begins or after it ends."""
BODY: Final = """
title = "killed"
material = { name = "pzt-4" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 8 }
formulation = { name = "half-space" }
indenter = { name = "sphere", radius = "100 mm" }
contact = { law = { name = "isotropic-coulomb", mu = 0.3 } }
"""
PRESS: Final = '{ approach = "10 um", increments = 2 }'
DRAG: Final = '{ translation = ["1 um", 0], increments = 4 }'
BARE: Final = "output = { figures = false, vtu = false }\n"
LONG_PRESS: Final = '{ approach = "10 um", increments = 120 }'  # more than a run holds in memory
WITHOUT_FIGURES: Final = "output = { figures = false }\n"
CASES: Final = {
    "press": f"{BODY}{BARE}steps = [{PRESS}]\n",
    "run": f"{BODY}{BARE}steps = [{PRESS}, {DRAG}]\n",
    "restart": f'{BODY}{BARE}steps = [{DRAG}]\nrestart = {{ from = "press" }}\n',
    "writing": f"{BODY}{WITHOUT_FIGURES}steps = [{LONG_PRESS}]\n",
}
STUDY: Final = 'case = "run.toml"\n[axes]\n"contact.law.mu" = [0.1, 0.2, 0.3, 0.4, 0.5]\n'
KINDS: Final = ("run", "restart", "writing", "sweep")
FIELDS: Final = (
    *("traction", "displacement", "potentials", "fluxes", "slip", "total_slip", "slip_path", "region", "residual"),
    *("initial_gap", "contact_fraction", "dissipation"),
)


@dataclass(frozen=True)
class Outcome:
    """Status of a command, negative for a signal; its output; and its duration [s]."""

    status: int
    output: str
    seconds: float


def command(kind: str, folder: Path, out: Path, *options: str) -> list[str]:
    """Return the arguments of the command of a kind."""
    if kind == "sweep":
        return ["sweep", str(folder / "sweep.toml"), "--out", str(out), "--workers", "1", *options]
    return ["run", str(folder / f"{kind}.toml"), "--out", str(out), *options]


def execute(arguments: Sequence[str], log: Path, signals: Sequence[tuple[float, int]] = ()) -> Outcome:
    """Run a command in a forked process and send it signals, each after a time [s]."""
    begin = time.monotonic()
    log.write_text("", encoding="utf-8")
    signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTIONS)
    child = os.fork()
    if child == 0:
        _serve(arguments, log)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, INTERRUPTIONS)
    for seconds, number in signals:
        time.sleep(seconds)
        os.kill(child, number)  # a process that has ended can be sent signals until it is waited for
    _, status = os.waitpid(child, 0)
    return Outcome(os.waitstatus_to_exitcode(status), log.read_text(), time.monotonic() - begin)


def _serve(arguments: Sequence[str], log: Path) -> NoReturn:
    """Run a command in this process, which never returns to the code from which it was forked."""
    status = 99
    try:
        try:
            file = os.open(log, os.O_WRONLY)
            os.dup2(file, 1)
            os.dup2(file, 2)
            signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore it
            sys.argv = ["meeframe", *arguments]
            signal.pthread_sigmask(signal.SIG_UNBLOCK, INTERRUPTIONS)
            command_line()
        except SystemExit as ended:
            status = int(ended.code or 0)
        except KeyboardInterrupt:
            status = OUTSIDE_COMMAND
        except BaseException:
            traceback.print_exc()
        finally:
            signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTIONS)
            sys.stdout.flush()
            sys.stderr.flush()
    finally:
        os._exit(status)


def differences(found: Sequence[StepResult], expected: Sequence[StepResult]) -> list[str]:
    """Return the fields in which increments differ from the first ones of others."""
    if len(found) > len(expected):
        return [f"{len(found)} increments in place of {len(expected)}"]
    return [
        f"increment {step.step}.{step.increment}: {name}"
        for step, whole in zip(found, expected, strict=False)
        for name in FIELDS
        if not np.array_equal(getattr(step, name), getattr(whole, name), equal_nan=True)
    ]


def steps_in(out: Path) -> Sequence[StepResult]:
    """Return the increments that can be read; none if there is no result. Raises ResultError if it is damaged."""
    return read_result(out).steps if (out / "result.h5").exists() else ()


def points_in(out: Path) -> dict[str, Sequence[StepResult]]:
    """Return the increments of each finished point of a sweep."""
    paths = (out / "points").glob("[0-9a-f]*") if (out / "points").is_dir() else ()
    return {path.name: read_result(path).steps for path in paths}


def dataset(out: Path) -> dict[str, Any]:
    """Return the numbers of a sweep, except for times."""
    with h5py.File(out / "sweep.h5") as file:
        return {name: file[name][()] for name in file if name != "seconds" and isinstance(file[name], h5py.Dataset)}


class Campaign:
    """Trials in a folder, with the results and durations of undisturbed commands."""

    def __init__(self, folder: Path, kinds: Sequence[str] = KINDS) -> None:
        self._folder, self._log = folder, folder / "log"
        for name, text in CASES.items():
            (folder / f"{name}.toml").write_text(text, encoding="utf-8")
        (folder / "sweep.toml").write_text(STUDY, encoding="utf-8")
        for name in ("press", *kinds):  # in this process, which compiles and imports what all others then share
            sys.argv = ["meeframe", *command(name, folder, folder / name)]
            with redirect_stdout(StringIO()), redirect_stderr(StringIO()), suppress(SystemExit):
                command_line()
        self._durations = {
            kind: execute(command(kind, folder, folder / "undisturbed" / kind), self._log).seconds for kind in kinds
        }

    def trial(self, seed: int) -> tuple[str, list[str]]:
        """Return a description of a trial and the violations."""
        random = np.random.default_rng([seed, 28])
        kind = list(self._durations)[seed % len(self._durations)]
        end = ENDS[int(random.integers(len(ENDS)))]
        moment = float(random.uniform(0.0, 1.05) * self._durations[kind])
        number = getattr(signal, end.partition(" ")[0])
        signals = [(moment, number)]
        if end.endswith("twice"):
            signals.append((float(random.uniform(0.0, 0.05)), number))
        out = self._folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        done = execute(command(kind, self._folder, out), self._log, signals)
        try:
            problems = self._status(done, number)
            count, lost = self._finished(kind, out)
            problems += lost + self._completed(kind, out)
        except (ResultError, OSError, KeyError) as error:
            return f"{kind}, {end}", [f"{type(error).__name__}: {error}"]
        return f"{kind}, {end}, {count} finished", problems

    def _status(self, done: Outcome, number: int) -> list[str]:
        lines = [line for line in done.output.splitlines() if not line.startswith("warning: ")]
        if "Traceback" in done.output:
            return [done.output]
        if done.status in (0, OUTSIDE_COMMAND, -number):  # it was faster, or had not begun
            return []
        if number == signal.SIGKILL or done.status != 130:
            return [f"status {done.status}: {done.output}"]
        if lines and "interrupted" in lines[-1]:  # a second interruption may leave the line of a progress bar open
            return []
        return [f"status 130 with the output: {done.output!r}"]

    def _finished(self, kind: str, out: Path) -> tuple[int, list[str]]:
        if kind != "sweep":
            found = steps_in(out)
            return len(found), differences(found, steps_in(self._folder / kind))
        expected, points = points_in(self._folder / kind), points_in(out)
        return len(points), [f"{key}: {each}" for key in points for each in differences(points[key], expected[key])]

    def _completed(self, kind: str, out: Path) -> list[str]:
        before = points_in(out)
        done = execute(command(kind, self._folder, out, *([] if kind == "sweep" else ["--overwrite"])), self._log)
        if done.status:
            return [f"repeated: status {done.status}: {done.output}"]
        if kind != "sweep":
            again, whole = steps_in(out), steps_in(self._folder / kind)
            left = [path.name for path in out.rglob("*") if path.name.startswith(".") or "increments" in path.name]
            problems = [f"repeated: {each}" for each in (*differences(again, whole), *left)]
            return problems if len(again) == len(whole) else [*problems, f"repeated: {len(again)} increments"]
        again, whole = dataset(out), dataset(self._folder / kind)
        problems = [name for name in whole if not np.array_equal(again[name], whole[name])]
        return problems + [key for key in before if len(before[key]) != len(points_in(out)[key])]


def main() -> int:
    """Run trials and print their table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--number", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the first trial; the others follow")
    parser.add_argument("--kind", action="append", choices=KINDS, help="repeatable; all by default")
    options = parser.parse_args()
    if os.environ.get("NUMBA_NUM_THREADS") != "1":  # processes with threads of numba cannot be forked
        environment = os.environ | {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        os.execve(sys.executable, [sys.executable, *sys.argv], environment)
    counts: Counter[str] = Counter()
    defects = 0
    interrupted = Event()
    # h5py turns an exception that is raised while it reads a file into one of HDF5
    signal.signal(signal.SIGINT, lambda *_: interrupted.set())
    with tempfile.TemporaryDirectory() as temporary:
        campaign = Campaign(Path(temporary), options.kind or KINDS)
        for seed in range(options.seed, options.seed + options.number):
            words, problems = campaign.trial(seed)
            if interrupted.is_set():  # a terminal interrupts the command of the trial, too
                break
            counts[words] += 1
            defects += bool(problems)
            for problem in problems:
                print(f"{seed}: {words}: {problem}", flush=True)
    for words, count in sorted(counts.items()):
        print(f"{words:40} {count}")
    print(f"{counts.total()} trials, {defects} with a violation")
    return 130 if interrupted.is_set() else int(defects > 0)


if __name__ == "__main__":
    sys.exit(main())
