"""Shared fixtures: case files in which texts are replaced."""

from collections.abc import Callable
from pathlib import Path

import pytest

from meeframe.model.case import Case
from meeframe.model.load import load_case


@pytest.fixture
def load_changed(tmp_path: Path) -> Callable[..., Case]:
    """Return a function that loads the case of a text in which texts (old, new) are replaced."""

    def load(text: str, *changes: tuple[str, str]) -> Case:
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "case.toml").write_text(text, encoding="utf-8")
        return load_case(tmp_path / "case.toml")

    return load
