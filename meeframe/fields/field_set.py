"""Field sets: the displacement and the scalar potentials of a problem, their fluxes, units and scaling.

The extended displacement u = (u1, u2, u3, phi, psi, ...) holds three components and one potential for each scalar
field; the extended traction t = (t1, t2, t3, q, s, ...) holds the conjugate fluxes on the outward unit normal nu, with
q = D.nu and s = B.nu (paper, appendix A). Arrays with a field index have length FieldSet.size along it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Array of double-precision numbers; each docstring states its shape and unit."""
Indices = NDArray[np.int64]
"""Array of integers, such as indices of nodes."""

N_MECHANICAL: Final = 3
"""Number of displacement components, which come before the potentials."""
MECHANICAL: Final = slice(0, N_MECHANICAL)
"""Columns of the displacement and the traction in arrays (n, fields)."""
TANGENTIAL: Final = (0, 1)
"""Columns of their tangential components, in local frames."""
NORMAL: Final = 2
"""Column of their normal component, in local frames."""
POTENTIALS: Final = slice(N_MECHANICAL, None)
"""Columns of the potentials and the fluxes in arrays (n, fields), however many there are."""


@dataclass(frozen=True)
class ScalarField:
    """A scalar potential, its conjugate flux, and the names and units under which both appear.

    The flux density on the outward normal is the normal component of -(coefficient) grad(potential), plus couplings.

    Attributes
    ----------
    name : str
        Name of the field, which is also its key in `[conductivity]` of a case file: "electric".
    value_name, value_unit : str
        The potential and its SI unit. A potential of the indenter counts among the indenter's motions by this name.
    flux_name, flux_unit : str
        The flux density and its SI unit.
    resultant, resultant_unit : str
        The total flux through the contact and its SI unit. A load step prescribes it in place of the potential.
    coefficient, coefficient_unit : str
        The material tensor that relates flux and gradient, which is a key of `[material]`, and its SI unit.
    conductance_unit, strength_unit : str
        SI units of flux density over potential (conductivity laws of the contact) and of the gradient.
    """

    name: str
    value_name: str
    value_unit: str
    flux_name: str
    flux_unit: str
    resultant: str
    resultant_unit: str
    coefficient: str
    coefficient_unit: str
    conductance_unit: str
    strength_unit: str


ELECTRIC_FIELD: Final = ScalarField(
    name="electric",
    value_name="electric_potential",
    value_unit="V",
    flux_name="electric_flux",
    flux_unit="C/m^2",
    resultant="charge",
    resultant_unit="C",
    coefficient="permittivity",
    coefficient_unit="F/m",
    conductance_unit="F/m^2",
    strength_unit="V/m",
)
"""Electric potential and electric flux, D.nu."""
MAGNETIC_FIELD: Final = ScalarField(
    name="magnetic",
    value_name="magnetic_potential",
    value_unit="A",
    flux_name="magnetic_flux",
    flux_unit="Wb/m^2",
    resultant="magnetic_flux",
    resultant_unit="Wb",
    coefficient="permeability",
    coefficient_unit="H/m",
    conductance_unit="H/m^2",
    strength_unit="A/m",
)
"""Magnetic potential and magnetic flux density, B.nu."""
THERMAL_FIELD: Final = ScalarField(
    name="thermal",
    value_name="temperature",
    value_unit="K",
    flux_name="heat_flux",
    flux_unit="W/m^2",
    resultant="heat",
    resultant_unit="W",
    coefficient="thermal_conductivity",
    coefficient_unit="W/m/K",
    conductance_unit="W/m^2/K",
    strength_unit="K/m",
)
"""Temperature above the reference at which the body is free of stress, and heat flux."""


