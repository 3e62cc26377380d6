"""Fields of waves inside layers: the solution that the recursion of a surface symbol defines, followed downwards.

In a layer, the solutions that decay downwards have an amplitude c at its upper side, those that decay upwards an
amplitude B c at its lower side. Both are bounded, so that the descent is as stable as the recursion.
"""

from collections.abc import Mapping

import numpy as np

from meeframe.fields import ELECTRIC, Array
from meeframe.material.layers import layer_numbers
from meeframe.material.surface_symbol import Complex, SurfaceSymbol, exponential, reflection


def waves_in_layers(symbol: SurfaceSymbol, k: Array, traction: Complex, depth: float) -> tuple[Complex, Complex]:
    """Return fields and their derivatives along the outward normal at a depth below the surface.

    Parameters
    ----------
    symbol
        Symbol for the directions of the waves, (w,).
    k
        Wave numbers > 0, (w,) [1/m].
    traction
        Surface tractions and fluxes of the waves, (w, fields), scaled.
    depth
        Depth [m]; on an interface the fields are those above it.

    Returns
    -------
    tuple of ndarray of complex
        Fields and derivatives [1/m], (w, fields), scaled by `symbol.factors`.
    """
    last = int(layer_numbers(symbol.bottoms, depth))
    if last == len(symbol.media):  # in the rigid base
        return np.zeros_like(traction), np.zeros_like(traction)
    thicknesses, top = (*symbol.thicknesses, np.inf), 0.0
    state, pairs = (traction / k[:, None])[..., None], k[None, :]
    below = list(symbol.ascend(pairs))[::-1]
    for number, medium in enumerate(symbol.media[: last + 1]):
        thickness = thicknesses[number]
        local = min(depth - top, thickness)
        down = exponential(-(k * local)[:, None, None] * medium.descent)
        if np.isfinite(thickness):
            g, at_bottom = (one[0] for one in reflection(medium, pairs * thickness, *below[number]))
            amplitude = np.linalg.solve(np.eye(g.shape[-1]) + g, state)
            up = exponential(-(k * (thickness - local))[:, None, None] * medium.descent).conj() @ at_bottom @ amplitude
        else:
            amplitude, up = state, np.zeros_like(state)
        down = down @ amplitude
        if number < last:
            state = _cross_downwards(symbol, number, pairs, down + up)
            top = symbol.bottoms[number]
    values = medium.plus @ down + medium.minus @ up
    size = values.shape[-2]
    slopes = medium.state[:, :size, :size] @ values + medium.state[:, :size, size:] @ (down + up)
    factors = medium.factors / symbol.factors
    return values[..., 0] * factors, slopes[..., 0] * (k[:, None] * factors)


def uniform_in_layers(
    symbol: SurfaceSymbol, compliances: Mapping[int, Array], traction: Array, depth: float
) -> tuple[Array, Array]:
    """Return fields and their derivative along the outward normal at a depth below a surface with a uniform load.

    Stress and fluxes are uniform in each layer, and so are the derivatives. The values count from those at the surface.

    Parameters
    ----------
    symbol
        Symbol of the layers.
    compliances
        See `SurfaceSymbol.uniform_compliances`.
    traction
        Traction and fluxes on the surface, (fields,), scaled.
    depth
        Depth [m]; on an interface the fields are those above it.

    Returns
    -------
    tuple of ndarray
        Fields and derivatives [1/m], (fields,), scaled by `symbol.factors`.
    """
    last = int(layer_numbers(symbol.bottoms, depth))
    if last == len(symbol.media):  # in the rigid base
        return np.zeros_like(traction), np.zeros_like(traction)
    tops, load = np.concatenate([[0.0], symbol.bottoms]), traction.copy()
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
    return values - (depth - tops[last]) * slopes, slopes


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
