"""The fundamental solution of a body in units of its system, computed once for checks and further meshes."""

import math
from functools import lru_cache

import numpy as np

from meeframe.fields import N_FIELDS, THERMAL_FIELD
from meeframe.formulations.dense_bem.units import Units
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.decoupled import bind_fields
from meeframe.mesh.body import Body


def bind_body(fundamental_solution: FundamentalSolution, body: Body) -> Kernel:
    """Return the kernel of a body with all its fields, in units of the system.

    Parameters
    ----------
    fundamental_solution : FundamentalSolution
        Method for the coupled fields.
    body : Body
        The body.

    Raises
    ------
    MaterialError
        As `bind_fields`.
    """
    units = Units.of(body)
    moduli = units.thermal_moduli(body)
    heat = () if moduli is None else (moduli.tobytes(), body.fields.index(THERMAL_FIELD.name))
    return _bind(fundamental_solution, units.scaling.scale_stiffness(body.stiffness).tobytes(), *heat)


@lru_cache(maxsize=4)
def _bind(
    fundamental_solution: FundamentalSolution, stiffness: bytes, moduli: bytes | None = None, temperature: int = 0
) -> Kernel:
    """Return the kernel of a scaled stiffness and moduli, whose bytes are keys of the cache."""
    values = np.frombuffer(stiffness)
    size = math.isqrt(len(values) // 9)
    heat = None if moduli is None else np.frombuffer(moduli).reshape(3, N_FIELDS)
    return bind_fields(fundamental_solution, values.reshape(3, size, size, 3), heat, temperature)
