"""The commands of the page on security start a cluster with TLS, which only certificates of its authority enter."""

import os
import re
import shutil
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
import xarray

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "security.md"
CASE = """
[material]
name = "pzt-4"

[mesh]
type = "half-space"
contact_width = "5 mm"
divisions = 8

[formulation]
name = "half-space"

[indenter]
name = "sphere"
radius = "100 mm"

[[steps]]
approach = "10 um"
"""
STUDY = """
case = "case.toml"
[axes]
"steps[1].approach" = ["10 um", "20 um"]
"""


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates")
def test_cluster_with_tls(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("case.toml").write_text(CASE, encoding="utf-8")
    Path("study.toml").write_text(STUDY, encoding="utf-8")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    block = re.search(r"^```sh\n(openssl req .*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.M)[1]
    block = block.replace("HOST", "127.0.0.1").replace("8786", str(port))
    setup, commands = block[: block.index("dask scheduler")], block[block.index("dask scheduler") :]
    made = subprocess.run(["bash", "-ec", f"{setup}\nenv -0"], check=True, capture_output=True, timeout=100)
    environment = dict(each.split("=", 1) for each in made.stdout.decode().split("\0") if each)
    programs = str(Path(sys.executable).parent)
    environment["PATH"] = f"{programs}{os.pathsep}{environment['PATH']}"
    scheduler, worker, sweep = (line.split("#")[0].split() for line in commands.splitlines())

    with ExitStack() as stack:
        for command in (scheduler, worker):
            process = stack.enter_context(subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL))
            stack.callback(process.terminate)
            wait_for_port(port)
        done = subprocess.run(sweep, env=environment, capture_output=True, text=True, timeout=200, check=False)
        assert done.returncode == 0, done.stderr
        dataset = xarray.load_dataset("out/study/sweep.h5", engine="h5netcdf")
        assert (dataset.status == "converged").all()

        # a client with a certificate of another authority, and one without encryption
        shutil.copytree(".", "foreign", ignore=shutil.ignore_patterns("out"))
        subprocess.run(["bash", "-ec", setup], cwd="foreign", check=True, capture_output=True, timeout=100)
        others = environment | {
            name: value.replace(str(tmp_path), str(tmp_path / "foreign"))
            for name, value in environment.items()
            if name.startswith("DASK_DISTRIBUTED__COMM__TLS__CLIENT")
        }
        plain = {name: value for name, value in environment.items() if not name.startswith("DASK_")}
        attempts = {f"tls://127.0.0.1:{port}": others, f"tcp://127.0.0.1:{port}": plain}
        refused = {  # both wait for an answer
            address: subprocess.Popen(
                [*sweep[:-1], address, "--overwrite"], env=variables, stderr=subprocess.PIPE, text=True
            )
            for address, variables in attempts.items()
        }
        for address, process in refused.items():
            _, errors = process.communicate(timeout=200)
            assert process.returncode == 2, errors
            assert f"error: scheduler {address} does not answer" in " ".join(errors.split())
            assert "Traceback" not in errors


def wait_for_port(port: int) -> None:
    """Wait until something listens on a port."""
    for _ in range(600):
        with socket.socket() as client:
            if client.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise TimeoutError(f"nothing listens on port {port}")
