"""Memoized values live as long as their object."""

import gc
from weakref import ref

import numpy as np
import pytest

from meeframe.common.errors import MeshError
from meeframe.common.memoize import memoize_by_identity
from meeframe.elements import Quad4
from meeframe.mesh import block_mesh, find_contact_zone


class Thing:
    """An object with a limited lifetime."""

    def __init__(self, size: float = 1.0) -> None:
        self.size = size


def test_value_is_computed_once_for_each_object_and_arguments() -> None:
    calls = []

    @memoize_by_identity
    def scaled(thing: Thing, factor: float, *more: float) -> float:
        calls.append((thing, factor, *more))
        return thing.size * factor + sum(more)

    one, other = Thing(2.0), Thing(3.0)
    for _ in range(2):
        assert [scaled(one, 2.0), scaled(one, 5.0), scaled(one, 5.0, 1.0), scaled(other, 2.0)] == [4.0, 10.0, 11.0, 6.0]
    assert calls == [(one, 2.0), (one, 5.0), (one, 5.0, 1.0), (other, 2.0)]


def test_value_is_released_with_its_object() -> None:
    made = memoize_by_identity(lambda thing, name: np.zeros(3))
    thing = Thing()
    computed = ref(made(thing, "a"))
    assert computed() is made(thing, "a")
    del thing
    gc.collect()
    assert computed() is None


def test_errors_are_not_memoized() -> None:
    mesh = block_mesh((2.0, 2.0), 1.0, (1.0, 1.0), (2, 2), 1, 1, Quad4())
    for _ in range(2):
        with pytest.raises(MeshError, match="'nowhere'"):
            find_contact_zone(mesh, "nowhere")
    assert find_contact_zone(mesh, "contact") is find_contact_zone(mesh, "contact")
