"""Test `meeframe sweep`: grids and lists on springs with closed forms; resumption after interruptions and kills."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
import xarray
from typer.testing import CliRunner

import meeframe
from meeframe.cli import app

PLUGIN = Path(__file__).with_name("slow_springs.py")
DEPTHS = np.linspace(1e-5, 4e-5, 8)
FREE = 4  # points of eight before the others are delayed; workers that check at the same time solve one more
PATIENCE = 240  # seconds until a test fails; usually it waits for a few seconds only

# timeout of Dask, for disks or machines that pause for a second
pytestmark = pytest.mark.filterwarnings("ignore:Creating scratch directories is taking")

GRID = """
title = "springs"
case = "case.toml"
fields = ["pressure"]

[axes]
"formulation.stiffness" = [1e14, 2e14]
"steps[1].approach" = ["10 um", "0.02 mm", "-1 um"]

[axes.law]
smooth = {}
rough = { "contact.law" = { name = "isotropic-coulomb", mu = 0.3 } }

[[plots]]
quantities = ["normal_force", "max_pressure"]
lines = "formulation.stiffness"
at = { law = "rough" }

[[plots]]
quantities = ["contact_area"]
kind = "map"
"""

LINE = """
case = "case.toml"
[axes]
"steps[1].approach" = { from = 1e-5, to = 4e-5, count = 8 }
"""


@pytest.fixture
def study(write_case, tmp_path):
    """Return a function that writes a study of the springs beside their case and returns its path.

    `free` is the number of points that are solved before the others wait until the file written here is removed.
    """

    def write(text, free=None):
        if free is not None:
            (tmp_path / "held").touch()
        log = json.dumps(str(tmp_path / "log"))
        write_case(
            ('name = "winkler"', f'name = "springs"\nlog = {log}'),
            ("[[steps]]", f'[solver]\nname = "slow"\nlog = {log}\nfree = {free or 0}\n\n[[steps]]'),
        )
        path = tmp_path / "sweep.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def release(tmp_path):
    """Let delayed points continue."""
    return (tmp_path / "held").unlink


@pytest.fixture
def log(tmp_path):
    """Return a function that returns the logged reductions or solutions since the beginning."""

    def lines(kind):
        path = tmp_path / "log"
        return [line for line in path.read_text().splitlines() if line.startswith(kind)] if path.exists() else []

    return lines


def command(study, out, *options):
    return ["sweep", str(study), "--out", str(out), "--plugin", str(PLUGIN), *map(str, options)]


def sweep(study, out, *options):
    """Return exit status, standard output and standard error of a sweep in this process."""
    workers = () if {"--workers", "--threads"} & set(options) else ("--workers", 1)
    result = CliRunner().invoke(app, command(study, out, *workers, *options))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


def read_dataset(out):
    with xarray.open_dataset(out / "sweep.h5", engine="h5netcdf") as dataset:
        return dataset.load()


def files(out):
    """Return the result files of the points, each with properties that change if it is written again."""
    paths = (path for path in out.glob("points/*/result.h5") if not path.parent.name.startswith("."))
    return {path.parent.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in paths}


def test_grid_end_to_end(study, tmp_path, log):
    out, file = tmp_path / "out", study(GRID)
    status, output, _ = sweep(file, out)
    assert status == 0
    assert output.count("converged") == 12
    dataset = read_dataset(out)
    assert dict(dataset.sizes) == {"formulation.stiffness": 2, "steps[1].approach": 3, "law": 2, "y": 5, "x": 5}
    assert dataset.zone_pressure.dims[-2:] == ("y", "x")
    assert (dataset.x.units, dataset.y.units, dataset.z.ndim) == ("m", "m", 0)
    np.testing.assert_allclose(dataset["steps[1].approach"], [1e-5, 2e-5, -1e-6])
    assert dataset["steps[1].approach"].units == "m"
    assert list(dataset["law"].values) == ["smooth", "rough"]
    expected = dataset["formulation.stiffness"] * np.maximum(dataset["steps[1].approach"], 0.0)
    np.testing.assert_allclose(dataset.max_pressure, expected.broadcast_like(dataset.max_pressure), rtol=1e-9)
    assert (dataset.max_pressure.units, dataset.normal_force.units, dataset.zone_pressure.units) == ("Pa", "N", "Pa")
    assert (dataset.max_pressure.long_name, dataset.zone_pressure.long_name) == ("largest pressure", "contact pressure")
    depth = np.maximum(dataset["steps[1].approach"] - (dataset.x**2 + dataset.y**2) / 0.2, 0.0)
    pressure = dataset["formulation.stiffness"] * depth
    np.testing.assert_allclose(
        dataset.zone_pressure, pressure.broadcast_like(dataset.zone_pressure), rtol=1e-6, atol=1.0
    )
    assert (dataset.status == "converged").all()
    assert len(log("reduced")) == 2, "points that differ in law and load share a reduced system"
    assert len(log("solved")) == 12
    assert (out / "sweep.png").read_bytes().startswith(b"\x89PNG")

    point = out / "points" / str(dataset.key[1, 1, 0].item())
    result = meeframe.read_result(point)
    assert meeframe.resultants(result.zone, result.steps[-1]).max_pressure == float(dataset.max_pressure[1, 1, 0])
    assert CliRunner().invoke(app, ["show", str(point)]).exit_code == 0
    (point / "case.toml").write_text(result.provenance.case_text)
    checked = CliRunner().invoke(app, ["check", str(point / "case.toml"), "--plugin", str(PLUGIN)])
    assert checked.exit_code == 0, "the result holds the point's own case"

    before = files(out)
    assert sweep(file, out)[0] == 0
    assert files(out) == before
    assert len(log("solved")) == 12, "the second time nothing is computed"
    xarray.testing.assert_identical(read_dataset(out), dataset)


@pytest.mark.full
def test_longer_axis_reuses_finished_points(study, tmp_path, log):
    out, shorter = tmp_path / "out", LINE.replace("4e-5, count = 8", "2e-5, count = 2")
    assert sweep(study(shorter), out)[0] == 0
    before = files(out)
    longer = study(LINE.replace("4e-5, count = 8", "3e-5, count = 3"))
    status, _, complained = sweep(longer, out)
    assert status == 2
    assert f"folder {out} holds another sweep, 2 of its 2 points are in this one of 3" in complained
    assert files(out) == before
    assert sweep(longer, out, "--overwrite")[0] == 0
    assert before.items() <= files(out).items()
    assert len(log("solved")) == 3
    np.testing.assert_allclose(read_dataset(out).max_pressure, [1e9, 2e9, 3e9])
    assert sweep(study(shorter), out, "--overwrite")[0] == 0
    assert files(out) == before, "what is no longer asked for is removed"


@pytest.mark.full
def test_changed_case_is_rejected(study, tmp_path, write_case):
    out, file = tmp_path / "out", study(LINE)
    assert sweep(file, out)[0] == 0
    case = tmp_path / "case.toml"
    case.write_text("# a comment\n" + case.read_text())
    assert sweep(file, out)[0] == 0, "what does not change the result does not count"
    case.write_text(case.read_text().replace('"100 mm"', '"101 mm"'))
    status, _, complained = sweep(file, out)
    assert status == 2
    assert "0 of its 8 points are in this one of 8" in complained


@pytest.mark.full
def test_folder_with_other_files_is_left_unchanged(study, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.tex").write_text("")
    status, _, complained = sweep(study(LINE), out)
    assert status == 2
    assert f"output folder {out} is not empty (thesis.tex)" in complained
    assert sweep(study(LINE), out, "--overwrite")[0] == 0
    assert (out / "thesis.tex").exists()


@pytest.mark.full
def test_failed_points_do_not_stop_the_others(study, tmp_path, log):
    text = """
        case = "case.toml"
        points = [
            { label = "good", value = 1 },
            { label = "no case", value = 2, set = { "indenter.radius" = "-1 mm" } },
            { label = "does not converge", value = 3, set = { "solver" = { name = "uzawa", max_iterations = 1 } } },
            { label = "is refused", value = 4, set = { "solver" = "projected-cg", "contact.law" = { name = "isotropic-coulomb", mu = 0.1 } } },
            { label = "mesh", value = 5, set = { "mesh.divisions" = 6 } },
        ]
    """  # fmt: skip  # noqa: E501
    out, file = tmp_path / "out", study(text)
    status, output, _ = sweep(file, out)
    assert status == 1
    dataset = read_dataset(out)
    assert list(dataset.status.values) == ["converged", "refused", "not-converged", "refused", "converged"]
    np.testing.assert_array_equal(dataset.point, [1.0, 2.0, 3.0, 4.0, 5.0])
    assert np.isnan(dataset.max_pressure[[1, 3]]).all()
    assert "indenter.radius" in str(dataset.message[1].item())
    assert "frictionless" in str(dataset.message[3].item())
    assert "no case: refused: indenter.radius" in output
    before = files(out)
    solved = len(log("solved"))
    assert sweep(file, out)[0] == 1
    assert (files(out), len(log("solved"))) == (before, solved)


@pytest.mark.full
def test_zones_of_different_meshes_and_every_increment(study, tmp_path):
    text = """
        case = "case.toml"
        fields = ["pressure"]
        every_increment = true
        set = { "steps[1].increments" = 2 }
        [axes.size]
        "mesh.divisions" = [2, 4]
        "mesh.rings" = [3, 2]
    """
    out = tmp_path / "out"
    assert sweep(study(text), out)[0] == 0
    dataset = read_dataset(out)
    assert dataset.zone_pressure.dims == ("size", "node")
    assert dataset.x.dims == ("size", "node")
    np.testing.assert_array_equal(dataset["size"], [2, 4])
    assert (~np.isnan(dataset.zone_pressure)).sum("node").values.tolist() == [9, 25]
    np.testing.assert_allclose(dataset.max_pressure, [[5e8, 1e9]] * 2)


@contextmanager
def start_process(*arguments, output_file=os.devnull):
    """Yield a process in a separate process group that writes its output to a file; it is killed with its children
    at the end."""
    with open(output_file, "w") as file:
        process = psutil.Popen(
            [sys.executable, *map(str, arguments)], stdout=file, stderr=subprocess.STDOUT, start_new_session=True
        )
    try:
        yield process
    finally:
        gone = process.poll() is not None
        for each in () if gone else (*process.children(recursive=True), process):
            with suppress(psutil.NoSuchProcess):
                each.kill()
        process.wait()


def wait_for(condition, process):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.02)


def workers_of(process):
    """Return the active worker processes; others may start and end meanwhile."""
    computed = []
    for child in process.children():
        with suppress(psutil.NoSuchProcess):  # includes zombies
            if "multiprocessing.spawn" in " ".join(child.cmdline()):
                computed.append(child)
    return computed


def assert_as_uninterrupted(study, out, tmp_path):
    """Assert that results equal those of an uninterrupted sweep bit for bit, except for times."""
    assert_done(sweep(study, tmp_path / "whole"))
    dataset, expected = read_dataset(out).drop_vars("seconds"), read_dataset(tmp_path / "whole").drop_vars("seconds")
    xarray.testing.assert_identical(dataset, expected)
    np.testing.assert_allclose(dataset.max_pressure, 1e14 * DEPTHS, rtol=1e-9)


# background jobs of a shell ignore SIGINT, and so do their children
MAIN = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "from meeframe.cli import main; main()"
)  # fmt: skip


@pytest.mark.full
@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGTERM])
def test_resumes_after_its_process_ends(study, tmp_path, log, release, death, monkeypatch):
    out, file, message = tmp_path / "out", study(LINE, free=FREE), tmp_path / "told"
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setenv("TMPDIR", str(scratch))
    with start_process("-c", MAIN, *command(file, out, "--workers", 2), output_file=message) as process:
        wait_for(lambda: len(files(out)) >= 2, process)
        children = process.children(recursive=True)
        if death is signal.SIGINT:
            os.killpg(process.pid, death)  # as from a terminal: also to its workers
        else:
            process.send_signal(death)
        status = process.wait(timeout=PATIENCE)
    psutil.wait_procs(children, timeout=PATIENCE)
    before, solved = files(out), log("solved")
    release()
    assert 2 <= len(before) < len(DEPTHS)
    assert (out / "sweep.h5").exists() == (death is not signal.SIGKILL)
    if death is not signal.SIGKILL:
        partial = read_dataset(out)
        assert (partial.status == "converged").sum() == len(before)
        assert (partial.status == "unfinished").sum() == len(DEPTHS) - len(before)
        assert (np.isnan(partial.max_pressure) == (partial.status == "unfinished")).all()
        assert not list(scratch.iterdir()), "nothing is left of the processes"
        assert status == 130, message.read_text()
        assert f"of 8 points are finished and in {out}; the same command continues" in message.read_text()
        assert "Traceback" not in message.read_text()
    assert_done(sweep(file, out))
    assert_nothing_twice(out, log, before, solved)
    assert_as_uninterrupted(file, out, tmp_path)


@pytest.mark.full
def test_interrupted_while_processes_start(study, tmp_path, log, monkeypatch):
    out, file, message = tmp_path / "out", study(LINE, free=0), tmp_path / "told"
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setenv("TMPDIR", str(scratch))
    with start_process("-c", MAIN, *command(file, out, "--workers", 2), output_file=message) as process:
        wait_for(lambda: workers_of(process), process)
        children = process.children(recursive=True)
        os.killpg(process.pid, signal.SIGINT)  # as from a terminal: also to its workers
        status = process.wait(timeout=PATIENCE)
    psutil.wait_procs(children, timeout=PATIENCE)
    assert not any(child.is_running() for child in children)
    assert status == 130, message.read_text()
    assert message.read_text().splitlines()[-1] == (
        f"interrupted; 0 of 8 points are finished and in {out}; the same command continues"
    )
    assert "Traceback" not in message.read_text()
    assert not list(scratch.iterdir())
    assert not log("solved")


def assert_done(ended):
    status, _, complained = ended
    assert status == 0, complained


def assert_nothing_twice(out, log, before, solved):
    """Assert that nothing was solved twice; `before` and `solved` are finished files and logged solutions at the
    kill."""
    assert before.items() <= files(out).items(), "finished points are not written again"
    again = [line for line in log("solved")[len(solved) :] if line in solved]
    assert len(again) <= len(solved) - len(before), "nor computed: only those in flight are"
    assert len(log("reduced")) == 1, "nor the reduced system"


@pytest.mark.full
def test_survives_killed_workers(study, tmp_path, log, release):
    out, file, message = tmp_path / "out", study(LINE, free=6), tmp_path / "told"
    with start_process("-m", "meeframe", *command(file, out, "--workers", 2), output_file=message) as process:
        wait_for(lambda: len(files(out)) >= 6, process)  # all points are assigned, and the others are delayed
        time.sleep(1)  # within milliseconds, the scheduler learns that these are no longer needed
        before, solved = files(out), log("solved")
        workers = workers_of(process)
        assert len(workers) == 2
        for worker in workers:
            worker.kill()
        release()
        status = process.wait(timeout=PATIENCE)
    assert status == 0, message.read_text()
    assert_nothing_twice(out, log, before, solved)
    assert_as_uninterrupted(file, out, tmp_path)


@pytest.mark.full
@pytest.mark.parametrize(
    ("axis", "reductions"),
    [
        ('"formulation.stiffness" = [1e14, 2e14]', ["2", "1"]),
        ('"mesh.divisions" = [2, 3, 4, 5, 6, 7, 8, 9]', ["1"] * 8),
    ],
    ids=["the second beside points", "none shared"],
)
def test_first_reductions_use_the_threads_of_waiting_processes(study, tmp_path, log, axis, reductions):
    file = study(f"{LINE}{axis}\n" if "mesh" not in axis else LINE.partition('"steps')[0] + axis)
    assert sweep(file, tmp_path / "out", "--workers", 2)[0] == 0
    of_reductions = [line for line in log("threads") if "reduction" in line]
    assert sorted(of_reductions) == sorted(f"threads of a reduction: {n}, of libraries: {n}" for n in reductions)
    assert set(log("threads")) - set(of_reductions) == {"threads of a point: 1, of libraries: 1"}


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("options", "reduction", "point"),
    [
        (("--workers", 1, "--threads", 1), 1, 1),
        (("--workers", 2, "--threads", 3), 3, 1),
    ],
)
def test_total_number_of_threads(study, tmp_path, log, options, reduction, point):
    assert sweep(study(LINE), tmp_path / "out", *options)[0] == 0
    assert set(log("threads")) == {
        f"threads of a reduction: {reduction}, of libraries: {reduction}",
        f"threads of a point: {point}, of libraries: {point}",
    }


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("command", ["compare", "verify"])
def test_threads_of_other_studies(study, tmp_path, log, command):
    options = [f"--formulation={{name='springs', stiffness={k}, log='{tmp_path / 'log'}'}}" for k in ("1e14", "2e14")]
    case = study(LINE).with_name("case.toml")
    case.write_text(case.read_text().replace("divisions = 4", "divisions = 16"))
    arguments = [command, case, "--out", tmp_path / "out", "--threads", 1, "--plugin", PLUGIN, *options]
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code in (0, 1), result.stderr
    assert set(log("threads")) == {f"threads of a {what}: 1, of libraries: 1" for what in ("reduction", "point")}


NOISY = """
import warnings
from dataclasses import dataclass, field
from meeframe.plugin import Record, Solver, hookimpl
from meeframe.solvers import Uzawa


