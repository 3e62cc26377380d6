"""Directions of waves in a surface that symmetries of the materials do not make equal."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import MECHANICAL, N_FIELDS, Array, Body, FieldScaling, Indices

_STIFFNESS_TOLERANCE: Final = 1e-11
"""Relative difference of stiffnesses, in scaled fields, that are the same."""
_QUARTER: Final = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_MIRROR: Final = np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Directions:
    """Equally spaced directions over half a circle, of which some stand for all.

    Attributes
    ----------
    angles
        Angles (r,) of those that stand for the others.
    sources
        Index (count,) of the one that stands for each direction.
    transforms
        (count, fields, fields) transformation of fields from that one.
    is_conjugate
        (count,) True where the compliance is its conjugate.
    """

    angles: Array
    sources: Indices
    transforms: Array
    is_conjugate: NDArray[np.bool_]

    def expand(self, compliance: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return compliances (n, count, f, f) in all directions from those (n, r, f, f) in some."""
        values = compliance[:, self.sources]
        values = self.transforms @ values @ self.transforms.swapaxes(1, 2)
        values[:, self.is_conjugate] = values[:, self.is_conjugate].conj()
        return np.asarray(values, complex)


@dataclass(frozen=True)
class PlaneSymmetry:
    """Symmetries of all materials of a body in the plane of its surface.

    Attributes
    ----------
    is_axisymmetric
        True if rotations about the normal leave them the same.
    quarters
        4 if quarters of a turn leave them the same, else 1.
    mirrors
        2 if the reflection of e2 leaves them the same, else 1.
    n_fields
        Number of fields.
    """

    is_axisymmetric: bool
    quarters: int
    mirrors: int
    n_fields: int

    @classmethod
    def of(cls, body: Body, frame: Array) -> "PlaneSymmetry":
        """Return the symmetries of a body."""
        materials = [*(layer.material.stiffness for layer in body.layers.layers), body.stiffness]
        distinct = {one.tobytes(): one for one in materials}.values()
        stiffnesses = [_transformed(FieldScaling.of(one).scale_stiffness(one), frame) for one in distinct]

        moduli = [_in_frame(one, frame) for one in body.all_moduli if one is not None]

        def is_symmetry(transform: Array) -> bool:
            extended = _extended(transform, N_FIELDS)
            return all(
                np.abs(_transformed(one, transform) - one).max() <= _STIFFNESS_TOLERANCE for one in stiffnesses
            ) and all(
                (np.abs(transform @ one @ extended.T - one) <= _STIFFNESS_TOLERANCE * np.abs(one).max(axis=0)).all()
                for one in moduli
            )

        quarters, mirrors = 4 if is_symmetry(_QUARTER) else 1, 2 if is_symmetry(_MIRROR) else 1
        return cls(quarters == 4 and is_symmetry(_rotation(1.0)), quarters, mirrors, body.fields.size)

    def directions(self, count: int, is_between: bool = False) -> Directions:
        """Return equally spaced directions, an even number of them, from e1 on, or those in the middle between them.

        The compliance of opposite directions is conjugate; symmetries transform it like the directions.
        """
        size, start = self.n_fields, 0.5 if is_between else 0.0
        if self.is_axisymmetric:
            angles = np.pi * (np.arange(count) + start) / count
            rotations = [_extended(_rotation(angle), size) for angle in angles]
            return Directions(np.zeros(1), np.zeros(count, np.int64), np.array(rotations), np.zeros(count, bool))
        sources, transforms = np.full(2 * count, -1), np.empty((2 * count, size, size))
        is_conjugate, chosen = np.zeros(2 * count, bool), list[int]()
        for number in range(count):
            if sources[number] >= 0:
                continue
            for quarter, mirror, half in np.ndindex(self.quarters, self.mirrors, 2):
                mirrored = -number - is_between if mirror else number
                image = (mirrored + quarter * count // 2 + half * count) % (2 * count)
                if sources[image] < 0:
                    transform = np.linalg.matrix_power(_QUARTER, quarter) @ np.linalg.matrix_power(_MIRROR, mirror)
                    sources[image], transforms[image] = len(chosen), _extended(transform, size)
                    is_conjugate[image] = half == 1
            chosen.append(number)
        angles = np.pi * (np.array(chosen) + start) / count
        return Directions(angles, sources[:count], transforms[:count], is_conjugate[:count])


def _transformed(stiffness: Array, transform: Array) -> Array:
    """Return a stiffness whose axes are transformed by an orthogonal matrix (3, 3)."""
    extended = _extended(transform, stiffness.shape[1])
    fields = extended @ np.moveaxis(stiffness, 3, 1) @ extended.T
    return np.asarray(np.einsum("ai,dm,imBC->aBCd", transform, transform, fields))


def _in_frame(moduli: Array, frame: Array) -> Array:
    """Return thermal moduli (3, N_FIELDS) in the axes of a frame."""
    return np.asarray(frame @ moduli @ _extended(frame, N_FIELDS).T)


def _extended(transform: Array, size: int) -> Array:
    """Return a transformation (size, size) of all fields, of which the potentials stay the same."""
    result = np.eye(size)
    result[MECHANICAL, MECHANICAL] = transform
    return result


def _rotation(angle: float) -> Array:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
