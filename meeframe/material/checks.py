"""Checks of material constants: finite, symmetric (eq. 8) and positive definite."""

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import Array
from meeframe.fields.units import MAX_MAGNITUDE, MIN_MAGNITUDE
from meeframe.material.voigt import mandel_matrix

_SYMMETRIES = {
    "c": (("c_ijkl = c_jikl", (1, 0, 2, 3)), ("c_ijkl = c_ijlk", (0, 1, 3, 2)), ("c_ijkl = c_klij", (2, 3, 0, 1))),
    "e": (("e_kij = e_kji", (0, 2, 1)),),
    "q": (("q_kij = q_kji", (0, 2, 1)),),
    "eps": (("eps_kl = eps_lk", (1, 0)),),
    "lambda": (("lambda_kl = lambda_lk", (1, 0)),),
    "mu": (("mu_kl = mu_lk", (1, 0)),),
}
_MIN_EIGENVALUE = 1e-12  # relative to the largest eigenvalue; smaller ones may be zero but for round-off
_MIN_COUPLING_MARGIN = 5e-7
"""Least part by which the coupling of potentials stays below its limit: responses lose as many digits."""
_SYMMETRY_TOLERANCE = 1e-8  # relative to the largest entry: far above round-off, far below the last digit of any table


def material_phrase(material: str) -> str:
    """Return a noun phrase for messages about a material, with its name if it has one."""
    return f"material {material!r}" if material else "the material"


def component_name(symbol: str, index: tuple[int, ...]) -> str:
    """Return the name of a component from 0-based indices, as in the paper: ('c', (0, 0, 1, 1)) is 'c_1122'."""
    return f"{symbol}_{''.join(str(i + 1) for i in index)}"


def validate_tensor(material: str, symbol: str, values: Array) -> Array:
    """Return a read-only tensor with the exact symmetries of eq. (8).

    Parameters
    ----------
    material : str
        Name of the material, for messages.
    symbol : {'c', 'e', 'q', 'eps', 'lambda', 'mu'}
        Symbol of the tensor.
    values : Array
        Components in SI units.

    Returns
    -------
    Array
        The mean of the tensor and its transposes that eq. (8) makes equal.

    Raises
    ------
    MaterialError
        If the shape is wrong, an entry is not finite, or a symmetry is violated beyond round-off; the message names the
        component.
    """
    tensor = np.array(values, dtype=float)
    dimensions = len(_SYMMETRIES[symbol][0][1])
    if tensor.shape != (3,) * dimensions:
        raise MaterialError(
            f"{material_phrase(material)}: {symbol} has shape {tensor.shape}, must have shape {(3,) * dimensions}"
        )
    allowed = np.abs(tensor) <= MAX_MAGNITUDE
    if not allowed.all():
        index = tuple(int(i) for i in np.argwhere(~allowed)[0])
        raise MaterialError(
            f"{material_phrase(material)}: {component_name(symbol, index)} is {tensor[index]}, must be a finite number "
            f"of at most {MAX_MAGNITUDE:g}"
        )
    for law, axes in _SYMMETRIES[symbol]:
        check_tensor_symmetry(material, symbol, tensor, law, axes)
    for _, axes in _SYMMETRIES[symbol]:
        tensor = (tensor + tensor.transpose(axes)) / 2.0
    tensor.setflags(write=False)
    return tensor


def validate_coefficient(material: str, name: str, values: Array) -> Array:
    """Return the coefficient of a decoupled scalar field, read-only and exactly symmetric.

    Parameters
    ----------
    material : str
        Name of the material, for messages.
    name : str
        Name of the coefficient.
    values : Array
        Components, (3, 3), in SI units.

    Raises
    ------
    MaterialError
        If the shape is wrong, an entry is not finite, or the tensor is not symmetric and positive definite, or too
        small for the arithmetic.
    """
    tensor: Array = np.array(values, dtype=float)
    if tensor.shape != (3, 3) or not (np.abs(tensor) <= MAX_MAGNITUDE).all():
        raise MaterialError(f"{material_phrase(material)}: {name} must be finite numbers of shape (3, 3)")
    check_tensor_symmetry(material, name, tensor, f"{name}_kl = {name}_lk", (1, 0))
    tensor = (tensor + tensor.T) / 2.0
    _check_size(material, name, tensor)
    if not _lowest_eigenvalue(tensor)[1]:
        raise MaterialError(f"{material_phrase(material)} is not admissible: {name} must be positive definite")
    tensor.setflags(write=False)
    return tensor


def check_tensor_symmetry(material: str, symbol: str, tensor: Array, law: str, axes: tuple[int, ...]) -> None:
    """Check that a tensor equals one of its transposes.

    Parameters
    ----------
    material, symbol, law : str
        Name of the material, symbol of the tensor, and the symmetry in symbols, for messages.
    tensor : Array
        Components.
    axes : tuple of int
        Order of the axes in the transpose.

    Raises
    ------
    MaterialError
        If a component differs beyond round-off; the message names it.
    """
    difference = np.abs(tensor - tensor.transpose(axes))
    # below the smallest normal number there is no relative accuracy left
    if difference.max() <= _SYMMETRY_TOLERANCE * np.abs(tensor).max() + np.finfo(float).tiny:
        return
    index = tuple(int(i) for i in np.unravel_index(difference.argmax(), tensor.shape))
    partner = tuple(index[axis] for axis in axes)
    raise MaterialError(
        f"{material_phrase(material)}: {symbol} must satisfy {law} (eq. 8), but {component_name(symbol, index)} = "
        f"{tensor[index]:g} and {component_name(symbol, partner)} = {tensor[partner]:g}"
    )


