"""Extended fields, their scaling and their units."""

from meeframe.fields.field_set import (
    ELECTRIC,
    FLUX_NAMES,
    FLUX_UNITS,
    MAGNETIC,
    MECHANICAL,
    N_FIELDS,
    VALUE_NAMES,
    VALUE_UNITS,
    Array,
    FieldScaling,
    Indices,
)

__all__ = [
    "ELECTRIC",
    "FLUX_NAMES",
    "FLUX_UNITS",
    "MAGNETIC",
    "MECHANICAL",
    "N_FIELDS",
    "VALUE_NAMES",
    "VALUE_UNITS",
    "Array",
    "FieldScaling",
    "Indices",
]