@dataclass(frozen=True)
class Noisy(Solver):
    def init(self, problem, start, tolerance=1e-10):
        return Uzawa().init(problem, start)

    def step(self, problem, iterate):
        warnings.warn("of a\\nstep")
        warnings.warn("left out", DeprecationWarning)
        return Uzawa().step(problem, iterate)


@hookimpl
def meeframe_solvers():
    return [Record("noisy", Noisy, "warns", "nobody")]
"""


@pytest.mark.full
@pytest.mark.filterwarnings("always:of a", "ignore:left out")
@pytest.mark.parametrize("workers", [1, 2])
def test_warnings_of_plugins_are_shown_once_for_all_processes(study, tmp_path, workers):
    plugin = tmp_path / "noisy.py"
    plugin.write_text(NOISY, encoding="utf-8")
    path = study(f'set = {{ "solver" = "noisy" }}\n{LINE}')
    status, _, errors = sweep(path, tmp_path / "out", "--workers", workers, "--plugin", plugin)
    assert status == 0
    warnings_printed = [line for line in errors.splitlines() if "Warning" in line or "step" in line]
    assert warnings_printed == [f"warning: {plugin}, line 14: UserWarning: of a step"]


@pytest.mark.full
def test_only_one_sweep_writes_to_a_folder(study, tmp_path, release):
    out, file = tmp_path / "out", study(LINE, free=FREE)
    with start_process("-m", "meeframe", *command(file, out, "--workers", 2)) as process:
        wait_for(lambda: files(out), process)
        for options in ((), ("--overwrite",)):
            status, _, complained = sweep(file, out, *options)
            assert status == 2
            assert f"error: folder {out} is in use: another process writes there" in " ".join(complained.split())
        workers = process.children(recursive=True)
        process.kill()
        process.wait()
    release()
    assert_done(sweep(file, out))  # at once: neither the killed process nor its remaining workers lock the folder
    psutil.wait_procs(workers, timeout=PATIENCE)
    assert_as_uninterrupted(file, out, tmp_path)


@pytest.mark.full
def test_killed_scheduler_of_a_cluster(study, tmp_path, log, release):
    out, file, message = tmp_path / "out", study(LINE, free=FREE), tmp_path / "told"
    position = tmp_path / "scheduler.json"
    cluster = ("--scheduler-file", position, "--no-dashboard")
    with (
        start_process("-m", "distributed.cli.dask_scheduler", "--port", 0, *cluster) as scheduler,
        start_process("-m", "distributed.cli.dask_worker", "--nthreads", 1, "--no-nanny", *cluster),
    ):
        wait_for(lambda: position.exists() and position.stat().st_size, scheduler)
        address = json.loads(position.read_text())["address"]
        with start_process(
            "-m", "meeframe", *command(file, out, "--scheduler", address), output_file=message
        ) as process:
            wait_for(lambda: len(files(out)) >= 2, process)
            scheduler.kill()
            status = process.wait(timeout=PATIENCE)
    assert status == 2, message.read_text()
    assert f"error: scheduler {address} was lost" in message.read_text()
    assert "Traceback" not in message.read_text()
    before, solved = files(out), log("solved")
    release()
    assert 2 <= len(before) < len(DEPTHS)
    assert_done(sweep(file, out))
    assert_nothing_twice(out, log, before, solved)
    assert_as_uninterrupted(file, out, tmp_path)


@pytest.mark.full
def test_unreachable_scheduler(study, tmp_path):
    out = tmp_path / "out"
    result = CliRunner().invoke(app, command(study(LINE), out, "--scheduler", "tcp://127.0.0.1:1"))
    assert result.exit_code == 2
    assert "error: scheduler tcp://127.0.0.1:1 does not answer" in result.stderr
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--workers", 1, "--scheduler", "tcp://a:1"), "workers = 1 and scheduler = tcp://a:1: allowed: one of them"),
        (("--threads", 1, "--scheduler", "tcp://a:1"), "threads = 1 and scheduler = tcp://a:1: allowed: one of them"),
        (("--workers", 3, "--threads", 2), "threads = 2 and workers = 3: allowed: at least one thread for each worker"),
    ],
)
def test_workers_and_scheduler_exclude_each_other(study, tmp_path, options, text):
    status, _, complained = sweep(study(LINE), tmp_path / "out", *options)
    assert status == 2
    assert text in complained
    assert not (tmp_path / "out").exists()


@pytest.mark.full
def test_many_invalid_points(study, tmp_path):
    """Only a sample of them is checked: the check of 100,000 takes minutes."""
    file = study(LINE.replace("1e-5", "-3.0").replace("4e-5", "-1.0").replace("count = 8", "count = 1200"))
    file.write_text(file.read_text().replace("steps[1].approach", "formulation.stiffness"), encoding="utf-8")
    status, _, complained = sweep(file, tmp_path / "out")
    assert status == 2
    assert "formulation.stiffness = -" in complained
    assert f"{file}: all of 1000 points, chosen at random from 1200, are invalid" in complained.replace("\n", " ")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("missing", "workers"), [("xarray", 1), ("h5netcdf", 1), ("distributed", 2)])
def test_without_the_extra(study, tmp_path, monkeypatch, missing, workers):
    file = study(LINE)
    monkeypatch.setitem(sys.modules, missing, None)
    monkeypatch.delitem(sys.modules, "meeframe.study.sweep.dask", raising=False)
    result = CliRunner().invoke(app, command(file, tmp_path / "out", "--workers", workers))
    assert result.exit_code == 2
    message = " ".join(result.stderr.split())
    assert missing in message
    assert "install the extra: pip install 'meeframe[sweep]'" in message
    assert not (tmp_path / "out").exists()
