"""Units of the boundary element system, in which bodies of any size and material have coefficients alike."""

from dataclasses import dataclass

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import N_FIELDS, THERMAL_FIELD, Array, FieldScaling
from meeframe.mesh.body import Body


@dataclass(frozen=True, eq=False)
class Units:
    """Units of the system: points / length; values u / s; fluxes t * s * length (docs/explanation/theory.md, Scaling).

    Attributes
    ----------
    length : float
        Unit of length [m].
    scaling : FieldScaling
        Factors s of the fields.
    amplitudes : float or Array
        Further factors of values and fluxes alike, (fields,). That of a temperature is its action on the other fields
        over the size of the body, so that the coefficients of all fields have similar magnitudes.
    """

    length: float
    scaling: FieldScaling
    amplitudes: float | Array = 1.0

    @classmethod
    def of(cls, body: Body) -> "Units":
        """Return the units of the system of a body.

        Parameters
        ----------
        body : Body
            The body.

        Returns
        -------
        Units
            The units.
        """
        plain = cls(characteristic_length(body), FieldScaling.of(body.stiffness))
        moduli = plain.thermal_moduli(body)
        if moduli is None or not moduli.any():
            return plain
        amplitudes = np.ones(body.fields.size)
        size = np.ptp(body.mesh.points, axis=0).max() / plain.length
        amplitudes[body.fields.index(THERMAL_FIELD.name)] = size * np.abs(moduli).max()
        return cls(plain.length, plain.scaling, amplitudes)

    def values(self, values: Array) -> Array:
        """Convert values from SI units to units of the system.

        Parameters
        ----------
        values : Array
            Extended displacements, (..., fields), SI units.

        Returns
        -------
        Array
            The same in units of the system.
        """
        return self.scaling.scale_values(values) * self.amplitudes

    def fluxes(self, fluxes: Array) -> Array:
        """Convert fluxes from SI units to units of the system.

        Parameters
        ----------
        fluxes : Array
            Extended tractions, (..., fields), SI units.

        Returns
        -------
        Array
            The same in units of the system.
        """
        return self.scaling.scale_fluxes(fluxes) * self.length * self.amplitudes

    def thermal_moduli(self, body: Body) -> Array | None:
        """Return the thermal moduli of a body in units of the system.

        Parameters
        ----------
        body : Body
            The body.

        Returns
        -------
        Array or None
            Moduli, (3, 5), with one power of length more than the stiffness, as the temperature is no gradient. None if
            the body has none.
        """
        if body.thermal_moduli is None:
            return None
        return self.scale_moduli(body.thermal_moduli, body.fields.index(THERMAL_FIELD.name))

    def scale_moduli(self, moduli: Array, column: int) -> Array:
        """Convert thermal moduli from SI units to units of the system.

        Parameters
        ----------
        moduli : Array
            Thermal moduli, (3, 5), SI units.
        column : int
            Column of the temperature among the fields.

        Returns
        -------
        Array
            The same in units of the system.
        """
        factors = self.scaling.factors * self.length / self.amplitudes
        scaled: Array = moduli * self.scaling.factors[:N_FIELDS] * factors[column]
        return scaled

    def values_si(self, values: Array) -> Array:
        """Convert values from units of the system to SI units.

        Parameters
        ----------
        values : Array
            Extended displacements, (..., fields), in units of the system.

        Returns
        -------
        Array
            The same in SI units.
        """
        return self.scaling.unscale_values(values) / self.amplitudes

    def fluxes_si(self, fluxes: Array) -> Array:
        """Convert fluxes from units of the system to SI units.

        Parameters
        ----------
        fluxes : Array
            Extended tractions, (..., fields), in units of the system.

        Returns
        -------
        Array
            The same in SI units.
        """
        return self.scaling.unscale_fluxes(fluxes) / self.length / self.amplitudes


def characteristic_length(body: Body) -> float:
    """Return the unit of length of the system.

    Parameters
    ----------
    body : Body
        The body.

    Returns
    -------
    float
        Diagonal of the box around the contact zone, or around a body without one [m].
    """
    group = body.contact_group
    points = body.mesh.points if group is None else body.mesh.points[body.mesh.group_points(group)]
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def check_expansion(body: Body) -> None:
    """Check that boundary elements support the thermal expansion of a body.

    Parameters
    ----------
    body : Body
        The body.

    Raises
    ------
    CaseError
        If heat acts on the other fields of a semi-infinite body.
    """
    if body.thermal_moduli is not None and body.mesh.semi_infinite:
        raise CaseError(
            "the expansion by heat does not fade with the distance, so that the surface of a semi-infinite body cannot "
            "end at the border of a mesh of boundary elements; allowed: the formulation half-space, or a finite body"
        )
