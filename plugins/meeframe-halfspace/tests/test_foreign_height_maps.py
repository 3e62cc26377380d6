"""Height maps in HDF5 that refer to other files, or declare more than they hold."""

import h5py
import numpy as np
import pytest
from meeframe_halfspace.height_files import Scales, read_height_map

from meeframe.plugin import CaseError

SCALES = Scales(unit=1e-9, spacing=(1e-6, 1e-6), dataset="heights")


def link(file, private):
    file["heights"] = h5py.ExternalLink(str(private), "data")


def stored(file, private):
    file.create_dataset("heights", (4, 4), float, external=[(str(private), 0, h5py.h5f.UNLIMITED)])


def virtual(file, private):
    layout = h5py.VirtualLayout(shape=(4, 4), dtype=float)
    layout[:] = h5py.VirtualSource(str(private), "data", shape=(4, 4))
    file.create_virtual_dataset("heights", layout)


@pytest.mark.parametrize("put", [link, stored, virtual])
def test_data_of_other_files_are_not_read(tmp_path, put):
    private, path = tmp_path / "private.h5", tmp_path / "map.h5"
    with h5py.File(private, "w") as file:
        file["data"] = np.full((4, 4), 42.0)
    with h5py.File(path, "w") as file:
        put(file, private)
    with pytest.raises(CaseError, match=r"map\.h5: .*allowed: data in the file itself"):
        read_height_map(path, SCALES)


def test_maps_larger_than_their_file_are_not_read(tmp_path):
    path = tmp_path / "map.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("heights", (316_000, 316_000), float, chunks=(1000, 1000))
    with pytest.raises(CaseError, match=r"map\.h5: .*takes 744 GiB"):
        read_height_map(path, SCALES)
