"""Sweep folders from untrusted sources never cause the removal of files outside of them."""

import json

import pytest

from meeframe.common.errors import ResultError
from meeframe.results.sweep_files import FORMAT, drop_systems, open_folder

WANTED = ["0" * 64]


def write_list(folder, *keys):
    folder.mkdir(exist_ok=True)
    (folder / "points").mkdir(exist_ok=True)
    (folder / "sweep.json").write_text(json.dumps({"format": FORMAT, "points": keys}))
    return folder


@pytest.mark.parametrize("key", ["../../precious", "..", ".", "", "a/b", "F" * 64, "0" * 63 + "\n", 7, ["0" * 64]])
def test_lists_with_invalid_names_are_rejected(tmp_path, key):
    precious = tmp_path / "precious"
    precious.mkdir()
    folder = write_list(tmp_path / "out", "1" * 64, key)
    (folder / "points" / "note.txt").touch()
    refusal = r"sweep\.json: points lists .*; allowed: keys of 64 hexadecimal digits"
    with pytest.raises(ResultError, match=refusal), open_folder(folder, WANTED, overwrite=True):
        pass
    assert precious.is_dir()
    assert (folder / "points" / "note.txt").exists()


def test_absolute_paths_are_rejected(tmp_path):
    precious = tmp_path / "precious"
    precious.mkdir()
    folder = write_list(tmp_path / "out", str(precious))
    with pytest.raises(ResultError, match="64 hexadecimal digits"), open_folder(folder, WANTED, overwrite=True):
        pass
    assert precious.is_dir()


@pytest.mark.parametrize("name", ["points", "systems"])
def test_links_to_other_folders_are_rejected(tmp_path, name):
    elsewhere, key = tmp_path / "elsewhere", "1" * 64
    (elsewhere / key).mkdir(parents=True)
    (elsewhere / ".hidden").mkdir()
    folder = write_list(tmp_path / "out", key)
    (folder / "points").rmdir()
    (folder / name).symlink_to(elsewhere)
    with pytest.raises(ResultError, match="is a symbolic link"), open_folder(folder, WANTED, overwrite=True):
        pass
    assert (elsewhere / key).is_dir()
    assert (elsewhere / ".hidden").is_dir()


def test_only_other_and_unfinished_points_are_removed(tmp_path):
    kept, dropped = WANTED[0], "1" * 64
    folder = write_list(tmp_path / "out", kept, dropped)
    for name in (kept, dropped, "2" * 64, ".git", f".{dropped}"):
        (folder / "points" / name).mkdir()
    with open_folder(folder, WANTED, overwrite=True):
        assert {path.name for path in (folder / "points").iterdir()} == {kept, "2" * 64, ".git"}


def test_only_systems_and_unfinished_files_of_sweeps_are_removed(tmp_path):
    written = {f".{'1' * 64}.17.h5", f"{'1' * 64}.h5", ".sweep.17.json", ".sweep.17.h5"}
    foreign = {"measured.h5", ".gitignore", ".sweep.notes", f".{'1' * 64}.txt", f"{'1' * 63}.h5"}
    folder = write_list(tmp_path / "out", *WANTED)
    for place in (folder, folder / "systems"):
        place.mkdir(exist_ok=True)
        for name in written | foreign:
            (place / name).touch()
    with open_folder(folder, WANTED, overwrite=True):
        drop_systems(folder, set())
    assert {path.name for path in (folder / "systems").iterdir()} == foreign
    assert foreign <= {path.name for path in folder.iterdir()}
    assert not any(path.name.startswith(".sweep.17") for path in folder.iterdir())
