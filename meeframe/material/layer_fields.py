"""Fields of waves inside layers: the solution that the recursion of a surface symbol defines, followed downwards.

In a layer, the solutions that decay downwards have an amplitude c at its upper side, those that decay upwards an
amplitude B c at its lower side. Both are bounded, so that the descent is as stable as the recursion.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from meeframe.fields import ELECTRIC, Array
from meeframe.material.layers import locate_depth
from meeframe.material.medium import Complex, Medium, exponential, reflection
from meeframe.material.surface_symbol import SurfaceSymbol


class Amplitudes(NamedTuple):
    """Amplitudes of waves in a medium, (w, fields), in its scaled fields.

    Attributes
    ----------
    downwards
        Values of t / k of the solutions that decay downwards, at its upper side.
    upwards
        Those of the solutions that decay upwards, at its lower side; zero in a half space.
    """

    downwards: Complex
    upwards: Complex


def wave_amplitudes(symbol: SurfaceSymbol, k: Array, traction: Complex) -> list[Amplitudes]:
    """Return the amplitudes of waves in all media of a symbol, from the top.

    Parameters
    ----------
    symbol : SurfaceSymbol
        Symbol for the directions of the waves, (w,).
    k : Array
        Wave numbers > 0, (w,) [1/m].
    traction : ndarray of complex
        Surface tractions and fluxes of the waves, (w, fields), scaled by `symbol.factors`.

    Returns
    -------
    list of Amplitudes
        Amplitudes in each medium.
    """
    state, pairs = (traction / k[:, None])[..., None], k[None, :]
    below, amplitudes_of_media = list(symbol.ascend(pairs))[::-1], []
    for number, medium in enumerate(symbol.media):
        if number == len(symbol.thicknesses):
            amplitudes_of_media.append(Amplitudes(state[..., 0], np.zeros_like(traction)))
            break
        thickness = symbol.thicknesses[number]
        g, at_bottom = (one[0] for one in reflection(medium, pairs * thickness, *below[number]))
        amplitude = np.asarray(np.linalg.solve(np.eye(g.shape[-1]) + g, state), complex)
        upwards: Complex = at_bottom @ amplitude
        amplitudes_of_media.append(Amplitudes(amplitude[..., 0], upwards[..., 0]))
        if number + 1 < len(symbol.media):
            down = exponential(-(k * thickness)[:, None, None] * medium.descent) @ amplitude
            state = _cross_downwards(symbol, number, pairs, down + upwards)
    return amplitudes_of_media


def wave_fields(
    medium: Medium, k: Array, amplitudes: Amplitudes, depth: float, height: float
) -> tuple[Complex, Complex]:
    """Return fields and their derivatives along the outward normal at a plane in a medium.

    Parameters
    ----------
    medium : Medium
        The medium, for the directions of the waves, (w,).
    k : Array
        Wave numbers > 0, (w,) [1/m].
    amplitudes : Amplitudes
        Amplitudes in the medium.
    depth, height : float
        Distances of the plane from its upper and its lower side [m], the latter inf in a half space.

    Returns
    -------
    tuple of ndarray of complex
        Fields and derivatives [1/m], (w, fields), scaled by `medium.factors`.
    """
    down = exponential(-(k * depth)[:, None, None] * medium.descent) @ amplitudes.downwards[..., None]
    up = np.zeros_like(down)
    if np.isfinite(height):
        up = (
            medium.conjugate(exponential(-(k * height)[:, None, None] * medium.descent)) @ amplitudes.upwards[..., None]
        )
    values = medium.plus @ down + medium.minus @ up
    size = values.shape[-2]
    slopes = medium.state[:, :size, :size] @ values + medium.state[:, :size, size:] @ (down + up)
    return values[..., 0], slopes[..., 0] * k[:, None]


def uniform_in_layers(
    symbol: SurfaceSymbol, compliances: Mapping[int, Array], traction: Array, depth: float
) -> tuple[Array, Array]:
    """Return fields and their derivative along the outward normal at a depth below a surface with a uniform load.

    Stress and fluxes are uniform in each layer, and so are the derivatives. The values count from those at the surface.

    Parameters
    ----------
    symbol : SurfaceSymbol
        Symbol of the layers.
    compliances : dict of int to Array
        See `SurfaceSymbol.uniform_compliances`.
    traction : Array
        Traction and fluxes on the surface, (fields,), scaled.
    depth : float
        Depth [m]; on an interface the fields are those above it.

    Returns
    -------
    tuple of ndarray
        Fields and derivatives [1/m], (fields,), scaled by `symbol.factors`.
    """
    last, below_top, _ = locate_depth(symbol.bottoms, depth)
    if last == len(symbol.media):  # in the rigid base
        return np.zeros_like(traction), np.zeros_like(traction)
    load = traction.copy()
    values = compliances[0] @ load
    for number in range(last):
        values = values - symbol.thicknesses[number] * (symbol.normal_compliance(number) @ load)
        interface = symbol.interfaces[number]
        values = values - interface.compliance(symbol.fields) / symbol.factors**2 * load
        if interface.electrode == "grounded":
            load[ELECTRIC] = 0.0
            row = compliances[number + 1][ELECTRIC]
            load[ELECTRIC] = -row @ load / row[ELECTRIC]
    slopes = symbol.normal_compliance(last) @ load
    return values - below_top * slopes, slopes


def _cross_downwards(symbol: SurfaceSymbol, number: int, k: Array, state: Complex) -> Complex:
    """Return t / k (w, fields, 1) below an interface from that above it, each in the scaled fields of its medium."""
    medium, lower = symbol.media[number], symbol.media[number + 1]
    result = state * (lower.factors / medium.factors)[:, None]
    if symbol.interfaces[number].electrode is None:
        return result
    # the charge of the electrode makes its potential zero below, too
    compliance = symbol.compliance_at(k, number + 1)
    row = compliance[:, ELECTRIC]
    result[:, ELECTRIC] = 0.0
    result[:, ELECTRIC] = -np.einsum("wf,wfo->wo", row, result) / row[:, ELECTRIC, None]
    return result