@dataclass(frozen=True)
class FieldSet:
    """Displacement and some scalar fields, in the order of their columns.

    Attributes
    ----------
    scalars : tuple of ScalarField
        The scalar fields, whose columns follow the three of the displacement.
    """

    scalars: tuple[ScalarField, ...]

    @cached_property
    def size(self) -> int:
        """Number of columns of arrays with a field index."""
        return N_MECHANICAL + len(self.scalars)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the scalar fields."""
        return tuple(scalar.name for scalar in self.scalars)

    @cached_property
    def value_names(self) -> tuple[str, ...]:
        """Names of the columns of the extended displacement."""
        return (*(f"displacement_{i}" for i in (1, 2, 3)), *(scalar.value_name for scalar in self.scalars))

    @cached_property
    def value_units(self) -> tuple[str, ...]:
        """SI units of the columns of the extended displacement."""
        return (*(("m",) * N_MECHANICAL), *(scalar.value_unit for scalar in self.scalars))

    @cached_property
    def flux_names(self) -> tuple[str, ...]:
        """Names of the columns of the extended traction."""
        return (*(f"traction_{i}" for i in (1, 2, 3)), *(scalar.flux_name for scalar in self.scalars))

    @cached_property
    def flux_units(self) -> tuple[str, ...]:
        """SI units of the columns of the extended traction."""
        return (*(("Pa",) * N_MECHANICAL), *(scalar.flux_unit for scalar in self.scalars))

    def index(self, name: str) -> int:
        """Return the column of a scalar field.

        Parameters
        ----------
        name : str
            Name of the field.

        Returns
        -------
        int
            Its column, counted from the first displacement.

        Raises
        ------
        ValueError
            If there is no such field.
        """
        return N_MECHANICAL + self.names.index(name)


MEE: Final = FieldSet((ELECTRIC_FIELD, MAGNETIC_FIELD))
"""Fields of a magneto-electro-elastic body, which every material has."""

OPTIONAL_FIELDS: Final[tuple[ScalarField, ...]] = (THERMAL_FIELD,)
"""Further scalar fields, on which the others do not act, which a body has if its material gives their coefficient."""

N_FIELDS: Final = MEE.size
"""Size of the default field set, used by kernels that are compiled for one size."""
ELECTRIC: Final = MEE.index(ELECTRIC_FIELD.name)
"""Index of the electric potential among all fields."""
MAGNETIC: Final = MEE.index(MAGNETIC_FIELD.name)
"""Index of the magnetic potential among all fields."""


@dataclass(frozen=True, eq=False)
class FieldScaling:
    """Factors s_J that make all entries of the extended stiffness of order one (docs/explanation/theory.md, Scaling).

    C'_iJKm = s_J s_K C_iJKm, u' = u / s, t' = s t, where primes mark scaled fields. In SI units the extended stiffness
    has a condition number near 1e19; scaled, near 10.

    Attributes
    ----------
    factors : Array
        Factors s_J, (fields,) > 0.
    """

    factors: Array

    @classmethod
    def of(cls, stiffness: Array) -> "FieldScaling":
        """Return the scaling of an extended stiffness.

        Parameters
        ----------
        stiffness : Array
            C_iJKm, (3, fields, fields, 3), SI units.

        Returns
        -------
        FieldScaling
            Factors by which the largest entry of each diagonal block becomes one.
        """
        elastic = np.abs(stiffness[:, MECHANICAL, MECHANICAL, :]).max()
        scalars = (np.abs(stiffness[:, k, k, :]).max() for k in range(N_MECHANICAL, stiffness.shape[1]))
        factors = np.array([*(elastic,) * N_MECHANICAL, *scalars]) ** -0.5
        factors.setflags(write=False)
        return cls(factors)

    def scale_stiffness(self, stiffness: Array) -> Array:
        """Return a scaled extended stiffness.

        Parameters
        ----------
        stiffness : Array
            C_iJKm, (3, fields, fields, 3), SI units.

        Returns
        -------
        Array
            C'_iJKm, (3, fields, fields, 3).
        """
        scaled: Array = stiffness * self.factors[None, :, None, None] * self.factors[None, None, :, None]
        return scaled

    def scale_values(self, values: Array) -> Array:
        """Return scaled extended displacements.

        Parameters
        ----------
        values : Array
            u, (..., fields), SI units.

        Returns
        -------
        Array
            u', (..., fields).
        """
        return values / self.factors

    def unscale_values(self, values: Array) -> Array:
        """Return extended displacements in SI units.

        Parameters
        ----------
        values : Array
            u', (..., fields), scaled.

        Returns
        -------
        Array
            u, (..., fields).
        """
        return values * self.factors

    def scale_fluxes(self, fluxes: Array) -> Array:
        """Return scaled extended tractions.

        Parameters
        ----------
        fluxes : Array
            t, (..., fields), SI units.

        Returns
        -------
        Array
            t', (..., fields).
        """
        return fluxes * self.factors

    def unscale_fluxes(self, fluxes: Array) -> Array:
        """Return extended tractions in SI units.

        Parameters
        ----------
        fluxes : Array
            t', (..., fields), scaled.

        Returns
        -------
        Array
            t, (..., fields).
        """
        return fluxes / self.factors
