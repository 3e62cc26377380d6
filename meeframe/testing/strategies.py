"""Hypothesis strategies for random admissible materials, directions and points."""

import numpy as np
from hypothesis import strategies as st

from meeframe.fields import Array
from meeframe.material import Material


@st.composite
def materials(draw: st.DrawFn, spread: float = 1.0, coupling: float = 0.5) -> Material:
    """Draw fully anisotropic, fully coupled admissible materials with constants of order one.

    Parameters
    ----------
    spread
        Eigenvalues of c, eps and mu lie between exp(-spread) and exp(spread).
    coupling
        Standard deviation of the entries of e and q.
    """
    exponents = st.lists(st.floats(-spread, spread), min_size=12, max_size=12)
    eigenvalues = np.exp(np.array(draw(exponents)))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    permittivity = _symmetric(random, eigenvalues[6:9])
    permeability = _symmetric(random, eigenvalues[9:])
    return Material.from_voigt(
        "random",
        _symmetric(random, eigenvalues[:6]),
        coupling * random.normal(size=(3, 6)),
        coupling * random.normal(size=(3, 6)),
        permittivity,
        _magnetoelectric(random, permittivity, permeability, draw(st.floats(0.0, 0.9))),
        permeability,
    )


def extended_stiffness(spread: float = 1.0, coupling: float = 0.5) -> st.SearchStrategy[Array]:
    """Draw scaled extended stiffnesses C'_iJKm (3, 5, 5, 3) of random admissible materials; see `materials`."""
    return materials(spread, coupling).map(scaled_stiffness)


def unit_vectors(count: int) -> st.SearchStrategy[Array]:
    """Draw unit vectors (count, 3): the first on an axis or a diagonal of the cube, the others anywhere."""
    special = np.array([[1, 0, 0], [0, 1, 0], [0, 0, -1], [1, 1, 0], [0, -1, 1], [1, 1, 1], [-1, 1, -1]], dtype=float)

    def make(seed: int, index: int) -> Array:
        vectors = np.random.default_rng(seed).normal(size=(count, 3))
        vectors[0] = special[index]
        unit: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        return unit

    return st.builds(make, st.integers(0, 2**32 - 1), st.integers(0, len(special) - 1))


def scaled_stiffness(material: Material) -> Array:
    """Return the scaled stiffness C'_iJKm (3, 5, 5, 3) of a material; see FieldScaling."""
    return material.scaling.scale_stiffness(material.stiffness)


def _symmetric(random: np.random.Generator, eigenvalues: Array) -> Array:
    """Return a symmetric matrix with given eigenvalues and random eigenvectors."""
    vectors = np.linalg.qr(random.normal(size=(len(eigenvalues), len(eigenvalues))))[0]
    matrix: Array = (vectors * eigenvalues) @ vectors.T
    return 0.5 * (matrix + matrix.T)


def _magnetoelectric(random: np.random.Generator, eps: Array, mu: Array, fraction: float) -> Array:
    """Return a symmetric lambda at a fraction of the limit at which [[eps, lambda], [lambda, mu]] becomes singular."""
    matrix = random.normal(size=(3, 3))
    matrix = matrix + matrix.T
    half_eps, half_mu = np.linalg.cholesky(eps), np.linalg.cholesky(mu)
    reduced = np.linalg.solve(half_eps, np.linalg.solve(half_mu, matrix.T).T)
    result: Array = fraction / np.linalg.norm(reduced, 2) * matrix
    return result
