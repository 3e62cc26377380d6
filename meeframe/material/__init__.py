"""Magneto-electro-elastic materials: extended stiffness, rotation, admissibility and a library with sources."""

from meeframe.material.components import material_from_components
from meeframe.material.library import LibraryEntry, library, library_material, material_from_table, orthotropic_mee
from meeframe.material.material import VACUUM_PERMEABILITY, VACUUM_PERMITTIVITY, Material, mixture
from meeframe.material.rotation import rotation_about, rotation_from_euler
from meeframe.material.tables import material_table, read_material, write_material

__all__ = [
    "VACUUM_PERMEABILITY",
    "VACUUM_PERMITTIVITY",
    "LibraryEntry",
    "Material",
    "library",
    "library_material",
    "material_from_components",
    "material_from_table",
    "material_table",
    "mixture",
    "orthotropic_mee",
    "read_material",
    "rotation_about",
    "rotation_from_euler",
    "write_material",
]
