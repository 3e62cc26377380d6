"""Tiers of tests: `pytest` runs the default tier, `pytest --full` everything.

A test is of the full tier if it lies in a folder `full` or is marked `full`. `full(except_for=3)` marks all but three
parametrisations of a test, evenly spread. The default tier covers each numerical part at least once; the full tier
repeats it at more parameters, on finer grids and in longer runs.

`pytest` without paths uses all processors. Each process takes neighbouring tests, so that few fixtures are made twice
and few kernels are compiled twice in a fresh clone.
"""

import os
from collections import defaultdict

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # or each process that tests start would compile all sources
if "PYTEST_XDIST_WORKER" in os.environ:  # before numpy is loaded: the workers share the processors already
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("MKL_NUM_THREADS", "1")

import numpy as np
import pytest

DESELECTED = pytest.StashKey[int]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--full", action="store_true", help="run the tests of the full tier too")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers", "full(except_for=0): only `pytest --full` runs it, except for so many parametrisations"
    )
    config.stash[DESELECTED] = 0


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Distribute the tests if no path and no number of processes is given."""
    is_worker = hasattr(config, "workerinput")
    if not config.pluginmanager.hasplugin("xdist") or is_worker or config.option.usepdb or config.option.collectonly:
        return
    if config.args_source is pytest.Config.ArgsSource.TESTPATHS and config.option.numprocesses is None:
        config.option.numprocesses = "auto"
    if config.option.numprocesses and config.option.dist == "no":
        config.option.dist = "worksteal"


def full_tier(items: list[pytest.Item], config: pytest.Config) -> set[pytest.Item]:
    """Return the tests that only `--full` runs."""
    full: set[pytest.Item] = set()
    marked: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        if "full" in item.path.relative_to(config.rootpath).parts[:-1]:
            full.add(item)
        elif item.get_closest_marker("full"):
            marked[item.nodeid.partition("[")[0]].append(item)
    for alike in marked.values():
        count = min(len(alike), max(item.get_closest_marker("full").kwargs.get("except_for", 0) for item in alike))
        default = {alike[index] for index in np.linspace(0, len(alike) - 1, count).round().astype(int)}
        full.update(item for item in alike if item not in default)
    return full


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("full"):
        return
    deselected = full_tier(items, config)
    config.hook.pytest_deselected(items=[item for item in items if item in deselected])
    items[:] = [item for item in items if item not in deselected]
    config.stash[DESELECTED] = len(deselected)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Pass the number from a process of pytest-xdist to the one that reports."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["deselected"] = session.config.stash[DESELECTED]


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object) -> None:
    config = node.config
    config.stash[DESELECTED] = max(config.stash[DESELECTED], getattr(node, "workeroutput", {}).get("deselected", 0))


def pytest_terminal_summary(terminalreporter, config: pytest.Config) -> None:
    if config.stash[DESELECTED]:
        terminalreporter.write_line(f"{config.stash[DESELECTED]} tests of the full tier deselected; --full runs them.")
