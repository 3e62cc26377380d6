"""Tiers of tests: `pytest` runs the default tier, `pytest --full` everything.

A test is of the full tier if it is marked `full` or lies in a folder of that name. The others cover each numerical part
at least once; those of the full tier repeat it at more parameters, finer grids and in longer runs.
"""

import pytest

DESELECTED = pytest.StashKey[int]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--full", action="store_true", help="run the tests of the full tier too")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "full: a test that only `pytest --full` runs")
    config.stash[DESELECTED] = 0


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items:
        if "full" in item.path.relative_to(config.rootpath).parts[:-1]:
            item.add_marker("full")
    if config.getoption("full"):
        return
    of_full_tier = [item for item in items if item.get_closest_marker("full")]
    items[:] = [item for item in items if not item.get_closest_marker("full")]
    config.hook.pytest_deselected(items=of_full_tier)
    config.stash[DESELECTED] = len(of_full_tier)


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
