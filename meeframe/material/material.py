"""The frozen record of a magneto-electro-elastic material and its extended stiffness."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import MaterialError
from meeframe.fields import ELECTRIC, MAGNETIC, MEE, THERMAL_FIELD, Array, FieldScaling, FieldSet, ScalarField
from meeframe.fields.units import MAX_MAGNITUDE, MIN_MAGNITUDE
from meeframe.material.checks import (
    check_elastic,
    check_electromagnetic,
    material_phrase,
    validate_coefficient,
    validate_tensor,
)
from meeframe.material.rotation import validate_rotation
from meeframe.material.thermal import moduli_from_constants, rotate_moduli, validate_moduli
from meeframe.material.voigt import coupling_tensor, elastic_tensor

VACUUM_PERMITTIVITY = 8.8541878128e-12
"""Electric constant eps_0 [F/m] (CODATA 2018)."""
VACUUM_PERMEABILITY = 1.25663706212e-6
"""Magnetic constant mu_0 [N s^2/C^2 = H/m] (CODATA 2018)."""


@checked_arguments
@dataclass(frozen=True, eq=False)
class Material:
    """A homogeneous linear magneto-electro-elastic material (eqs. 5-8), in SI units.

    The constants are checked on construction.

    Attributes
    ----------
    name : str
        Name of the material.
    elastic : Array
        c_ijkl, (3, 3, 3, 3) [Pa].
    piezoelectric : Array
        e_kij, (3, 3, 3) [C/m^2], electric index first.
    piezomagnetic : Array
        q_kij, (3, 3, 3) [N/(A m)], magnetic index first.
    permittivity : Array
        eps_kl, (3, 3) [F/m].
    magnetoelectric : Array
        lambda_kl, (3, 3) [s/m].
    permeability : Array
        mu_kl, (3, 3) [N s^2/C^2].
    source : str
        Where the constants come from.
    decoupled : tuple of (ScalarField, Array)
        Further scalar fields, on which the others do not act, each with its coefficient (3, 3) in SI units.
    thermal_moduli : Array, optional
        beta_iJ at constant strain, (3, 5) in SI units, by which the temperature acts on the other fields
        (meeframe.material.thermal); None if it does not.

    Raises
    ------
    MaterialError
        If an entry is not finite, a symmetry of eq. (8) is violated, or c, the block [[eps, lambda], [lambda, mu]]
        or a further coefficient is not positive definite, or if there are thermal moduli without a thermal field.

    Notes
    -----
    The arrays are read-only.
    """

    name: str
    elastic: Array
    piezoelectric: Array
    piezomagnetic: Array
    permittivity: Array
    magnetoelectric: Array
    permeability: Array
    source: str = ""
    decoupled: tuple[tuple[ScalarField, Array], ...] = ()
    thermal_moduli: Array | None = None

    def __post_init__(self) -> None:
        for field, symbol in SYMBOLS.items():
            object.__setattr__(self, field, validate_tensor(self.name, symbol, getattr(self, field)))
        check_elastic(self.name, self.elastic)
        check_electromagnetic(self.name, self.permittivity, self.magnetoelectric, self.permeability)
        decoupled = (
            (field, validate_coefficient(self.name, field.coefficient, value)) for field, value in self.decoupled
        )
        object.__setattr__(self, "decoupled", tuple(decoupled))
        if self.thermal_moduli is not None:
            if THERMAL_FIELD not in self.fields.scalars:
                raise MaterialError(
                    f"{material_phrase(self.name)} has thermal moduli; {THERMAL_FIELD.coefficient} is missing"
                )
            object.__setattr__(self, "thermal_moduli", validate_moduli(self.name, self.thermal_moduli))

    @classmethod
    @checked_arguments
    def from_voigt(
        cls,
        name: str,
        elastic: ArrayLike,
        piezoelectric: ArrayLike,
        piezomagnetic: ArrayLike,
        permittivity: ArrayLike,
        magnetoelectric: ArrayLike,
        permeability: ArrayLike,
        source: str = "",
    ) -> "Material":
        """Make a material from Voigt matrices in SI units, in the order 11, 22, 33, 23, 13, 12.

        Parameters
        ----------
        name : str
            Name of the material.
        elastic : array_like
            c, (6, 6) [Pa].
        piezoelectric, piezomagnetic : array_like
            e [C/m^2] and q [N/(A m)], (3, 6) each.
        permittivity, magnetoelectric, permeability : array_like
            eps [F/m], lambda [s/m] and mu [N s^2/C^2], (3, 3) each.
        source : str
            Where the constants come from.

        Returns
        -------
        Material
            The material.

        Raises
        ------
        MaterialError
            If a shape is wrong, or as for `Material`.
        """
        c, e, q = (np.asarray(matrix, dtype=float) for matrix in (elastic, piezoelectric, piezomagnetic))
        for symbol, matrix, shape in (("c", c, (6, 6)), ("e", e, (3, 6)), ("q", q, (3, 6))):
            if matrix.shape != shape:
                raise MaterialError(f"material {name!r}: Voigt matrix {symbol} is {matrix.shape}, must be {shape}")
        tensors = elastic_tensor(c), coupling_tensor(e), coupling_tensor(q)
        eps, lambda_, mu = (np.asarray(matrix, dtype=float) for matrix in (permittivity, magnetoelectric, permeability))
        return cls(name, *tensors, eps, lambda_, mu, source)

    @classmethod
    def isotropic(
        cls,
        young_modulus: float,
        poisson_ratio: float,
        permittivity: float = VACUUM_PERMITTIVITY,
        permeability: float = VACUUM_PERMEABILITY,
        name: str = "isotropic",
        source: str = "",
    ) -> "Material":
        """Make an isotropic uncoupled material.

        Parameters
        ----------
        young_modulus : float
            Young's modulus > 0 [Pa].
        poisson_ratio : float
            Poisson's ratio in (-1, 1/2).
        permittivity, permeability : float
            Isotropic eps > 0 [F/m] and mu > 0 [N s^2/C^2], by default those of vacuum.
        name, source : str
            Name of the material and where its constants come from.

        Returns
        -------
        Material
            The material.

        Raises
        ------
        MaterialError
            If a constant is out of bounds.
        """
        if not (MIN_MAGNITUDE <= young_modulus <= MAX_MAGNITUDE):
            raise MaterialError(
                f"material {name!r}: young_modulus is {young_modulus} Pa, must be positive and finite, at least "
                f"{MIN_MAGNITUDE:g} and at most {MAX_MAGNITUDE:g} Pa"
            )
        if not (-1.0 < poisson_ratio < 0.5):
            raise MaterialError(f"material {name!r}: poisson_ratio is {poisson_ratio}, must lie between -1 and 0.5")
        shear = young_modulus / (2.0 * (1.0 + poisson_ratio))
        lame = 2.0 * shear * poisson_ratio / (1.0 - 2.0 * poisson_ratio)
        one, none = np.eye(3), np.zeros((3, 3, 3))
        parallel = np.einsum("ij,kl->ijkl", one, one)
        crossed = np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one)
        elastic = lame * parallel + shear * crossed
        return cls(name, elastic, none, none, permittivity * one, np.zeros((3, 3)), permeability * one, source)

    def with_field(self, field: ScalarField, coefficient: ArrayLike) -> "Material":
        """Return the material with a further scalar field that is not coupled to the others.

        Parameters
        ----------
        field : ScalarField
            The field.
        coefficient : array_like
            Its coefficient, (3, 3), three numbers on the diagonal, or one number if it is isotropic, in SI units.

        Returns
        -------
        Material
            The new material; this one is unchanged.

        Raises
        ------
        MaterialError
            As for `Material`.
        """
        if field in self.fields.scalars:
            raise MaterialError(f"{material_phrase(self.name)} has the {field.name} field already")
        tensor = np.asarray(coefficient, float)
        tensor = np.eye(3) * tensor if tensor.ndim < 2 else tensor
        return replace(self, decoupled=(*self.decoupled, (field, tensor)))

    def with_heat(
        self,
        thermal_conductivity: ArrayLike,
        thermal_expansion: ArrayLike | None = None,
        thermal_moduli: ArrayLike | None = None,
        pyroelectric: ArrayLike | None = None,
        pyromagnetic: ArrayLike | None = None,
        pyro_constraint: str | None = None,
    ) -> "Material":
        """Return the material with the temperature as a further scalar field, which acts on the others.

        Parameters
        ----------
        thermal_conductivity : array_like
            k, one number, three on the diagonal, or (3, 3) [W/(m K)], symmetric and positive definite.
        thermal_expansion, thermal_moduli : array_like, optional
            alpha [1/K] or c alpha [Pa/K]: one number, three on the diagonal, or (3, 3).
        pyroelectric, pyromagnetic : array_like, optional
            p [C/(m^2 K)] and m [N/(A m K)], (3,).
        pyro_constraint : {'strain', 'stress'}, optional
            Quantity that is constant where p and m are measured; required if one of them is given.

        Returns
        -------
        Material
            The new material; this one is unchanged.

        Raises
        ------
        MaterialError
            As for `Material` and `meeframe.material.thermal.moduli_from_constants`.
        """
        moduli = moduli_from_constants(
            self.name,
            (self.elastic, self.piezoelectric, self.piezomagnetic),
            thermal_expansion,
            thermal_moduli,
            pyroelectric,
            pyromagnetic,
            pyro_constraint,
        )
        return replace(
            self.with_field(THERMAL_FIELD, thermal_conductivity), thermal_moduli=moduli if moduli.any() else None
        )

    @cached_property
    def fields(self) -> FieldSet:
        """Fields of a body of this material."""
        return FieldSet((*MEE.scalars, *(field for field, _ in self.decoupled)))

    @cached_property
    def stiffness(self) -> Array:
        """Extended stiffness C_iJKm of eq. (40), (3, fields, fields, 3) in SI units, read-only; C_iJKm = C_mKJi."""
        extended = np.zeros((3, self.fields.size, self.fields.size, 3))
        extended[:, :3, :3, :] = self.elastic
        for field, coupling in ((ELECTRIC, self.piezoelectric), (MAGNETIC, self.piezomagnetic)):
            extended[:, :3, field, :] = np.einsum("mij->ijm", coupling)
            extended[:, field, :3, :] = coupling
        extended[:, ELECTRIC, ELECTRIC, :] = -self.permittivity
        extended[:, MAGNETIC, MAGNETIC, :] = -self.permeability
        extended[:, ELECTRIC, MAGNETIC, :] = extended[:, MAGNETIC, ELECTRIC, :] = -self.magnetoelectric
        for column, (_, coefficient) in enumerate(self.decoupled, MEE.size):
            extended[:, column, column, :] = -coefficient
        extended.setflags(write=False)
        return extended

    @cached_property
    def scaling(self) -> FieldScaling:
        """Scaling of the fields that makes the stiffness of order one."""
        return FieldScaling.of(self.stiffness)

    def rotated(self, rotation: ArrayLike) -> "Material":
        """Return the rotated material.

        Parameters
        ----------
        rotation : array_like
            Proper orthogonal matrix R, (3, 3), whose columns are the axes of the material in the global frame. Tensors
            transform as T'_ij = R_ia R_jb T_ab.

        Returns
        -------
        Material
            The new material; this one is unchanged.

        Raises
        ------
        MaterialError
            If R is not proper orthogonal.
        """
        r = validate_rotation(rotation)
        return Material(
            self.name,
            np.einsum("ia,jb,kc,ld,abcd->ijkl", r, r, r, r, self.elastic, optimize=True),
            np.einsum("ia,jb,kc,abc->ijk", r, r, r, self.piezoelectric, optimize=True),
            np.einsum("ia,jb,kc,abc->ijk", r, r, r, self.piezomagnetic, optimize=True),
            r @ self.permittivity @ r.T,
            r @ self.magnetoelectric @ r.T,
            r @ self.permeability @ r.T,
            self.source,
            tuple((field, r @ coefficient @ r.T) for field, coefficient in self.decoupled),
            None if self.thermal_moduli is None else rotate_moduli(self.thermal_moduli, r),
        )


SYMBOLS = {
    "elastic": "c",
    "piezoelectric": "e",
    "piezomagnetic": "q",
    "permittivity": "eps",
    "magnetoelectric": "lambda",
    "permeability": "mu",
}
"""Attributes of `Material` and the symbols of their components in the paper."""


def mixture(first: Material, second: Material, fraction: float) -> Material:
    """Mix two materials by the rule of mixture: fraction * first + (1 - fraction) * second (paper, section 7.1).

    Parameters
    ----------
    first, second : Material
        The constituents.
    fraction : float
        Volume fraction of the first material, in [0, 1].

    Returns
    -------
    Material
        The mixture, with a name and a source composed from those of the constituents.

    Raises
    ------
    MaterialError
        If the fraction is outside [0, 1], or the materials have different scalar fields.
    """
    if first.fields != second.fields:
        raise MaterialError(
            f"materials {first.name!r} and {second.name!r} have different scalar fields; allowed: the same"
        )
    if not 0.0 <= fraction <= 1.0:
        raise MaterialError(f"volume fraction is {fraction}, must lie between 0 and 1")
    tensors = {field: fraction * getattr(first, field) + (1.0 - fraction) * getattr(second, field) for field in SYMBOLS}
    name = f"{fraction:g} {first.name} + {1.0 - fraction:g} {second.name}"
    decoupled = tuple(
        (field, fraction * one + (1.0 - fraction) * other)
        for (field, one), (_, other) in zip(first.decoupled, second.decoupled, strict=True)
    )
    source = f"rule of mixture of [{first.source}] and [{second.source}]"
    moduli = [
        np.zeros((3, MEE.size)) if each.thermal_moduli is None else each.thermal_moduli for each in (first, second)
    ]
    mixed = fraction * moduli[0] + (1.0 - fraction) * moduli[1]
    return Material(name, **tensors, source=source, decoupled=decoupled, thermal_moduli=mixed if mixed.any() else None)
