"""Field sets, their scaling and their units."""

from meeframe.fields.field_set import (
    ELECTRIC,
    ELECTRIC_FIELD,
    MAGNETIC,
    MAGNETIC_FIELD,
    MECHANICAL,
    MEE,
    N_FIELDS,
    N_MECHANICAL,
    OPTIONAL_FIELDS,
    POTENTIALS,
    THERMAL_FIELD,
    Array,
    FieldScaling,
    FieldSet,
    Indices,
    ScalarField,
)

__all__ = [
    "ELECTRIC",
    "ELECTRIC_FIELD",
    "MAGNETIC",
    "MAGNETIC_FIELD",
    "MECHANICAL",
    "MEE",
    "N_FIELDS",
    "N_MECHANICAL",
    "OPTIONAL_FIELDS",
    "POTENTIALS",
    "THERMAL_FIELD",
    "Array",
    "FieldScaling",
    "FieldSet",
    "Indices",
    "ScalarField",
]
