"""Layers on a body, the interfaces below them, and the rigid base of a layer."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import ELECTRIC_FIELD, N_MECHANICAL, Array, FieldSet
from meeframe.material.material import Material

Electrode = Literal["grounded", "floating"]


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
        """Return the jumps (fields.size,) per unit of traction and flux, positive for displacements.

        Those of potentials are negative, because the outward flux drives the potential above the interface down.
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

    Raises
    ------
    CaseError
        If the thickness is not positive and finite.
    """

    material: Material
    thickness: float
    interface: Interface = field(default_factory=Interface)

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
    def top_thickness(self) -> float:
        """Thickness of the material at the surface [m]; inf for a homogeneous half space."""
        if self.layers:
            return self.layers[0].thickness
        return np.inf if self.base is None else self.base.thickness


def _check_thickness(what: str, thickness: float) -> None:
    if not (0.0 < thickness < np.inf):
        raise CaseError(f"{what}: thickness = {thickness!r}; allowed: positive finite lengths")
