"""Reduced systems are cached by content, bit for bit, and damaged files are replaced."""

from dataclasses import asdict, dataclass, replace

import h5py
import numpy as np
import pytest

from meeframe.common.errors import ResultError
from meeframe.elements import Quad8
from meeframe.formulations.base import Formulation, PersistentFormulation
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.greens import LineIntegral, Tabulated
from meeframe.indenters import FlatPunch
from meeframe.laws import IsotropicCoulomb, StepConductivity
from meeframe.material import library_material
from meeframe.mesh import block_mesh, find_contact_zone
from meeframe.mesh.body import BoundaryCondition
from meeframe.mesh.regular import GridCells
from meeframe.mesh.surface import ElementBlock
from meeframe.model import cache, solve
from meeframe.model.cache import cached_reduce, system_key
from meeframe.model.load import load_case
from meeframe.model.solve import provenance, reduce, solve_steps
from meeframe.results.records import Result, zone_of
from meeframe.results.resultants import resultants
from meeframe.results.systems import read_arrays, write_arrays
from meeframe.solvers import Auto, StoppingCriteria
from meeframe.system.capabilities import Persistence
from meeframe.system.reduced import ReducedSystem

HALF_SPACE = """
material = { name = "pzt-4" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 5 }
formulation = { name = "half-space" }
indenter = { name = "sphere", radius = "100 mm" }
contact = { law = { name = "isotropic-coulomb", mu = 0.3 } }
steps = [{ approach = "10 um" }]
"""
ARRAYS = ("points", "frames", "weights", "offset")


@pytest.fixture
def case(write_case, registry):
    return load_case(write_case(), registry)


@pytest.fixture
def reductions(monkeypatch):
    """Return a list that counts reductions."""
    made = []
    original = solve.reduce_body
    monkeypatch.setattr(solve, "reduce_body", lambda *given: made.append(1) or original(*given))
    return made


def key(case):
    return system_key(case.formulation, case.body)


def assert_same(computed, expected):
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(computed, name), getattr(expected, name), strict=True)
    np.testing.assert_array_equal(computed.dense(), expected.dense(), strict=True)
    assert [name for name, _ in computed.cells] == [name for name, _ in expected.cells]
    for (_, nodes), (_, others) in zip(computed.cells, expected.cells, strict=True):
        np.testing.assert_array_equal(nodes, others, strict=True)


def test_cached_system_is_bitwise_identical(case, tmp_path, reductions):
    case = replace(case, formulation=DenseBEM(quadrature_tolerance=1e-2))
    made = cached_reduce(case, tmp_path / "cache")
    assert len(reductions) == 1
    cached = cached_reduce(case, tmp_path / "cache")
    assert len(reductions) == 1
    assert_same(cached, made)
    assert [path.name for path in (tmp_path / "cache").iterdir()] == [f"{key(case)}.h5"]


def test_cached_grid_stays_a_grid(tmp_path, reductions):
    """Areas of nodes are otherwise computed from elements, with round-off."""
    path = tmp_path / "case.toml"
    path.write_text(HALF_SPACE, encoding="utf-8")
    case = load_case(path)
    made, cached = (cached_reduce(case, tmp_path / "cache") for _ in range(2))
    assert len(reductions) == 1
    assert_same(cached, made)
    assert cached.cells == made.cells == GridCells((6, 6))
    totals = [resultants(result.zone, result.steps[-1]) for result in (solve_on(case, made), solve_on(case, cached))]
    assert asdict(totals[0]).keys() == asdict(totals[1]).keys()
    for name, value in asdict(totals[0]).items():
        np.testing.assert_array_equal(asdict(totals[1])[name], value, err_msg=name)


def solve_on(case, system):
    """Return the result of a case on a reduced system."""
    return Result(provenance(case), zone_of(system), 1, tuple(solve_steps(case, system)))


def test_recovery_reduces_once_more_and_gives_same_fields(case, tmp_path, reductions):
    system = reduce(case)
    load = np.random.default_rng(1).normal(size=system.offset.shape)
    expected = system.recover(load)
    for begun, cached in enumerate(
        [cached_reduce(case, tmp_path), cached_reduce(case, tmp_path)]
    ):  # computed, and read
        assert len(reductions) == 2 + begun
        for _ in range(2):
            fields = cached.recover(load)
            np.testing.assert_array_equal(fields.values, expected.values)
            np.testing.assert_array_equal(fields.fluxes, expected.fluxes)
        assert len(reductions) == 3 + begun


