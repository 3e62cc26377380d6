"""What the conformance checks share: a property that holds, or an AssertionError that names it and shows a value."""

import dataclasses
from typing import Final

import numpy as np

from meeframe.core.fields import Array

ROUND_OFF: Final = 1e-12


def require(holds: bool, what: str, value: object) -> None:
    """Raises AssertionError with the name of the property and an offending value unless it holds."""
    if not holds:
        raise AssertionError(f"{what}: {value}")


def close(actual: Array, expected: Array, scale: float, what: str) -> None:
    """Requires that arrays agree to round-off in parts of a scale."""
    error = np.abs(actual - expected).max(initial=0.0) / scale
    require(bool(error <= ROUND_OFF), what, error)


def check_frozen(record: object) -> None:
    """Requires a frozen dataclass that is equal to its copy."""
    frozen = getattr(getattr(type(record), "__dataclass_params__", None), "frozen", False)
    require(frozen, "is no frozen dataclass", type(record).__name__)
    values = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}  # type: ignore[arg-type]
    require(type(record)(**values) == record, "is not equal to its copy", record)
