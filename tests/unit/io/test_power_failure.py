"""Files that replace others reach the disk before they do so."""

import os

import pytest

from meeframe.common.errors import ResultError
from meeframe.results.output import replacing


def test_the_content_is_on_the_disk_before_the_name(tmp_path, monkeypatch):
    events = []
    fsync, replace = os.fsync, os.replace

    def noted_fsync(file):
        events.append(("fsync", os.path.realpath(f"/proc/self/fd/{file}")))
        fsync(file)

    def noted_replace(source, target):
        events.append(("replace", str(target)))
        replace(source, target)

    monkeypatch.setattr(os, "fsync", noted_fsync)
    monkeypatch.setattr(os, "replace", noted_replace)
    target = tmp_path / "summary.json"
    with replacing(target) as path:
        path.write_text("new", encoding="utf-8")
        temporary = str(path)
    assert events == [("fsync", temporary), ("replace", str(target)), ("fsync", str(tmp_path))]
    assert target.read_text() == "new"


def test_a_disk_that_fails_then_leaves_the_old_content(tmp_path, monkeypatch):
    target = tmp_path / "summary.json"
    target.write_text("old", encoding="utf-8")

    def fail(file):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", fail)
    with (
        pytest.raises(ResultError, match=r"summary\.json cannot be written: Input/output error"),
        replacing(target) as path,
    ):
        path.write_text("new", encoding="utf-8")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]