def moved(mesh):
    points = mesh.points.copy()
    points[0, 0] = np.nextafter(points[0, 0], np.inf)
    return replace(mesh, points=points)


def renumbered(mesh):
    first = mesh.blocks[0]
    block = ElementBlock(first.element, np.roll(first.connectivity, 1, axis=1), first.groups)
    return replace(mesh, blocks=(block, *mesh.blocks[1:]))


def regrouped(mesh):
    first = mesh.blocks[0]
    groups = first.groups.copy()
    groups[np.flatnonzero(groups == mesh.group("side_x-"))[0]] = mesh.group("side_x+")
    return replace(mesh, blocks=(replace(first, groups=groups), *mesh.blocks[1:]))


INGREDIENTS = {
    "stiffness": lambda case: {"material": library_material("pzt-4")},
    "point, by one bit": lambda case: {"mesh": moved(case.mesh)},
    "connectivity": lambda case: {"mesh": renumbered(case.mesh)},
    "face groups": lambda case: {"mesh": regrouped(case.mesh)},
    "elements": lambda case: {"mesh": block_mesh(0.05, 0.12, 0.005, 4, 2, 1, Quad8())},
    "value of a condition": lambda case: {"conditions": (replace(case.conditions[0], data=1e-9), *case.conditions[1:])},
    "kind of a condition": lambda case: {"conditions": (*case.conditions, BoundaryCondition("top", 0, "flux", 0.0))},
    "formulation": lambda case: {"formulation": DenseBEM()},
    "its number": lambda case: {"formulation": replace(case.formulation, stiffness=2e14)},
}


@pytest.mark.parametrize("ingredient", INGREDIENTS)
def test_changed_input_changes_the_key(case, ingredient):
    assert key(replace(case, **INGREDIENTS[ingredient](case))) != key(case)


def test_key_includes_zone_tolerance_and_fundamental_solution(case):
    variants = [
        replace(case, formulation=formulation)
        for formulation in (
            DenseBEM(),
            DenseBEM(quadrature_tolerance=1e-4),
            DenseBEM(LineIntegral()),
            DenseBEM(Tabulated(1e-7)),
        )
    ]
    free = replace(case, conditions=tuple(c for c in case.conditions if c.group == "base"))
    variants += [free, replace(free, zone="top")]
    keys = [key(variant) for variant in variants]
    assert keys[-2] == key(case)  # the same conditions in new objects
    assert len(set(keys)) == len(keys)


def test_key_includes_the_content_of_files(tmp_path):
    file = tmp_path / "volume.vtu"
    keys = []
    for text in ("one", "two", "one"):
        file.write_text(text, encoding="utf-8")
        keys.append(b"".join(cache._content(file)))
    assert keys[0] == keys[2] != keys[1]


def test_key_includes_versions(case, monkeypatch):
    before = key(case)
    monkeypatch.setattr(cache.metadata, "version", lambda _: "99")
    cache._sources.cache_clear()
    try:
        assert key(case) != before
    finally:
        monkeypatch.undo()
        cache._sources.cache_clear()


def test_loads_laws_and_solvers_share_one_system(case):
    later = {
        "indenter": FlatPunch(1e-3),
        "contact_law": IsotropicCoulomb(0.3),
        "conductivity": {"electric": StepConductivity(1.0), "magnetic": StepConductivity(1.0)},
        "solver": Auto(),
        "stopping": StoppingCriteria(tolerance=1e-6),
        "title": "another",
        "text": "another",
    }
    for name, value in later.items():
        assert key(replace(case, **{name: value})) == key(case), name


def flipped(path):
    """Flip one bit of the matrix."""
    with h5py.File(path) as file:
        offset = file["matrix"].id.get_chunk_info(0).byte_offset
    data = bytearray(path.read_bytes())
    data[offset + 8] ^= 1
    path.write_bytes(data)


