"""Layers on a body, the interfaces below them, and the rigid base of a layer."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import ELECTRIC_FIELD, N_MECHANICAL, Array, FieldSet, Indices
from meeframe.material.material import Material

Electrode = Literal["grounded", "floating"]
_SAME_DEPTH: Final = 1e-12
"""Relative difference of depths that counts as none."""


@dataclass(frozen=True, eq=False)
class Interface:
    """The interface below a layer, at which displacement and potentials jump in proportion to tractions and fluxes.

    Attributes
    ----------
    normal_stiffness, tangential_stiffness : float
        Traction per jump of the displacement [N/m^3]; inf for a bonded interface.
    conductances : mapping of str to float
        Flux per jump of the potential by the name of the scalar field: capacitance [F/m^2] or permeance [H/m^2] per
        area; potentials without an entry are continuous.
    electrode : {'grounded', 'floating'} or None
        Thin electrode at the interface: grounded, at the potential zero; or floating, at a potential at which its total
        charge is zero.

    Raises
    ------
    CaseError
        If a stiffness or conductance is not positive, or an electrode is combined with an electric conductance.
    """

    normal_stiffness: float = np.inf
    tangential_stiffness: float = np.inf
    conductances: Mapping[str, float] = field(default_factory=dict)
    electrode: Electrode | None = None

    def __post_init__(self) -> None:
        values = {"normal_stiffness": self.normal_stiffness, "tangential_stiffness": self.tangential_stiffness}
        values |= {f"{name}_conductance": value for name, value in self.conductances.items()}
        for name, value in values.items():
            if not value > 0.0:
                raise CaseError(
                    f"interface: {name} = {value!r}; allowed: positive numbers, or inf for a bonded interface"
                )
        if self.electrode not in (None, "grounded", "floating"):
            raise CaseError(f"interface: electrode = {self.electrode!r}; allowed: 'grounded', 'floating'")
        if self.electrode and np.isfinite(self.conductances.get(ELECTRIC_FIELD.name, np.inf)):
            raise CaseError(
                "interface: electrode together with electric_conductance; allowed: one of them, or a thin layer "
                "between two interfaces"
            )

    def compliance(self, fields: FieldSet) -> Array:
        """Return the jumps per unit of traction and flux, positive for displacements.

        Those of potentials are negative, because the outward flux drives the potential above the interface down.

        Parameters
        ----------
        fields : FieldSet
            Fields of the body.

        Returns
        -------
        Array
            (fields.size,) jumps.
        """
        scalars = [-1.0 / self.conductances.get(name, np.inf) for name in fields.names]
        return np.array(
            [*(1.0 / self.tangential_stiffness,) * (N_MECHANICAL - 1), 1.0 / self.normal_stiffness, *scalars]
        )

    @property
    def is_bonded(self) -> bool:
        """True if displacement, potentials, tractions and fluxes are continuous."""
        springs = (self.normal_stiffness, self.tangential_stiffness, *self.conductances.values())
        return self.electrode is None and not np.isfinite(springs).any()


@dataclass(frozen=True, eq=False)
class Layer:
    """A plane layer of constant thickness.

    Attributes
    ----------
    material : Material
        Its material, in the axes of the body.
    thickness : float
        Thickness [m].
    interface : Interface
        The interface below it.
    continues_below : bool
        True if the layer below it continues the same graded layer.

    Raises
    ------
    CaseError
        If the thickness is not positive and finite.
    """

    material: Material
    thickness: float
    interface: Interface = field(default_factory=Interface)
    continues_below: bool = False

    def __post_init__(self) -> None:
        _check_thickness("layer", self.thickness)


@dataclass(frozen=True, eq=False)
class RigidBase:
    """A rigid base below the material of the body, which then is a layer of finite thickness instead of a half space.

    Attributes
    ----------
    thickness : float
        Thickness of the body's material on the base [m].
    insulating : tuple of str
        Names of the scalar fields whose flux into the base is zero; all other potentials are zero on it.

    Raises
    ------
    CaseError
        If the thickness is not positive and finite.
    """

    thickness: float
    insulating: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _check_thickness("base", self.thickness)


@dataclass(frozen=True, eq=False)
class LayerStack:
    """Layers on a body, and what the body rests on.

    Attributes
    ----------
    layers : tuple of Layer
        Layers from the surface down to the material of the body.
    base : RigidBase or None
        Rigid base below the material of a half space.
    """

    layers: tuple[Layer, ...] = ()
    base: RigidBase | None = None

    def __bool__(self) -> bool:
        """Return False for a homogeneous body."""
        return bool(self.layers) or self.base is not None

    @property
    def thickness(self) -> float:
        """Thickness of all layers together [m], without the material of the body."""
        return float(sum(layer.thickness for layer in self.layers))

    @property
    def bottoms(self) -> Array:
        """Depths of the lower sides of all layers below the surface [m], that of a layer on a rigid base included."""
        thicknesses = [layer.thickness for layer in self.layers]
        return np.cumsum(thicknesses + ([] if self.base is None else [self.base.thickness]))

    @property
    def interface_depths(self) -> Array:
        """Depths of the interfaces below the surface [m], with that on a rigid base, without those of sublayers."""
        ends = [not layer.continues_below for layer in self.layers]
        return self.bottoms[ends + [True] * (self.base is not None)]

    def numbers_at(self, depths: Array) -> Indices:
        """Return the numbers of the layers at depths, from 0; on an interface that of the layer above it.

        Parameters
        ----------
        depths : Array
            Depths below the surface [m].

        Returns
        -------
        Indices
            Number of the layer at each depth; that of the half space follows those of the layers.
        """
        return layer_numbers(self.bottoms, depths)

    def locate(self, depth: float) -> tuple[int, float, float]:
        """Return the number of the layer at a depth [m] and the distances from its upper and lower side [m].

        Parameters
        ----------
        depth : float
            Depth below the surface [m].

        Returns
        -------
        tuple of int, float and float
            Number of the layer, and both distances; the second one is inf below the last layer.
        """
        return locate_depth(self.bottoms, depth)

    @property
    def top_thickness(self) -> float:
        """Thickness of the material at the surface [m]; inf for a homogeneous half space."""
        if self.layers:
            return self.layers[0].thickness
        return np.inf if self.base is None else self.base.thickness


def layer_numbers(bottoms: Array, depths: Array | float) -> Indices:
    """Return the numbers of the layers at depths, from 0; on an interface that of the layer above it.

    bottoms: depths of the lower sides of all layers, below which the number is theirs.
    """
    return np.asarray(np.searchsorted(bottoms * (1.0 + _SAME_DEPTH), depths))


def locate_depth(bottoms: Array, depth: float) -> tuple[int, float, float]:
    """Return the number of the layer at a depth, as `layer_numbers`, and distances from its upper and lower side.

    Below the last layer the distance from the lower side is inf.
    """
    number = int(layer_numbers(bottoms, depth))
    top, bottom = np.concatenate([[0.0], bottoms, [np.inf]])[number : number + 2].tolist()
    return number, min(depth, bottom) - top, max(bottom - depth, 0.0)


def _check_thickness(what: str, thickness: float) -> None:
    if not (0.0 < thickness < np.inf):
        raise CaseError(f"{what}: thickness = {thickness!r}; allowed: positive finite lengths")
