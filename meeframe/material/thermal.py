"""Coupling of the temperature into stress and fluxes: expansion, pyroelectric and pyromagnetic coefficients.

In a body at the temperature theta above the reference the extended stress is sigma_iJ = C_iJKm u_K,m - beta_iJ theta.
The thermal moduli beta, (3, 5), hold c_ijkl alpha_kl for the stress, and -p_i and -m_i for the fluxes
D_i = ... + p_i theta and B_i = ... + m_i theta, all at constant strain. Coefficients at constant stress, as tables
often give them, include the effect of the expansion: p_n(stress) = p_n(strain) + e_nkl alpha_kl (International Tables
for Crystallography D, 1.1.5.3), likewise m with q.
"""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from meeframe.common.errors import MaterialError
from meeframe.fields import ELECTRIC, MAGNETIC, MECHANICAL, N_FIELDS, Array
from meeframe.fields.units import MAX_MAGNITUDE, Quantity
from meeframe.material.checks import check_tensor_symmetry, material_phrase
from meeframe.material.voigt import INDEX_PAIRS, mandel_matrix

CONSTRAINTS: Final = ("strain", "stress")
"""Quantities that may be constant where pyroelectric and pyromagnetic coefficients are measured."""
EXPANSION, MODULI, PYROELECTRIC, PYROMAGNETIC = "thermal_expansion", "thermal_moduli", "pyroelectric", "pyromagnetic"
CONSTRAINT: Final = "pyro_constraint"
TENSOR_UNITS: Final = {EXPANSION: "1/K", MODULI: "Pa/K"}
"""Keys of [material] that take one number, three on the diagonal, or three rows of three, and their SI units."""
VECTOR_UNITS: Final = {PYROELECTRIC: "C/m^2/K", PYROMAGNETIC: "N/A/m/K"}
"""Keys of [material] that take three numbers, and their SI units."""
HEAT_KEYS: Final = (*TENSOR_UNITS, *VECTOR_UNITS, CONSTRAINT)
"""Keys of [material] about the coupling of the temperature into the other fields."""
_HELD: Final = f"{CONSTRAINT} = 'strain' or 'stress', the quantity that is constant where they are measured"


def moduli_from_constants(
    material: str,
    tensors: tuple[Array, Array, Array],
    thermal_expansion: ArrayLike | None = None,
    thermal_moduli: ArrayLike | None = None,
    pyroelectric: ArrayLike | None = None,
    pyromagnetic: ArrayLike | None = None,
    pyro_constraint: str | None = None,
) -> Array:
    """Return the thermal moduli beta at constant strain, (3, 5).

    Parameters
    ----------
    material : str
        Name of the material, for messages.
    tensors : tuple of Array
        c (3, 3, 3, 3), e and q (3, 3, 3), in SI units.
    thermal_expansion, thermal_moduli : array_like, optional
        alpha [1/K] or c alpha [Pa/K]: one number, three on the diagonal, or (3, 3). No expansion if both are absent.
    pyroelectric, pyromagnetic : array_like, optional
        p [C/(m^2 K)] and m [N/(A m K)], (3,); zero at constant strain if absent.
    pyro_constraint : {'strain', 'stress'}, optional
        Quantity that is constant where p and m are measured; required if one of them is given.

    Raises
    ------
    MaterialError
        If a value is not valid, expansion and moduli are both given, or the constraint is missing.
    """
    c, couplings = tensors[0], tensors[1:]
    alpha, beta = _tensor(material, EXPANSION, thermal_expansion), _tensor(material, MODULI, thermal_moduli)
    if thermal_expansion is not None and thermal_moduli is not None:
        raise MaterialError(f"{material_phrase(material)}: {EXPANSION} and {MODULI} are both given; allowed: one")
    coefficients = {PYROELECTRIC: pyroelectric, PYROMAGNETIC: pyromagnetic}
    stated = [name for name, value in coefficients.items() if value is not None]
    if pyro_constraint not in CONSTRAINTS and (stated or pyro_constraint is not None):
        problem = f"{' and '.join(stated)} without {CONSTRAINT}" if pyro_constraint is None else repr(pyro_constraint)
        raise MaterialError(f"{material_phrase(material)}: {problem}; allowed: {_HELD}")
    result = np.zeros((3, N_FIELDS))
    result[:, MECHANICAL] = np.einsum("ijkl,kl->ij", c, alpha) if thermal_moduli is None else beta
    if thermal_moduli is not None:
        alpha = expansion_of(c, beta)
    for field, coupling, (name, value) in zip((ELECTRIC, MAGNETIC), couplings, coefficients.items(), strict=True):
        result[:, field] = -_vector(material, name, value)
        if value is not None and pyro_constraint == "stress":
            result[:, field] += np.einsum("nkl,kl->n", coupling, alpha)
    return result