DAMAGES = {
    "cut short": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "empty": lambda path: path.write_bytes(b""),
    "not HDF5": lambda path: path.write_text("nothing of the kind"),
    "one bit": flipped,
    "another's": lambda path: h5py.File(path, "r+").attrs.__setitem__("key", "0"),
    "without its matrix": lambda path: h5py.File(path, "r+").__delitem__("matrix"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_file_is_replaced(case, tmp_path, reductions, damage):
    made = cached_reduce(case, tmp_path)
    (path,) = tmp_path.glob("*.h5")
    DAMAGES[damage](path)
    for _ in range(2):
        assert_same(cached_reduce(case, tmp_path), made)
    assert len(reductions) == 2


def test_interrupted_write_leaves_no_file(case, tmp_path, monkeypatch):
    def stop(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(h5py.Group, "create_dataset", stop)
        with pytest.raises(KeyboardInterrupt):
            cached_reduce(case, tmp_path)
    assert not list(tmp_path.glob("*.h5"))
    assert not list(tmp_path.glob(".*.h5"))


def test_folder_that_cannot_be_created(case, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ResultError, match="cannot be made"):
        cached_reduce(case, tmp_path / "file")


@dataclass(frozen=True)
class WithoutMatrix(Formulation):
    inner: Formulation

    def check(self, body):
        self.inner.check(body)

    def reduce(self, body, progress=lambda *_: None):
        system = self.inner.reduce(body, progress)
        return OperatorOnly(system.points, system.frames, system.weights, system.cells, system.offset)


class OperatorOnly(ReducedSystem):
    def apply(self, load):
        return load

    def diagonal_blocks(self):
        return np.tile(np.eye(5), (len(self.points), 1, 1))

    def dense(self):
        return None

    def recover(self, load):
        raise NotImplementedError


@dataclass(frozen=True)
class PersistentFormulationStub(WithoutMatrix, PersistentFormulation):
    def reduce(self, body, progress=lambda *_: None):
        system = super().reduce(body, progress)
        return PersistentOperator(system.points, system.frames, system.weights, system.cells, system.offset)

    def from_arrays(self, body, arrays):
        if arrays["whole"].shape != (3,):
            raise ValueError("another system")
        zone = find_contact_zone(body.mesh, body.contact_group)
        return PersistentOperator(zone.points, zone.frames, zone.weights, zone.cells, arrays["offset"])


class PersistentOperator(OperatorOnly, Persistence):
    def to_arrays(self):
        return {"offset": self.offset, "whole": np.arange(3)}


def test_arrays_of_matrix_free_system_are_bitwise_identical(case, tmp_path, reductions):
    case = replace(case, formulation=PersistentFormulationStub(case.formulation))
    made = cached_reduce(case, tmp_path)
    cached = cached_reduce(case, tmp_path)
    assert len(reductions) == 1
    np.testing.assert_array_equal(cached.offset, made.offset, strict=True)
    assert read_arrays(tmp_path / f"{key(case)}.h5", key(case))["whole"].dtype == np.arange(3).dtype
    assert read_arrays(tmp_path / f"{key(case)}.h5", "another key") is None


@pytest.mark.parametrize("damage", ["shortened", "changed"])
def test_damaged_arrays_are_replaced(case, tmp_path, reductions, damage):
    case = replace(case, formulation=PersistentFormulationStub(case.formulation))
    made = cached_reduce(case, tmp_path)
    path = tmp_path / f"{key(case)}.h5"
    content = bytearray(path.read_bytes())
    if damage == "shortened":
        del content[len(content) // 2 :]
    else:
        position = content.find(made.offset.tobytes()[:64])
        assert position > 0
        content[position] ^= 1
    path.write_bytes(content)
    np.testing.assert_array_equal(cached_reduce(case, tmp_path).offset, made.offset, strict=True)
    assert len(reductions) == 2


def test_rejected_arrays_are_replaced(case, tmp_path, reductions):
    case = replace(case, formulation=PersistentFormulationStub(case.formulation))
    path = tmp_path / f"{key(case)}.h5"
    write_arrays(path, key(case), {"whole": np.array(1.0)})
    cached_reduce(case, tmp_path)
    assert len(reductions) == 1
    assert read_arrays(path, key(case))["whole"].shape == (3,)


def test_system_that_cannot_be_loaded_is_not_stored(case, tmp_path, reductions):
    case = replace(case, formulation=Wrapping(PersistentFormulationStub(case.formulation)))
    for _ in range(2):
        assert isinstance(cached_reduce(case, tmp_path / "cache"), PersistentOperator)
    assert len(reductions) == 2
    assert not list(tmp_path.glob("cache/*"))


@dataclass(frozen=True)
class Wrapping(WithoutMatrix):
    def reduce(self, body, progress=lambda *_: None):
        return self.inner.reduce(body, progress)


def test_matrix_free_system_is_computed_each_time(case, tmp_path, reductions):
    case = replace(case, formulation=WithoutMatrix(case.formulation))
    for _ in range(2):
        assert cached_reduce(case, tmp_path / "cache").dense() is None
    assert len(reductions) == 2
    assert not list(tmp_path.glob("cache/*"))
