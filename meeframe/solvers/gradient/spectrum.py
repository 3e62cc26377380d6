"""Largest eigenvalue of the compliance where there is contact, which bounds gradient steps."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.contact.scales import Scales
from meeframe.fields import POTENTIALS, Array
from meeframe.solvers.conduction.elimination import Conductors, Elimination

TOLERANCE: Final = 5e-3
MAX_ITERATIONS: Final = 60
MAX_GROWTH: Final = 0.1
MIN_REMAINING: Final = 0.9


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Largest eigenvalue of the compliance on the exposed nodes.

    Attributes
    ----------
    largest : float
        Eigenvalue in the law's metric with the potentials eliminated [m/Pa].
    exposure : Array
        (n, 1 + channels) in [0, 1] at which it was computed: mechanical (in contact or about to be) and of each channel
        (share of the flux that a perfect conductor would draw).
    vector : Array
        (n, 3), its eigenvector, where the next computation starts.
    """

    largest: float
    exposure: Array
    vector: Array

    def is_valid(self, exposure: Array) -> bool:
        """Return whether the eigenvalue applies to another exposure.

        It grows with the exposure, and a slight overestimate costs little.
        """
        grown = (exposure > self.exposure + MAX_GROWTH).any()
        shrunk = (exposure.sum(axis=0) < MIN_REMAINING * self.exposure.sum(axis=0)).any()
        return not (grown or shrunk)


def contact_exposure(touching: NDArray[np.bool_], resistance: Array, scales: Scales) -> Array:
    """Return the exposure (n, 1 + channels) of nodes touching (n,) with resistances (n, channels)."""
    compliance = np.diag(scales.compliance)[POTENTIALS]
    return np.column_stack([touching, compliance / (compliance + resistance)])


def largest_eigenvalue(
    elimination: Elimination, conductors: Conductors, exposure: Array, scaling: Array, start: Array | None
) -> Spectrum:
    """Return the largest eigenvalue by power iteration on the exposed nodes, of which there must be at least one.

    scaling: (2, 2) the law's tangential scaling; start: (n, 3) or None.
    """
    weight = exposure[:, :1] > 0.0
    values, axes = np.linalg.eigh(scaling)
    root = np.eye(3)
    root[:2, :2] = (axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T
    # without any symmetry, so that no eigenvector is missed; nearly uniform, as the one of the largest eigenvalue
    seed = np.array([0.8, 0.6, 1.0]) if start is None else start + 0.01 * np.abs(start).max()
    vector = weight * np.broadcast_to(seed, (len(exposure), 3)) @ root
    guess = np.zeros_like(exposure[:, 1:])
    largest, norm = 0.0, float(np.linalg.norm(vector))
    for _ in range(MAX_ITERATIONS):
        vector = vector / norm
        response = elimination.respond(vector @ root, conductors, guess, TOLERANCE)
        guess = conductors.without_floating(response.flux, response.potential)
        vector = weight * (response.displacement @ root)
        previous, norm = largest, float(np.linalg.norm(vector))
        largest = norm
        if abs(largest - previous) <= TOLERANCE * largest:
            break
    return Spectrum(largest, exposure, vector)
