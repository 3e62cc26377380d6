"""A tiny case and a formulation that needs no boundary elements, for the tests of cases."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

from meeframe.core.body import check_conditions, check_supports
from meeframe.core.dense_system import DenseSystem
from meeframe.core.formulation import Formulation, NodalFields, silent
from meeframe.core.quantities import Quantity
from meeframe.geometry import zone_frames
from meeframe.plugin import registry as plugins
from meeframe.plugin.hookspecs import Record
from meeframe.plugin.registry import Entry, Kind, Provider

CASE = """
title = "tiny"

[material]
name = "batio3-cofe2o4"

[mesh]
half_width = "50 mm"
height = "120 mm"
contact_width = "5 mm"
divisions = 4
rings = 2
layers = 1

[[boundary]]
group = "base"
displacement = [0, 0, 0]
electric_potential = 0
magnetic_potential = 0

[indenter]
name = "sphere"
radius = "100 mm"

[formulation]
name = "winkler"
stiffness = "1e14 Pa/m"

[[steps]]
approach = "10 um"
"""


@dataclass(frozen=True)
class Winkler(Formulation):
    """Independent springs: each node answers its own load alone, so that contact has a closed form."""

    stiffness: Annotated[float, Quantity("Pa/m", gt=0)]

    def check(self, body):
        check_conditions(body)
        check_supports(body)

    def reduce(self, body, progress=silent):
        progress("springs", 0.0)
        zone = zone_frames(body.mesh, body.contact_group)
        n = len(zone.points)
        matrix = np.zeros((n, 5, n, 5))
        for node in range(n):
            matrix[node, :, node, :] = np.diag([1, 1, 1, 1e13, 1e8]) / self.stiffness

        def recover(load):
            return NodalFields(zone.points, zone.cells, np.einsum("naNA,NA->na", matrix, load), load)

        return DenseSystem(zone.points, zone.frames, zone.weights, zone.cells, np.zeros((n, 5)), matrix, recover)


@pytest.fixture(scope="session")
def registry():
    """All that is installed, and the springs."""
    record = Record("winkler", Winkler, "independent springs", "Winkler (1867)")
    loaded = plugins.load()
    return replace(loaded, entries=(*loaded.entries, Entry(Kind.FORMULATION, record, Provider("tests", "0"))))


@pytest.fixture
def write_case(tmp_path):
    """Writes the tiny case with texts replaced and added; gives its path."""

    def write(*changes: tuple[str, str], more: str = "") -> Path:
        text = CASE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "case.toml"
        path.write_text(text + more, encoding="utf-8")
        return path

    return write