def check_elastic(material: str, elastic: Array) -> None:
    """Check that an elastic stiffness is positive definite.

    Parameters
    ----------
    material : str
        Name of the material, for messages.
    elastic : Array
        c_ijkl, (3, 3, 3, 3) [Pa].

    Raises
    ------
    MaterialError
        If it is not, with the smallest eigenvalue, or if it is too small for the arithmetic.
    """
    _check_size(material, "the elastic stiffness c", elastic)
    lowest, definite = _lowest_eigenvalue(mandel_matrix(elastic))
    if not definite:
        raise MaterialError(
            f"{material_phrase(material)} is not admissible: the elastic stiffness c must be positive definite, "
            f"but its smallest eigenvalue is {lowest:.6g} Pa"
        )


def check_electromagnetic(material: str, eps: Array, lambda_: Array, mu: Array) -> None:
    """Check that the block [[eps, lambda], [lambda, mu]] is positive definite.

    Parameters
    ----------
    material : str
        Name of the material, for messages.
    eps, lambda_, mu : Array
        Permittivity [F/m], magneto-electric coupling [s/m] and permeability [N s^2/C^2], (3, 3) each.

    Raises
    ------
    MaterialError
        If it is not; the message gives the smallest eigenvalue, scaled and in SI units, and the components that cause
        it. Also if it is so nearly singular that no contact can be solved accurately, or eps or mu is too small for the
        arithmetic.

    Notes
    -----
    The eigenvalues are computed with eps and mu scaled to order one, since they differ by ten decades in SI units.
    """
    for symbol, tensor, unit in (("eps", eps, "F/m"), ("mu", mu, "N s^2/C^2")):
        _check_size(material, symbol, tensor)
        lowest, definite = _lowest_eigenvalue(tensor)
        if not definite:
            raise MaterialError(
                f"{material_phrase(material)} is not admissible: {symbol} must be positive definite, "
                f"but its smallest eigenvalue is {lowest:.6g} {unit}"
            )
    block = np.block([[eps, lambda_], [lambda_, mu]])
    scale = np.repeat([np.abs(eps).max(), np.abs(mu).max()], 3) ** -0.5
    lowest, definite = _lowest_eigenvalue(scale[:, None] * scale[None, :] * block)
    if not definite:
        raise MaterialError(
            f"{material_phrase(material)} is not admissible: the block [[eps, lambda], [lambda, mu]] must be positive "
            f"definite, but its smallest eigenvalue is {lowest:.6g} with eps and mu scaled to order one "
            f"({np.linalg.eigvalsh(block)[0]:.6g} in SI units){_coupling_hint(eps, lambda_, mu)}"
        )

    by_eps = np.linalg.solve(np.linalg.cholesky(eps), lambda_)
    coupling = float(np.linalg.norm(np.linalg.solve(np.linalg.cholesky(mu), by_eps.T), 2))
    if coupling > 1.0 - _MIN_COUPLING_MARGIN:
        raise MaterialError(
            f"{material_phrase(material)} is nearly inadmissible: lambda is 1 - {1.0 - coupling:.2g} times the largest "
            f"coupling that eps and mu admit; allowed: at most 1 - {_MIN_COUPLING_MARGIN:g} times"
        )


def _check_size(material: str, name: str, tensor: Array) -> None:
    """Raise MaterialError if a tensor is so small, but not zero, that the arithmetic loses it."""
    size = float(np.abs(tensor).max())
    if 0.0 < size < MIN_MAGNITUDE:
        raise MaterialError(
            f"{material_phrase(material)}: the largest component of {name} is {size:g}, must be at least "
            f"{MIN_MAGNITUDE:g} in SI units"
        )


def _lowest_eigenvalue(matrix: Array) -> tuple[float, bool]:
    eigenvalues = np.linalg.eigvalsh(matrix)
    return float(eigenvalues[0]), bool(eigenvalues[0] > _MIN_EIGENVALUE * np.abs(eigenvalues).max())


def _coupling_hint(eps: Array, lambda_: Array, mu: Array) -> str:
    bounds = np.sqrt(np.outer(np.diag(eps), np.diag(mu)))
    excess = [(i, j) for i in range(3) for j in range(3) if abs(lambda_[i, j]) >= bounds[i, j]]
    if not excess:
        return "; the components of lambda are jointly too large"
    violations = (
        f"|{component_name('lambda', (i, j))}| = {abs(lambda_[i, j]):.4g} must be less than "
        f"sqrt({component_name('eps', (i, i))} {component_name('mu', (j, j))}) = {bounds[i, j]:.4g} s/m"
        for i, j in excess
    )
    return "; " + ", ".join(violations)
