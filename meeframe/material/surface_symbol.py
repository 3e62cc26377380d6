"""Surface compliance of layered half spaces, for waves of any length.

A stack of plane layers in z < 0 carries the extended surface traction t^ exp(i k m.x); its surface moves by
u^ exp(i k m.x), u^ = Y(k, m) t^ / k. In each layer u and t / k obey a linear equation in k z with a constant matrix of
twice as many rows as there are fields. Half of its solutions decay downwards, with u = Y_+ t / k, where Y_+ is the
compliance of a half space of the layer's material, from the integrals of Barnett and Lothe. The other half decays
upwards, with Y_- = -conj(Y_+). The recursion goes from the lowest medium up. It uses decaying exponentials alone, so
that neither thick layers nor degenerate materials are exceptions, and yields the difference of Y from Y_+ of the top
layer without cancellation.

Heat that acts on the other fields adds a column to the response: u^ = y_h(k, m) h^ / k^2 for the outward heat flux h^,
one power of length more than for tractions. With theta / k and h / k^2 in place of theta and h / k in the state, the
matrix in each layer is constant again, with the thermal moduli in its column of the temperature: T^-1 beta_n for u, and
i beta_m - i R T^-1 beta_n for t / k. The same recursion then yields y_h as the column of the heat flux in Y, which is
no longer Hermitian. Conjugate solutions belong to moduli, or temperatures, of the opposite sign, so that
Y_- = -P conj(Y_+) P, where P changes the sign of the temperature.

Sources: Kausel and Roesset, Bull. Seismol. Soc. Am. 71 (1981) 1743, and Wang and Rokhlin, J. Mech. Phys. Solids 52
(2004) 2473, on recursions for layered media; Ting, Anisotropic Elasticity (1996), chapters 6 and 7, on Y_+.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeVar

import numpy as np

from meeframe.fields import ELECTRIC, MEE, N_FIELDS, THERMAL_FIELD, Array, FieldSet
from meeframe.material.layers import Interface, LayerStack
from meeframe.material.medium import Complex, Expansion, Medium, reflection, sum_series

Number = TypeVar("Number", Array, Complex)

MAX_SERIES_DEPTH: Final = 0.2
"""Thickness times wave number up to which `SurfaceSymbol.evaluate` sums the solutions in a layer as a series: on a
rigid base Y is as small as this number, and the recursion would lose its digits, other than the difference from Y_+."""


@dataclass(frozen=True, eq=False)
class SurfaceSymbol:
    """Surface compliance Y(k, m) of layers for waves in some directions m.

    If heat acts on other fields, the column of the heat flux is y_h(k, m): u^ = Y t^ / k + y_h h^ / k^2. Without it, Y
    is Hermitian and conjugate for opposite directions. With the signs of the potentials' rows changed, its Hermitian
    part is positive definite; semidefinite directly below an electrode.

    Attributes
    ----------
    media : tuple of Medium
        The materials from the top; the last one is the half space, or the layer on a rigid base.
    thicknesses : tuple of float
        Thicknesses of the media from the top [m], without that of a half space.
    interfaces : tuple of Interface
        The interfaces between them.
    insulating : Array or None
        (fields,) 1 for the fields that a rigid base insulates, 0 for others; None for a half space.
    fields : FieldSet
        Names of the fields.
    source : int or None
        Column of the temperature if it acts on other fields, else None.
    """

    media: tuple[Medium, ...]
    thicknesses: tuple[float, ...]
    interfaces: tuple[Interface, ...]
    insulating: Array | None
    fields: FieldSet
    source: int | None = None

    @classmethod
    def of(
        cls,
        stiffness: Array,
        layers: LayerStack,
        frame: Array,
        angles: Array,
        fields: FieldSet = MEE,
        half_spaces: Sequence[Complex] | None = None,
        moduli: Sequence[Array | None] | None = None,
    ) -> "SurfaceSymbol":
        """Return the symbol of layers on a material.

        Parameters
        ----------
        stiffness : Array
            Extended stiffness of the material below the layers, (3, fields, fields, 3) [SI].
        layers : LayerStack
            The layers, and the base.
        frame : Array
            Rows e1, e2 and the outward normal, (3, 3).
        angles : Array
            Directions m = cos(angle) e1 + sin(angle) e2, (directions,).
        fields : FieldSet, optional
            Names of the fields.
        half_spaces : sequence of ndarray of complex, optional
            Scaled compliances of half spaces of all materials, (directions, fields, fields) each, if they are known.
        moduli : sequence of Array or None, optional
            Thermal moduli (3, N_FIELDS) [SI] of the layers and the material below them, whose action on the other
            fields the compliance then includes. Without them heat acts on the temperature alone.

        Returns
        -------
        SurfaceSymbol
            The symbol.

        Raises
        ------
        MaterialError
            As `surface_compliance`.
        """
        stiffnesses = [*(layer.material.stiffness for layer in layers.layers), stiffness]
        thicknesses, insulating = [layer.thickness for layer in layers.layers], None
        if layers.base is not None:
            thicknesses.append(layers.base.thickness)
            insulating = np.array([*(0.0,) * 3, *(float(name in layers.base.insulating) for name in fields.names)])
        source = None
        expansions: list[Expansion | None] = [None] * len(stiffnesses)
        if moduli is not None:
            source = fields.index(THERMAL_FIELD.name)
            expansions = [Expansion(np.zeros((3, N_FIELDS)) if one is None else one, source) for one in moduli]
        if half_spaces is None:
            materials = [
                (one, expansion, (one.tobytes(), b"" if expansion is None else expansion.moduli.tobytes()))
                for one, expansion in zip(stiffnesses, expansions, strict=True)
            ]
            made = {
                key: Medium.of(one, frame, angles, expansion=expansion)
                for key, (one, expansion) in {key: (one, expansion) for one, expansion, key in materials}.items()
            }
            media = tuple(made[key] for *_, key in materials)
        else:
            known = zip(stiffnesses, half_spaces, expansions, strict=True)
            media = tuple(Medium.of(one, frame, angles, plus, expansion) for one, plus, expansion in known)
        return cls(
            media,
            tuple(thicknesses),
            tuple(layer.interface for layer in layers.layers),
            insulating,
            fields,
            source,
        )

    @property
    def factors(self) -> Array:
        """Factors (fields,) of the scaled fields of all results: those of the top material."""
        return self.media[0].factors

    @property
    def top(self) -> Complex:
        """Y of a half space of the top material, the limit of short waves, (directions, fields, fields), scaled."""
        return self.media[0].plus

    @property
    def slowest_decays(self) -> Array:
        """Smallest exponents (media,) of waves per k z in each medium."""
        return np.array([medium.slowest_decay for medium in self.media])

    @property
    def bottoms(self) -> Array:
        """Depths of the lower sides of all media below the surface [m], without that of a half space."""
        return np.cumsum(self.thicknesses)

    def evaluate(self, k: Array) -> Complex:
        """Return Y(k, m) at wave numbers k.

        Parameters
        ----------
        k : Array
            Wave numbers > 0, (n,) [1/m].

        Returns
        -------
        Array
            (n, directions, fields, fields), scaled.
        """
        return self._symmetrized(_divide(*self._above(np.asarray(k, float)[:, None], 0, MAX_SERIES_DEPTH)))

    def difference(self, k: Array) -> Complex:
        """Return Y(k, m) less that of the top material, without cancellation.

        Parameters
        ----------
        k : Array
            As for `evaluate`.

        Returns
        -------
        Array
            As of `evaluate`.
        """
        if not self.thicknesses:
            return np.zeros((len(k), *self.top.shape), complex)
        k = np.asarray(k, float)[:, None]
        g, _ = reflection(self.media[0], k * self.thicknesses[0], *self.below(k, 0))
        return self._symmetrized((self.media[0].minus - self.media[0].plus) @ _divide(g, np.eye(g.shape[-1]) + g))

    def _symmetrized(self, compliance: Complex) -> Complex:
        """Return a compliance whose columns but that of the heat flux are exactly Hermitian."""
        result = 0.5 * (compliance + compliance.conj().swapaxes(-1, -2))
        if self.source is not None:
            result[..., :N_FIELDS, self.source] = compliance[..., :N_FIELDS, self.source]
            result[..., self.source, :N_FIELDS] = 0.0
        return np.asarray(result, complex)

    def ascend(self, k: Array, series_depth: float = 0.0) -> Iterator[tuple[Complex, Complex]]:
        """Yield the subspaces u = U c, t / k = V c at the lower sides of all layers, in their scaled fields, upwards.

        Parameters
        ----------
        k : Array
            Wave numbers (n, 1) for all directions, or (1, directions) for one each [1/m].
        series_depth : float, optional
            Wave number times thickness up to which layers are crossed by series.

        Yields
        ------
        tuple of Array and Array
            U and V, (n, directions, fields, fields) each.
        """
        if not self.thicknesses:
            return
        number, lowest = len(self.thicknesses) - 1, self.media[-1]
        one = np.eye(len(self.factors), dtype=complex)
        shape = k.shape[0], *lowest.plus.shape
        if self.insulating is None:
            u, v = self._cross(k, number, np.broadcast_to(lowest.plus, shape), np.broadcast_to(one, shape))
        else:
            free = np.diag(self.insulating).astype(complex)
            u, v = np.broadcast_to(free, shape), np.broadcast_to(one - free, shape)
        yield u, v
        for layer in range(number, 0, -1):
            u, v = self._cross(k, layer - 1, *self._rise(k, layer, u, v, series_depth))
            yield u, v

    def below(self, k: Array, number: int, series_depth: float = 0.0) -> tuple[Complex, Complex]:
        """Return the subspace at the lower side of a layer.

        Parameters
        ----------
        k, series_depth
            As for `ascend`.
        number : int
            Number of the layer, from 0 at the surface.

        Returns
        -------
        tuple of Array and Array
            U and V, as of `ascend`.
        """
        subspaces = self.ascend(k, series_depth)
        for _ in range(len(self.thicknesses) - 1 - number):
            next(subspaces)
        return next(subspaces)

    def _above(self, k: Array, number: int, series_depth: float) -> tuple[Complex, Complex]:
        """Return the subspace at the upper side of a medium, as `ascend`."""
        medium = self.media[number]
        if number == len(self.thicknesses):  # the half space
            shape = k.shape[0], *medium.plus.shape
            return np.broadcast_to(medium.plus, shape), np.broadcast_to(np.eye(shape[-1], dtype=complex), shape)
        return self._rise(k, number, *self.below(k, number, series_depth), series_depth)

    def _cross(self, k: Array, number: int, u: Complex, v: Complex) -> tuple[Complex, Complex]:
        """Return the subspace at the lower side of a layer from that at the upper side of the medium below it."""
        medium, lower = self.media[number], self.media[number + 1]
        u, v = _cross_interface(self.interfaces[number], self.fields, lower.factors, k, u, v)
        ratio = medium.factors / lower.factors
        return u / (ratio[:, None] * ratio), v * (ratio[:, None] / ratio)

    def _rise(self, k: Array, number: int, u: Complex, v: Complex, series_depth: float) -> tuple[Complex, Complex]:
        """Return the subspace at the upper side of a layer from that at its lower side."""
        medium, depth = self.media[number], k * self.thicknesses[number]
        short = (depth <= series_depth).all(axis=1)
        if not short.any():
            g, _ = reflection(medium, depth, u, v)
            return medium.plus + medium.minus @ g, np.eye(g.shape[-1]) + g
        u, v = u.copy(), v.copy()
        u[short], v[short] = sum_series(medium, depth[short], u[short], v[short])
        if not short.all():
            g, _ = reflection(medium, depth[~short], u[~short], v[~short])
            u[~short], v[~short] = medium.plus + medium.minus @ g, np.eye(g.shape[-1]) + g
        return u, v

    def compliance_at(self, k: Array, number: int) -> Complex:
        """Return Y at the upper side of a medium, in its scaled fields.

        Parameters
        ----------
        k : Array
            Wave numbers (1, directions), one for each direction, or (1, 1) for all [1/m].
        number : int
            Number of the medium, from 0 at the surface.

        Returns
        -------
        Array
            (directions, fields, fields).
        """
        compliance: Complex = _divide(*self._above(k, number, MAX_SERIES_DEPTH))[0]
        return compliance

    def uniform_compliances(self, k: float, mean: Callable[[Complex], Array]) -> dict[int, Array]:
        """Return the responses (fields, fields) [m] to uniform loads, scaled, by the number of the medium on whose top.

        They are those at the surface, and those below grounded electrodes, which determine the charge there. They are
        finite above a rigid base that insulates no field. Elsewhere the response to a uniform load has no limit, and
        that to a wave is taken, averaged over its directions; above a grounded electrode, layers respond uniformly.
        Floating electrodes are no obstacle to a uniform load.

        Parameters
        ----------
        k : float
            Wave number [1/m].
        mean : callable
            Function that returns the mean over all directions, (fields, fields), of compliances in the directions of
            this symbol, (directions, fields, fields).

        Returns
        -------
        dict of int to Array
            Response (fields, fields) by the number of the medium.
        """
        interfaces = (replace(one, electrode=None) if one.electrode == "floating" else one for one in self.interfaces)
        to_waves = replace(self, interfaces=tuple(interfaces))

        def wave_response(number: int) -> Array:
            compliance = mean(to_waves.compliance_at(np.full((1, 1), k), number)).real / k
            return self._from_medium(0.5 * (compliance + compliance.T), number)

        is_finite = self.insulating is not None and not self.insulating.any()
        total = np.zeros((len(self.factors),) * 2) if is_finite else None
        responses = {}
        for number in range(len(self.media) - 1, -1, -1):
            interface = self.interfaces[number] if number < len(self.interfaces) else Interface()
            if interface.electrode == "grounded":
                responses[number + 1] = wave_response(number + 1) if total is None else total
                total = _without(responses[number + 1] + self._jumps(interface), ELECTRIC)
            elif total is not None:
                total = total + self._jumps(interface)
            if total is not None:
                total = total + self.thicknesses[number] * self.normal_compliance(number)
        responses[0] = wave_response(0) if total is None else total
        return responses

    def uniform_heat_response(self) -> Array | None:
        """Return the response (fields,) [m^2] to a uniform heat flux, scaled; None without a base that grounds all.

        The temperature falls linearly in each layer, from which the displacement and the potentials follow without any
        traction or flux. A grounded electrode is charged such that its potential is zero.
        """
        if self.source is None or self.insulating is None or self.insulating.any():
            return None
        total, values = np.zeros((len(self.factors),) * 2), np.zeros(len(self.factors))
        for number in range(len(self.media) - 1, -1, -1):
            interface = self.interfaces[number] if number < len(self.interfaces) else Interface()
            total = total + self._jumps(interface)
            if interface.electrode == "grounded":
                values = values - total[:, ELECTRIC] * (values[ELECTRIC] / total[ELECTRIC, ELECTRIC])
                total = _without(total, ELECTRIC)
            medium, thickness = self.media[number], self.thicknesses[number]
            ratio = medium.factors / self.factors
            strains = medium.state[0, : len(ratio), self.source].real * ratio / ratio[self.source]
            across = thickness * self.normal_compliance(number)
            mean_temperature = total[self.source, self.source] + 0.5 * across[self.source, self.source]
            values[:N_FIELDS] += thickness * mean_temperature * strains[:N_FIELDS]
            total = total + across
        return values

    def _jumps(self, interface: Interface) -> Array:
        """Return the compliance (fields, fields) of an interface, scaled."""
        return np.diag(interface.compliance(self.fields) / self.factors**2)

    def normal_compliance(self, number: int) -> Array:
        """Return the derivative along the normal per uniform load in a medium.

        Parameters
        ----------
        number : int
            Number of the medium, from 0 at the surface.

        Returns
        -------
        Array
            (fields, fields), scaled.
        """
        return self._from_medium(self.media[number].normal_compliance, number)

    def _from_medium(self, compliance: Array, number: int) -> Array:
        """Return a compliance (fields, fields) of the scaled fields of a medium in those of the results."""
        ratio = self.media[number].factors / self.factors
        return compliance * np.outer(ratio, ratio)


def _cross_interface(
    interface: Interface, fields: FieldSet, factors: Array, k: Array, u: Complex, v: Complex
) -> tuple[Complex, Complex]:
    """Return the subspace above an interface from that below it, in scaled fields."""
    jump = interface.compliance(fields) / factors**2
    if jump.any():
        u = u + (k[..., None] * jump)[..., None] * v
    if interface.electrode is None:
        return u, v
    y = _divide(u, v)
    return _without(y, ELECTRIC), np.broadcast_to(np.eye(y.shape[-1], dtype=complex), y.shape)


def _without(compliance: Number, field: int) -> Number:
    """Return compliances (..., f, f) for a flux of this field that makes its potential zero."""
    column, row = compliance[..., :, field, None], compliance[..., None, field, :]
    result = compliance - column * row / compliance[..., field, None, field, None]
    result[..., field, :] = result[..., :, field] = 0.0
    return result


def _divide(left: Complex, right: Complex) -> Complex:
    """Return left right^-1."""
    transposed = np.linalg.solve(right.swapaxes(-1, -2), left.swapaxes(-1, -2))
    return np.asarray(transposed.swapaxes(-1, -2), complex)
