"""The fundamental solution of a body in units of its system, computed once for further meshes."""

import math
from functools import lru_cache

import numpy as np

from meeframe.fields import N_FIELDS, THERMAL_FIELD, Array
from meeframe.formulations.dense_bem.units import Units
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.decoupled import bind_fields, check_fields
from meeframe.mesh.body import Body


def check_material(fundamental_solution: FundamentalSolution, body: Body) -> None:
    """Check that `bind_body` accepts a body.

    Parameters
    ----------
    fundamental_solution : FundamentalSolution
        Method for the coupled fields.
    body : Body
        The body.

    Raises
    ------
    MaterialError
        As `bind_body`.
    """
    _check(fundamental_solution, *_content(body))


def bind_body(fundamental_solution: FundamentalSolution, body: Body) -> Kernel:
    """Return the kernel of a body with all its fields, in units of the system.

    Parameters
    ----------
    fundamental_solution : FundamentalSolution
        Method for the coupled fields.
    body : Body
        The body.

    Returns
    -------
    Kernel
        The kernel, for offsets in units of the system.

    Raises
    ------
    MaterialError
        As `bind_fields`.
    """
    return _bind(fundamental_solution, *_content(body))


def _content(body: Body) -> tuple[bytes, bytes | None, int]:
    """Return scaled stiffness, moduli and the column of the temperature, as keys of the caches."""
    units = Units.of(body)
    stiffness, moduli = units.scaling.scale_stiffness(body.stiffness).tobytes(), units.thermal_moduli(body)
    if moduli is None:
        return stiffness, None, 0
    return stiffness, moduli.tobytes(), body.fields.index(THERMAL_FIELD.name)


@lru_cache(maxsize=256)
def _check(fundamental_solution: FundamentalSolution, stiffness: bytes, moduli: bytes | None, temperature: int) -> None:
    check_fields(fundamental_solution, *_arrays(stiffness, moduli), temperature)


@lru_cache(maxsize=4)
def _bind(
    fundamental_solution: FundamentalSolution, stiffness: bytes, moduli: bytes | None, temperature: int
) -> Kernel:
    return bind_fields(fundamental_solution, *_arrays(stiffness, moduli), temperature)


def _arrays(stiffness: bytes, moduli: bytes | None) -> tuple[Array, Array | None]:
    """Return a scaled stiffness and moduli of their bytes."""
    values = np.frombuffer(stiffness)
    size = math.isqrt(len(values) // 9)
    heat = None if moduli is None else np.frombuffer(moduli).reshape(3, N_FIELDS)
    return values.reshape(3, size, size, 3), heat
