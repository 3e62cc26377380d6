"""Test which sweep a folder belongs to."""

import os

import pytest

from meeframe.common.errors import ResultError
from meeframe.results.sweep_files import open_folder


class Killed(BaseException):
    """An exception that no handler catches, in place of a kill."""


@pytest.fixture
def killed_sweep(tmp_path, monkeypatch):
    """Return the folder of a sweep that was killed while it wrote its list of points."""

    def killed(path, text, encoding):
        path.open("w").close()
        path.with_name(".sweep.1.json").touch()
        raise Killed

    folder = tmp_path / "out"
    with monkeypatch.context() as patched:
        patched.setattr("pathlib.Path.write_text", killed)
        with pytest.raises(Killed), open_folder(folder, ["a" * 64], overwrite=False):
            pass
    (folder / ".lock").touch()  # as after a kill
    assert {path.name for path in folder.iterdir()} == {".lock", ".sweep.1.json", "points", "systems"}
    return folder


def test_resumption_after_kill_before_writing(killed_sweep):
    with open_folder(killed_sweep, ["a" * 64], overwrite=False):
        assert {path.name for path in killed_sweep.iterdir()} == {".lock", "points", "sweep.json", "systems"}


def test_resumption_after_kill_with_lock_only(tmp_path):
    (tmp_path / ".lock").touch()
    with open_folder(tmp_path, ["a" * 64], overwrite=False):
        assert (tmp_path / "sweep.json").exists()


def test_list_of_points_that_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "sweep.json")
    with pytest.raises(ResultError, match="is not empty"), open_folder(tmp_path, ["a" * 64], overwrite=False):
        pass


@pytest.mark.parametrize("name", ["note.txt", "points/note.txt", "systems/note.h5"])
def test_other_folders_are_left_unchanged(killed_sweep, name):
    (killed_sweep / name).touch()
    with pytest.raises(ResultError, match="is not empty"), open_folder(killed_sweep, ["a" * 64], overwrite=False):
        pass
    assert (killed_sweep / name).exists()
    assert not (killed_sweep / "sweep.json").exists()
