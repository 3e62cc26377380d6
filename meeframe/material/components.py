"""Materials from named components, as printed in tables: c_1122, e_311, q_15, eps_33, lambda_11, mu_33, alpha_11."""

import re
from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import ELECTRIC, MAGNETIC, MECHANICAL, THERMAL_FIELD, Array
from meeframe.material.checks import material_phrase
from meeframe.material.material import SYMBOLS as MATERIAL_SYMBOLS
from meeframe.material.material import VACUUM_PERMEABILITY, VACUUM_PERMITTIVITY, Material
from meeframe.material.symmetry import Component, symmetry_class
from meeframe.material.thermal import EXPANSION, MODULI, PYROELECTRIC, PYROMAGNETIC
from meeframe.material.voigt import INDEX_PAIRS, coupling_matrix, elastic_matrix, voigt_index

UNITS: Final = {
    "c": "Pa",
    "e": "C/m^2",
    "q": "N/(A*m)",
    "eps": "F/m",
    "lambda": "s/m",
    "mu": "N*s^2/C^2",
    "k": "W/(m*K)",
    "alpha": "1/K",
    "beta": "Pa/K",
    "p": "C/(m^2*K)",
    "m": "N/(A*m*K)",
}
"""SI units of the components, by symbol."""
HEAT_SYMBOLS: Final = {
    "alpha": EXPANSION,
    "beta": MODULI,
    "p": PYROELECTRIC,
    "m": PYROMAGNETIC,
}
"""Arguments of `Material.with_heat`, by the symbol of their components; the symbol of the conductivity is k."""

_NAME: Final = re.compile(r"(c|epsilon|eps|e|q|lambda|mu|alpha|beta|k|p|m)_?([0-9]+)")
_VECTORS: Final = ("p", "m")
_VACUUM: Final = {"eps": VACUUM_PERMITTIVITY, "mu": VACUUM_PERMEABILITY}
_TOLERANCE: Final = 1e-12  # relative; values of the same component may differ by the rounding of a unit conversion