def expansion_of(elastic: Array, moduli: Array) -> Array:
    """Return the thermal expansion alpha (3, 3) [1/K] of moduli c alpha (3, 3) [Pa/K]."""
    first, second = np.array(INDEX_PAIRS).T
    weights = np.where(first == second, 1.0, np.sqrt(2.0))
    alpha = np.zeros((3, 3))
    alpha[first, second] = np.linalg.solve(mandel_matrix(elastic), weights * moduli[first, second]) / weights
    alpha[second, first] = alpha[first, second]
    return alpha


def validate_moduli(material: str, values: ArrayLike) -> Array:
    """Return thermal moduli (3, 5), read-only, their stress part exactly symmetric.

    Raises
    ------
    MaterialError
        If the shape is wrong, an entry is not finite, or the stress part is not symmetric.
    """
    moduli: Array = np.array(values, dtype=float)
    if moduli.shape != (3, N_FIELDS) or not (np.abs(moduli) <= MAX_MAGNITUDE).all():
        raise MaterialError(f"{material_phrase(material)}: {MODULI} must be finite numbers of shape (3, {N_FIELDS})")
    stress = moduli[:, MECHANICAL]
    check_tensor_symmetry(material, "beta", stress, "beta_ij = beta_ji", (1, 0))
    moduli[:, MECHANICAL] = (stress + stress.T) / 2.0
    moduli.setflags(write=False)
    return moduli


def rotate_moduli(moduli: Array, rotation: Array) -> Array:
    """Return rotated thermal moduli (3, 5)."""
    rotated: Array = rotation @ moduli
    rotated[:, MECHANICAL] = rotated[:, MECHANICAL] @ rotation.T
    return rotated


def heat_constants(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of `moduli_from_constants` that the keys of a [material] table state, in SI units.

    Raises
    ------
    MaterialError
        If a value is not a number with the right unit.
    """
    constants: dict[str, Any] = {}
    for key in HEAT_KEYS & table.keys():
        if key in TENSOR_UNITS:
            constants[key] = _convert(key, table[key], TENSOR_UNITS[key])
        elif key in VECTOR_UNITS:
            constants[key] = _convert(key, table[key], VECTOR_UNITS[key])
        else:
            constants[key] = table[key]
    return constants


def _convert(key: str, value: Any, unit: str) -> Any:
    """Return numbers in SI units, nested as given."""
    if isinstance(value, list | tuple):
        return [_convert(key, entry, unit) for entry in value]
    try:
        return Quantity(unit).convert(value)
    except ValueError as error:
        raise MaterialError(f"{key} = {value!r}: {error}") from None


def _tensor(material: str, name: str, value: ArrayLike | None) -> Array:
    """Return a symmetric tensor (3, 3) from one number, three on the diagonal, or three rows; zero for None."""
    if value is None:
        return np.zeros((3, 3))
    numbers = _numbers(value)
    if numbers.shape not in ((), (3,), (3, 3)) or not (np.abs(numbers) <= MAX_MAGNITUDE).all():
        raise MaterialError(
            f"{material_phrase(material)}: {name} is {value!r}; allowed: one number, three on the diagonal, or three "
            "rows of three"
        )
    tensor = numbers if numbers.ndim == 2 else np.diag(np.broadcast_to(numbers, 3))
    check_tensor_symmetry(material, name, tensor, f"{name}_ij = {name}_ji", (1, 0))
    return np.asarray((tensor + tensor.T) / 2.0)


def _vector(material: str, name: str, value: ArrayLike | None) -> Array:
    if value is None:
        return np.zeros(3)
    numbers = _numbers(value)
    if numbers.shape != (3,) or not (np.abs(numbers) <= MAX_MAGNITUDE).all():
        raise MaterialError(f"{material_phrase(material)}: {name} is {value!r}; allowed: three finite numbers")
    return numbers


def _numbers(value: ArrayLike) -> Array:
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError):
        return np.empty(0)
