"""Conformance of all objects that a plugin registers, with sample values for parameters without defaults."""

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, get_type_hints

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields.units import Quantity
from meeframe.material import library_material, rotation_about
from meeframe.plugin.registry import Entry, Kind, Registry
from meeframe.testing.contact import check_conductivity_law, check_contact_law, check_solver, check_wear_law
from meeframe.testing.element import check_element
from meeframe.testing.formulation import check_formulation
from meeframe.testing.fundamental import check_fundamental_solution
from meeframe.testing.indenter import check_indenter
from meeframe.testing.strategies import scaled_stiffness

_TYPICAL: Final[Mapping[str, float]] = {"": 0.3, "Pa": 1e6, "m": 1e-3, "V": 1e3, "A": 1e3, "F/m^2": 1e-3, "H/m^2": 1e-3}
"""Sample values by SI unit; 1 for other units."""


@dataclass(frozen=True)
class Checked:
    """Outcome of the conformance check of one object.

    Attributes
    ----------
    kind, name
        Kind and name of the object.
    parameters
        Values of its keys, those of its table and samples.
    failure
        Property that fails, or the reason why the object could not be checked; '' if it conforms.
    """

    kind: Kind
    name: str
    parameters: Mapping[str, Any]
    failure: str = ""


@dataclass(frozen=True)
class Magnitudes:
    """Typical magnitudes of the states at which laws are checked.

    Attributes
    ----------
    pressure, gap
        Pressure [Pa] and gap [m].
    friction
        False for solvers of frictionless contact.
    """

    pressure: float = 1e6
    gap: float = 1e-6
    friction: bool = True


def check_entries(
    registry: Registry, provider: str, tables: Mapping[str, Mapping[str, Any]], magnitudes: Magnitudes
) -> Iterator[Checked]:
    """Check all objects of a provider by the conformance check of their kind.

    Parameters
    ----------
    registry
        The registry.
    provider
        Name of the provider: a distribution, or the path of a local file.
    tables
        Keys of case files by the name of an object; parameters without a default that are absent get a sample value.
    magnitudes
        Typical magnitudes of laws.
    """
    for entry in registry.entries:
        if entry.provider.name == provider:
            yield _checked(registry, entry, tables.get(entry.record.name, {}), magnitudes)


def _checked(registry: Registry, entry: Entry, table: Mapping[str, Any], magnitudes: Magnitudes) -> Checked:
    name = entry.record.name
    parameters = {**_samples(entry), **{key: value for key, value in table.items() if key != "name"}}
    result = Checked(entry.kind, name, parameters)
    try:
        made = (
            entry.record.factory()
            if entry.kind is Kind.ELEMENT
            else registry.create(entry.kind, {"name": name, **parameters})
        )
        kit, arguments = _kit_of(entry.kind, magnitudes)
        further = entry.record.check_arguments
        kit(made, **{**arguments, **(further(made) if further else {})})
    except CaseError as error:
        return dataclasses.replace(result, failure=f"not checked: {error}")
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # code of a plugin may raise anything
        text = str(error) if isinstance(error, AssertionError) else f"{type(error).__name__}: {error}"
        return dataclasses.replace(result, failure=text)
    return result


def _kit_of(kind: Kind, magnitudes: Magnitudes) -> tuple[Callable[..., None], dict[str, Any]]:
    """Return the conformance kit of a kind and its arguments by name."""
    typical = {"pressure": magnitudes.pressure, "gap": magnitudes.gap}
    kits: dict[Kind, tuple[Callable[..., None], dict[str, Any]]] = {
        Kind.CONTACT_LAW: (check_contact_law, typical),
        Kind.CONDUCTIVITY_LAW: (check_conductivity_law, typical),
        Kind.WEAR_LAW: (check_wear_law, {"pressure": magnitudes.pressure}),
        Kind.SOLVER: (check_solver, {"friction": magnitudes.friction}),
        Kind.INDENTER: (check_indenter, {}),
        Kind.ELEMENT: (check_element, {}),
        Kind.FORMULATION: (check_formulation, {}),
        Kind.FUNDAMENTAL_SOLUTION: (_check_fundamental_solution, {}),
    }
    return kits[kind]


def _check_fundamental_solution(solution: Any, **further: Any) -> None:
    """Check a fundamental solution for an anisotropic material, unless another stiffness is given."""
    rotation = rotation_about(np.array([1.0, 2.0, 0.5]), 0.8)
    stiffness = scaled_stiffness(library_material("orthotropic-mee").rotated(rotation))
    check_fundamental_solution(solution, **{"stiffness": stiffness, **further})


def _samples(entry: Entry) -> dict[str, float]:
    """Return sample values of the quantities that have no default, within their bounds."""
    factory = entry.record.factory
    if not dataclasses.is_dataclass(factory):
        return {}
    hints = get_type_hints(factory, include_extras=True)
    samples = {}
    for field in dataclasses.fields(factory):
        required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        metadata = getattr(hints[field.name], "__metadata__", ())
        quantity = next((item for item in metadata if isinstance(item, Quantity)), None)
        if field.init and required and quantity is not None:
            samples[field.name] = _sample(quantity)
    return samples


def _sample(quantity: Quantity) -> float:
    """Return the typical value of the unit if it is within the bounds, or else a value between them."""
    typical = _TYPICAL.get(quantity.units[0], 1.0)
    low = max((quantity.bounds[key] for key in ("gt", "ge") if key in quantity.bounds), default=-math.inf)
    high = min((quantity.bounds[key] for key in ("lt", "le") if key in quantity.bounds), default=math.inf)
    if low < typical < high:
        return typical
    if math.isinf(high):
        return 2.0 * low if low > 0.0 else low + 1.0
    return 0.5 * (max(low, min(high, 0.0) - 2.0 * abs(high)) + high)
