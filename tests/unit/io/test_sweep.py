"""The folder of a sweep: whose it is."""

import pytest

from meeframe.common.errors import ResultError
from meeframe.results.sweep_files import open_folder


class Killed(BaseException):
    """Passes where nothing is caught."""


@pytest.fixture
def begun(tmp_path, monkeypatch):
    """The folder of a sweep that was killed while it wrote which points the folder is for."""

    def killed(path, text, encoding):
        path.open("w").close()
        path.with_name(".sweep.1.json").touch()
        raise Killed

    folder = tmp_path / "out"
    with monkeypatch.context() as patched:
        patched.setattr("pathlib.Path.write_text", killed)
        with pytest.raises(Killed), open_folder(folder, ["a" * 64], overwrite=False):
            pass
    (folder / ".lock").touch()  # as a process leaves it that is killed
    assert {path.name for path in folder.iterdir()} == {".lock", ".sweep.1.json", "points", "systems"}
    return folder


def test_a_sweep_killed_before_it_wrote_anything_goes_on(begun):
    with open_folder(begun, ["a" * 64], overwrite=False):
        assert {path.name for path in begun.iterdir()} == {".lock", "points", "sweep.json", "systems"}


def test_one_killed_with_its_lock_alone_goes_on(tmp_path):
    (tmp_path / ".lock").touch()
    with open_folder(tmp_path, ["a" * 64], overwrite=False):
        assert (tmp_path / "sweep.json").exists()


@pytest.mark.parametrize("name", ["note.txt", "points/note.txt", "systems/note.h5"])
def test_what_is_not_of_a_sweep_is_left_alone(begun, name):
    (begun / name).touch()
    with pytest.raises(ResultError, match="is not empty"), open_folder(begun, ["a" * 64], overwrite=False):
        pass
    assert (begun / name).exists()
    assert not (begun / "sweep.json").exists()
