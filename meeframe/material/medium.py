"""Waves in a homogeneous material: compliances of its solutions that decay, and transfer through a layer of it."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import MECHANICAL, N_FIELDS, Array, FieldScaling, Indices
from meeframe.material.half_space import surface_compliance
from meeframe.material.thermal import rotate_moduli
from meeframe.material.thermal_half_space import thermal_response

Complex = NDArray[np.complex128]

_MAX_NORM: Final = 0.5  # of the argument of the series of an exponential, which is then squared
_TERMS: Final = 14  # of that series; the next one is 0.5^15 / 15!
_MAX_TERMS: Final = 200
_NORMAL: Final = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Medium:
    """A homogeneous material and waves in some directions, in scaled fields of its own.

    Attributes
    ----------
    factors : Array
        Factors (fields,) of its scaled fields.
    plus, minus : ndarray of complex
        Compliances Y of the solutions that decay downwards and upwards, (directions, fields, fields).
    descent : ndarray of complex
        Derivative of t / k with respect to k z in the first of them, (directions, fields, fields); that in the second
        is the negative of its `conjugate`.
    state : ndarray of complex
        Matrix of the derivatives of (u, t / k) with respect to k z, (directions, 2 fields, 2 fields).
    normal_compliance : Array
        Inverse of T = C_3JK3, (fields, fields): the response of a thin layer.
    signs : Array
        Signs P (fields,) of the fields in conjugate solutions: -1 for a temperature that acts on other fields.
    """

    factors: Array
    plus: Complex
    minus: Complex
    descent: Complex
    state: Complex
    normal_compliance: Array
    signs: Array

    @classmethod
    def of(
        cls,
        stiffness: Array,
        frame: Array,
        angles: Array,
        plus: Complex | None = None,
        expansion: "Expansion | None" = None,
    ) -> "Medium":
        """Return the medium of a stiffness.

        Parameters
        ----------
        stiffness : Array
            Extended stiffness (3, fields, fields, 3) [SI].
        frame : Array
            Rows e1, e2 and the outward normal, (3, 3).
        angles : Array
            Directions m = cos(angle) e1 + sin(angle) e2, (directions,).
        plus : Array, optional
            Scaled compliance of a half space of the material, if it is known.
        expansion : Expansion, optional
            Action of the temperature on the other fields.

        Returns
        -------
        Medium
            The medium.
        """
        local = _in_frame(stiffness, frame)
        scaling = FieldScaling.of(stiffness)  # the same in all frames
        scaled, f = scaling.scale_stiffness(local), len(scaling.factors)
        m = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
        q = np.einsum("pi,iJKm,pm->pJK", m, scaled, m)
        r = np.einsum("pi,iJK->pJK", m, scaled[:, :, :, 2])
        t_inverse = np.asarray(np.linalg.inv(scaled[2, :, :, 2]), float)
        flux = r @ t_inverse
        upper = np.concatenate([-1j * flux.swapaxes(1, 2), np.broadcast_to(t_inverse, q.shape)], axis=2)
        lower = np.concatenate([q - flux @ r.swapaxes(1, 2), -1j * flux], axis=2)
        if plus is None:
            plus = surface_compliance(local, _NORMAL, m) / np.outer(scaling.factors, scaling.factors)
        signs = np.ones(f)
        if expansion is not None:
            source, moduli = expansion.source, rotate_moduli(expansion.moduli, frame)
            signs[source] = -1.0
            scaled_moduli = np.zeros((3, f))
            scaled_moduli[:, :N_FIELDS] = moduli * scaling.factors[:N_FIELDS] * scaling.factors[source]
            along, normal = m @ scaled_moduli, scaled_moduli[2]
            upper[:, :, source] += t_inverse @ normal
            lower[:, :, source] += 1j * (along - flux @ normal)
            plus = plus.copy()
            heat, _ = thermal_response(local[:, :N_FIELDS, :N_FIELDS], moduli, -local[:, source, source], _NORMAL, m)
            plus[:, :N_FIELDS, source] = heat / (scaling.factors[:N_FIELDS] * scaling.factors[source])
        descent = lower[:, :, :f] @ plus + lower[:, :, f:]
        state = np.concatenate([upper, lower], axis=1)
        return cls(scaling.factors, plus, -_conjugate(plus, signs), descent, state, t_inverse, signs)

    @property
    def slowest_decay(self) -> float:
        """Smallest exponent of waves per k z."""
        return float(np.linalg.eigvals(self.descent).real.min())

    def conjugate(self, matrices: Complex) -> Complex:
        """Return the matrices of the solutions that decay upwards from those downwards.

        Parameters
        ----------
        matrices : Array
            (..., fields, fields).

        Returns
        -------
        Array
            (..., fields, fields).
        """
        return _conjugate(matrices, self.signs)


@dataclass(frozen=True, eq=False)
class Expansion:
    """Action of the temperature on other fields.

    Attributes
    ----------
    moduli
        Thermal moduli (3, N_FIELDS) [SI].
    source
        Column of the temperature.
    """

    moduli: Array
    source: int


def _in_frame(stiffness: Array, frame: Array) -> Array:
    """Return the stiffness in the axes of a frame (3, 3)."""
    axes = np.eye(stiffness.shape[1])
    axes[MECHANICAL, MECHANICAL] = frame
    fields = axes @ np.moveaxis(stiffness, 3, 1) @ axes.T
    local: Array = np.einsum("ai,dm,imBC->aBCd", frame, frame, fields)
    return local


def reflection(medium: Medium, depth: Array, u: Complex, v: Complex) -> tuple[Complex, Complex]:
    """Return the solutions that decay upwards per those that decay downwards from the upper side of a layer.

    At its upper side, G: the subspace there is Y_+ + Y_- G, I + G; and at its lower side. u, v: the subspace at the
    lower side; depth: k times thickness.
    """
    if depth.shape[1] == 1:
        down = exponentials(-medium.descent, depth[:, 0])
    else:
        down = exponential(-depth[..., None, None] * medium.descent)
    jump = (medium.plus - medium.minus) @ down
    at_bottom: Complex = v @ np.linalg.solve(u - medium.minus @ v, jump) - down
    return medium.conjugate(down) @ at_bottom, at_bottom


def _conjugate(matrices: Complex, signs: Array) -> Complex:
    """Return P conj(matrices) P."""
    return np.asarray(matrices.conj() * (signs[:, None] * signs), complex)


def sum_series(medium: Medium, depth: Array, u: Complex, v: Complex) -> tuple[Complex, Complex]:
    """Return the subspace at the upper side of a thin layer by the series of the exponential."""
    f = u.shape[-1]
    term = total = np.concatenate([u, v], axis=-2)
    for number in range(1, _MAX_TERMS):
        term = (depth / number)[..., None, None] * (medium.state @ term)
        total = total + term
        if np.abs(term).max() <= np.finfo(float).eps * np.abs(total).max() / 16.0:
            break
    return total[..., :f, :], total[..., f:, :]


def exponential(matrices: Complex) -> Complex:
    """Return the exponentials of small matrices (..., f, f), by a series of a fraction of each and squaring.

    Higham, SIAM J. Matrix Anal. Appl. 26 (2005) 1179, with the series in place of the Pade approximant: for many small
    matrices products take less time than solutions.
    """
    squarings = np.maximum(_powers_of_norms(matrices), 0)
    result = _series_of_exponential(matrices * (0.5**squarings)[..., None, None])
    for number in range(int(squarings.max(initial=0))):
        chosen = squarings > number
        result[chosen] = result[chosen] @ result[chosen]
    return result


def exponentials(matrices: Complex, factors: Array) -> Complex:
    """Return the exponentials (n, m, f, f) of matrices (m, f, f) times factors (n,) > 0, as `exponential`.

    Factors whose ratio is a power of two, as those of waves on panels each twice as long as the last, share squares.
    """
    mantissas, powers = np.frexp(factors)
    squarings = np.maximum(powers + _powers_of_norms(matrices).max(), 0)
    fractions, sources = np.unique(np.ldexp(mantissas, powers - squarings), return_inverse=True)
    squares = _series_of_exponential(fractions[:, None, None, None] * matrices)
    last = np.zeros(len(fractions), int)
    np.maximum.at(last, sources, squarings)
    result = np.empty((len(factors), *matrices.shape), complex)
    for number in range(int(last.max()) + 1):
        chosen, further = squarings == number, last > number
        result[chosen] = squares[sources[chosen]]
        squares[further] = squares[further] @ squares[further]
    return result


def _powers_of_norms(matrices: Complex) -> Indices:
    """Return the least n with which matrices (..., f, f) over 2^n suit the series."""
    norms = np.abs(matrices).sum(axis=-1).max(axis=-1, initial=0.0)
    return np.asarray(np.ceil(np.log2(np.maximum(norms, np.finfo(float).tiny) / _MAX_NORM)), int)


def _series_of_exponential(x: Complex) -> Complex:
    """Return the sum of x^n / n! up to _TERMS, by products with the third power."""
    coefficients = 1.0 / np.cumprod(np.array([1.0, *range(1, _TERMS + 1)]))
    one = np.eye(x.shape[-1])
    square = x @ x
    powers = (one, x, square)
    cube = square @ x
    total = np.zeros(x.shape, complex)
    for first in range(_TERMS // 3 * 3, -1, -3):
        block = sum(coefficients[first + n] * powers[n] for n in range(3) if first + n <= _TERMS)
        total[...] = total @ cube + block
    return total
