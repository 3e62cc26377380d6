"""Graded layers, whose constants depend on the depth, as homogeneous sublayers."""

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.fields import N_FIELDS, Array
from meeframe.material.layers import Interface, Layer, LayerStack
from meeframe.material.material import SYMBOLS, Material, mixture
from meeframe.material.surface_symbol import SurfaceSymbol

Law = Literal["exponential", "power", "table"]
FIRST_SUBLAYERS, MAX_SUBLAYERS = 4, 256
"""Numbers of sublayers with which a division starts and ends."""
_WAVES: Final = np.array([0.3, 1.0, 3.0])
"""Wave numbers times the thickness for which the division is accurate."""
_ANGLES: Final = np.array([0.0, 0.9, 2.1])


@dataclass(frozen=True, eq=False)
class Grading:
    """Profile of the constants of a layer over its depth d, from 0 at its upper to 1 at its lower side.

    Attributes
    ----------
    law : {'exponential', 'power', 'table'}
        Profile f(d): ratio^d; d^exponent; or straight lines between factors at depths.
    ratio : float or None
        Value of an exponential profile at the lower side > 0.
    exponent : float or None
        Exponent of a power > 0.
    depths, factors : tuple of float or None
        Increasing depths, from 0 to 1, and values at them.
    material : Material or None
        Without it all constants are those of the layer's material times f, which must be positive. With it they are
        those of the mixture of a fraction f of this material and the rest of the layer's material.
    tolerance : float
        Largest relative change of the surface compliance when the number of sublayers is doubled, for waves from a
        third to three radians per thickness.

    Raises
    ------
    CaseError
        If keys of the law are missing or values are not allowed.
    """

    law: Law
    ratio: float | None = None
    exponent: float | None = None
    depths: tuple[float, ...] | None = None
    factors: tuple[float, ...] | None = None
    material: Material | None = None
    tolerance: float = 1e-3

    def __post_init__(self) -> None:
        needed = {"exponential": ("ratio",), "power": ("exponent",), "table": ("depths", "factors")}
        if self.law not in needed:
            raise CaseError(f"grading: law = {self.law!r}; allowed: {', '.join(needed)}")
        for key in ("ratio", "exponent", "depths", "factors"):
            if (getattr(self, key) is not None) != (key in needed[self.law]):
                raise CaseError(f"grading: law {self.law!r} takes the keys {', '.join(needed[self.law])}")
        for key in ("ratio", "exponent", "tolerance"):
            value = getattr(self, key)
            if value is not None and not (0.0 < value < np.inf):
                raise CaseError(f"grading: {key} = {value!r}; allowed: positive finite numbers")
        if self.law == "table":
            self._check_table()

    def _check_table(self) -> None:
        depths, factors = np.array(self.depths), np.array(self.factors)
        if len(depths) < 2 or len(depths) != len(factors):
            raise CaseError(f"grading: {len(depths)} depths with {len(factors)} factors; allowed: as many, two or more")
        if depths[0] != 0.0 or depths[-1] != 1.0 or not (np.diff(depths) > 0.0).all():
            raise CaseError("grading: depths must increase from 0 at the upper to 1 at the lower side")
        largest = 1.0 if self.material is not None else np.inf
        if not ((factors >= 0.0) & (factors <= largest)).all() or (self.material is None and not (factors > 0.0).all()):
            allowed = "positive numbers" if self.material is None else "fractions from 0 to 1"
            raise CaseError(f"grading: factors = {list(factors)}; allowed: {allowed}")

    def values(self, depths: Array) -> Array:
        """Return the factor f on the constants.

        Parameters
        ----------
        depths : Array
            Relative depths from 0 at the upper to 1 at the lower side.

        Returns
        -------
        Array
            The factors, of the same shape.
        """
        if self.law == "exponential":
            assert self.ratio is not None
            return np.asarray(self.ratio**depths)
        if self.law == "power":
            assert self.exponent is not None
            return np.asarray(depths**self.exponent)
        return np.interp(depths, self.depths or (), self.factors or ())

    def sublayers(self, material: Material, thickness: float, interface: Interface) -> tuple[Layer, ...]:
        """Return homogeneous sublayers of a layer, with the constants at the middle of each.

        Parameters
        ----------
        material : Material
            Material at the upper side.
        thickness : float
            Thickness of the layer [m].
        interface : Interface
            Interface below the layer.

        Returns
        -------
        tuple of Layer
            The sublayers from the surface down.

        Raises
        ------
        CaseError
            If more than MAX_SUBLAYERS are needed, or the compliance of the upper side is infinite.
        """
        if self.exponent is not None and self.exponent >= 1.0 and self.material is None:
            raise CaseError(
                f"grading: exponent = {self.exponent:g}: the compliance of the upper side is infinite; allowed: "
                "numbers below 1, or a material to mix with"
            )
        count, coarse = FIRST_SUBLAYERS, self._divided(material, thickness, interface, FIRST_SUBLAYERS)
        while count < MAX_SUBLAYERS:
            count *= 2
            fine = self._divided(material, thickness, interface, count)
            lowest = self._material(material, float(self.values(np.ones(1))[0]))
            both = zip(*(_responses(layers, thickness, lowest) for layers in (coarse, fine)), strict=True)
            if all(
                (np.abs(one - other) <= self.tolerance * np.abs(other).max(axis=(1, 2, 3), keepdims=True)).all()
                for one, other in both
            ):
                return fine
            coarse = fine
        raise CaseError(
            f"grading: more than {MAX_SUBLAYERS} sublayers are needed for tolerance = {self.tolerance:g}; allowed: a "
            "larger tolerance, or several layers"
        )

    def _divided(self, material: Material, thickness: float, interface: Interface, count: int) -> tuple[Layer, ...]:
        """Return a number of sublayers, of equal thickness; thinner ones at the upper side for a power."""
        bounds = np.linspace(0.0, 1.0, count + 1)
        if self.law == "power":
            bounds **= 2
        factors = self.values(0.5 * (bounds[1:] + bounds[:-1]))
        if self.exponent is not None and self.exponent < 1.0 and self.material is None:
            # the compliance has no bound at the upper side: its mean makes thin sublayers exact under tractions
            rest = 1.0 - self.exponent
            factors = rest * np.diff(bounds) / np.diff(bounds**rest)
        materials = [self._material(material, float(factor)) for factor in factors]
        thicknesses = thickness * np.diff(bounds)
        *upper, last = [Layer(*of, continues_below=True) for of in zip(materials, thicknesses.tolist(), strict=True)]
        return (*upper, replace(last, interface=interface, continues_below=False))

    def _material(self, material: Material, factor: float) -> Material:
        if self.material is not None:
            return mixture(self.material, material, factor)
        tensors = {name: factor * getattr(material, name) for name in SYMBOLS}
        decoupled = tuple((field, factor * coefficient) for field, coefficient in material.decoupled)
        moduli = None if material.thermal_moduli is None else factor * material.thermal_moduli
        return replace(material, **tensors, decoupled=decoupled, thermal_moduli=moduli)


def _responses(layers: tuple[Layer, ...], thickness: float, lowest: Material) -> tuple[NDArray[np.complex128], ...]:
    """Return Y (n, directions, f, f) of sublayers on a half space of the material at their lower side, scaled by it.

    If heat acts on other fields, that response (n, directions, N_FIELDS, 1) follows.
    """
    bonded = LayerStack((*layers[:-1], replace(layers[-1], interface=Interface())))
    moduli = [*(layer.material.thermal_moduli for layer in layers), lowest.thermal_moduli]
    expands = any(one is not None for one in moduli)
    symbol = SurfaceSymbol.of(
        lowest.stiffness, bonded, np.eye(3), _ANGLES, lowest.fields, moduli=moduli if expands else None
    )
    ratio = symbol.factors / lowest.scaling.factors
    y = np.asarray(symbol.evaluate(_WAVES / thickness) * np.outer(ratio, ratio), complex)
    if symbol.source is None:
        return (y,)
    heat = y[..., :N_FIELDS, symbol.source, None].copy()
    y[..., :N_FIELDS, symbol.source] = 0.0
    return y, heat