def parse_component(name: str) -> Component:
    """Return the component that a name stands for.

    Parameters
    ----------
    name : str
        Symbol and indices, with or without an underscore between them. The indices are full (c_1122, e_113 with the
        electric or magnetic index first, eps_13) or Voigt indices (c_12, e_15), in any order that eq. (8) makes
        equivalent.

    Returns
    -------
    Component
        Symbol and two 1-based indices, in canonical order.

    Raises
    ------
    MaterialError
        For any other name.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        raise _bad_name(name)
    symbol = "eps" if match[1] == "epsilon" else match[1]
    digits = [int(digit) for digit in match[2]]
    full, voigt = {"c": (4, (6, 6)), "e": (3, (3, 6)), "q": (3, (3, 6))}.get(symbol, (2, (3, 3)))
    if len(digits) == full and symbol in ("c", "e", "q") and all(1 <= digit <= 3 for digit in digits):
        *head, i, j = (digit - 1 for digit in digits)
        first = voigt_index(head[0], head[1]) if symbol == "c" else head[0]
        return _canonical(symbol, first + 1, voigt_index(i, j) + 1)
    if symbol in _VECTORS and len(digits) == 1 and 1 <= digits[0] <= 3:
        return symbol, digits[0], 0
    if (
        symbol not in _VECTORS
        and len(digits) == 2
        and all(1 <= digit <= most for digit, most in zip(digits, voigt, strict=True))
    ):
        return _canonical(symbol, *digits)
    raise _bad_name(name)


def component_label(component: Component) -> str:
    """Return the name of a component with full indices, as printed in the paper."""
    symbol, first, second = component
    if symbol in _VECTORS:
        return f"{symbol}_{first}"
    if symbol not in ("c", "e", "q"):
        return f"{symbol}_{first}{second}"
    head = _full_indices(first) if symbol == "c" else str(first)
    return f"{symbol}_{head}{_full_indices(second)}"


def material_from_components(
    name: str,
    components: Mapping[str, float],
    symmetry: str = "triclinic",
    source: str = "",
    pyro_constraint: str | None = None,
) -> Material:
    """Make a material from named components in SI units.

    Parameters
    ----------
    name : str
        Name of the material.
    components : mapping of str to float
        Components by name (see `parse_component`), in SI units.
    symmetry : {'triclinic', 'orthotropic', 'transversely-isotropic', 'cubic', 'isotropic'}
        Symmetry class. With 'triclinic', absent components are zero. The other classes (orthotropic is class mm2,
        transversely isotropic class 6mm about x3) supply the dependent components, require all independent elastic
        components, and reject components that do not exist in them.
    source : str
        Where the constants come from.
    pyro_constraint : {'strain', 'stress'}, optional
        Quantity that is constant where p and m are measured; required if one of them is present.

    Returns
    -------
    Material
        The material, with a temperature if there are components of k. If no component of eps, or of mu, is present,
        that of vacuum is used.

    Raises
    ------
    MaterialError
        For unknown names, contradictions, missing components and inadmissible materials.
    """
    try:
        independent = _collect(components)
        for symbol, value in _VACUUM.items():
            if not any(component[0] == symbol for component in independent):
                independent |= {(symbol, i, i): value for i in (1, 2, 3)}
        values = symmetry_class(symmetry).complete(independent, component_label)
    except MaterialError as error:
        raise MaterialError(f"{material_phrase(name)}: {error}") from None
    c, e, q, eps, lambda_, mu = (_matrix(symbol, values) for symbol in MATERIAL_SYMBOLS.values())
    material = Material.from_voigt(name, c, e, q, eps, lambda_, mu, source)
    symbols = {symbol for symbol, *_ in independent}
    heat = {argument: _matrix(symbol, values) for symbol, argument in HEAT_SYMBOLS.items() if symbol in symbols}
    if "k" not in symbols:
        if heat or pyro_constraint is not None:
            raise MaterialError(
                f"{material_phrase(name)}: {next(iter(heat), 'pyro_constraint')} without thermal conductivity; "
                "allowed: with components of k"
            )
        return material
    return material.with_heat(_matrix("k", values), **heat, pyro_constraint=pyro_constraint)


def material_components(material: Material) -> dict[str, float]:
    """Return the components of a material that are not zero.

    Returns
    -------
    dict of str to float
        Values in SI units by name (see `component_label`), each component once; p and m are those at constant strain.
    """
    matrices = {
        "c": elastic_matrix(material.elastic),
        "e": coupling_matrix(material.piezoelectric),
        "q": coupling_matrix(material.piezomagnetic),
        "eps": material.permittivity,
        "lambda": material.magnetoelectric,
        "mu": material.permeability,
    }
    for field, coefficient in material.decoupled:
        if field == THERMAL_FIELD:
            matrices["k"] = coefficient
    if material.thermal_moduli is not None:
        beta = material.thermal_moduli
        matrices |= {"beta": beta[:, MECHANICAL], "p": -beta[:, [ELECTRIC]], "m": -beta[:, [MAGNETIC]]}
    components: dict[str, float] = {}
    for symbol, matrix in matrices.items():
        for row, column in zip(*np.nonzero(matrix), strict=True):
            second = 0 if symbol in _VECTORS else int(column) + 1
            component = _canonical(symbol, int(row) + 1, second)
            components[component_label(component)] = float(matrix[row, column])
    return components


def _collect(components: Mapping[str, float]) -> dict[Component, float]:
    values: dict[Component, float] = {}
    names: dict[Component, str] = {}
    for name, value in components.items():
        component = parse_component(name)
        if not np.isfinite(value):
            raise MaterialError(f"{name} is {value}, must be a finite number")
        if component in values and abs(values[component] - value) > _TOLERANCE * abs(value):
            raise MaterialError(
                f"{names[component]} = {values[component]:g} and {name} = {value:g} are the same component (eq. 8) "
                "but differ"
            )
        values.setdefault(component, float(value))
        names.setdefault(component, name)
    return values


def _matrix(symbol: str, values: Mapping[Component, float]) -> Array:
    if symbol in _VECTORS:
        return np.array([values.get((symbol, i, 0), 0.0) for i in (1, 2, 3)])
    matrix = np.zeros({"c": (6, 6), "e": (3, 6), "q": (3, 6)}.get(symbol, (3, 3)))
    for (head, first, second), value in values.items():
        if head == symbol:
            matrix[first - 1, second - 1] = value
            if symbol not in ("e", "q"):
                matrix[second - 1, first - 1] = value
    return matrix


def _canonical(symbol: str, first: int, second: int) -> Component:
    if symbol not in ("e", "q", *_VECTORS) and first > second:
        first, second = second, first
    return symbol, first, second


def _full_indices(voigt: int) -> str:
    return "".join(str(i + 1) for i in INDEX_PAIRS[voigt - 1])


def _bad_name(name: str) -> MaterialError:
    examples: Iterable[str] = (
        "c_1122 or c_12",
        "e_311 or e_31",
        "q_113 or q_15",
        "eps_11",
        "lambda_11",
        "mu_11",
        "alpha_11",
        "k_11",
        "p_3",
    )
    return MaterialError(f"unknown component {name!r}; allowed: names such as {', '.join(examples)}")
