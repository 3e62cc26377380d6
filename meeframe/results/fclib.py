"""Files of FCLIB, the collection of frictional contact problems: three-dimensional local problems and their solutions.

The problem of m contacts, each with one normal and two tangential components in this order: find u and r with
    u = W r + q,    r_N >= 0,  |r_T| <= mu r_N,
    (u_N + mu |u_T|, u_T) in the dual cone of r and normal to r (De Saxce's form of Signorini's and Coulomb's laws):
r_N > 0 only where u_N = 0, and where u_T is not zero r_T = -mu r_N u_T / |u_T|.

Layout, after fclib.h: nothing is an attribute, integers are int32, the others float64, single ones of shape (1,),
texts scalar, of fixed length and ended by a zero byte.
    /fclib_local/spacedim           3
    /fclib_local/W/                 nzmax, m, n, nz, p, i, x: a sparse matrix as CSparse has it. nz = -1: compressed
                                    columns, p (n + 1,) where they begin, i the row of each entry; nz = -2: compressed
                                    rows, p (m + 1,), i the column; nz >= 0: that many triplets, p the column, i the row
    /fclib_local/vectors/           q (3m,), mu (m,)
    /fclib_local/info/              title, description, math_info, each optional
    /solution/                      u (3m,), r (3m,)
fclib.h says that p is the row in triplets; the programs that read and write them (Siconos, the merit function of
FCLIB) take CSparse's order, and so does this module. It matters where W is unsymmetric only. Written are compressed
columns, of which there is one reading. Problems with equality constraints (V, R, s), global and plane problems are
refused.

Source: Acary, Bremond, Koziara, Perignon, FCLIB: a collection of discrete 3D frictional contact problems, INRIA report
RT-444 (2014); layout of the files from its header fclib.h.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from scipy import sparse

from meeframe.common.errors import CaseError, ResultError
from meeframe.common.hdf5 import open_hdf5
from meeframe.fields import Array, Indices
from meeframe.results.hdf5 import changed_file
from meeframe.results.output import replacing

PER_CONTACT: Final = 3
MAX_CONTACTS: Final = 5_000
"""Largest number of contacts of a problem.

Its matrix is held in full, 1.8 GB at this size; solvers need four times that in addition (Newton's method six times).
"""
_UNREADABLE: Final = (LookupError, ValueError, TypeError, ArithmeticError, OSError, RuntimeError)
"""Exceptions of h5py and numpy for files that are damaged or hold something else."""
_LOCAL: Final = "fclib_local"
_SOLUTION: Final = "solution"
_TEXTS: Final = ("title", "description", "math_info")
_COLUMNS: Final = -1
_ROWS: Final = -2


@dataclass(frozen=True, eq=False)
class LocalProblem:
    """Local problem u = W r + q under Coulomb's law at m contacts.

    Components are (normal, tangential, tangential), contact by contact. In problems from meeframe, u is the gap [m] and
    r the force [N] (meeframe.results.fclib_contact); files from elsewhere have velocities and impulses.

    Attributes
    ----------
    matrix : Array
        W, (3m, 3m), positive semidefinite with a positive diagonal.
    q : Array
        Values of u without reactions, (3m,).
    mu : Array
        Friction coefficients >= 0, (m,).
    title, description, math_info : str
        Texts of the file.

    Raises
    ------
    CaseError
        If shapes do not fit, a value is not finite, a coefficient is negative, the diagonal of W is not positive, or
        there are more than 5000 contacts.
    """

    matrix: Array
    q: Array
    mu: Array
    title: str = ""
    description: str = ""
    math_info: str = ""

    def __post_init__(self) -> None:
        size = PER_CONTACT * np.size(self.mu)
        shapes = np.shape(self.matrix), np.shape(self.q), np.shape(self.mu)
        if shapes != ((size, size), (size,), (size // PER_CONTACT,)) or size == 0:
            raise CaseError(
                f"FCLIB problem with W {shapes[0]}, q {shapes[1]}, mu {shapes[2]}; "
                "allowed: (3m, 3m), (3m,), (m,) with m >= 1"
            )
        check_size(len(self.mu))
        for name in ("matrix", "q", "mu"):
            if not np.isfinite(getattr(self, name)).all():
                raise CaseError(f"{name} of the FCLIB problem is not finite; allowed: finite numbers")
        if (self.mu < 0.0).any():
            contact = int(np.argmin(self.mu))
            raise CaseError(
                f"mu of the FCLIB problem is {self.mu[contact]} at contact {contact}; allowed: numbers >= 0"
            )
        diagonal = np.diag(self.matrix)
        if diagonal.min() <= 0.0:
            contact = int(diagonal.argmin()) // PER_CONTACT
            raise CaseError(
                f"W of the FCLIB problem has {diagonal.min()} on its diagonal at contact {contact}; "
                "allowed: numbers > 0, since a contact without compliance has no solution"
            )


@dataclass(frozen=True, eq=False)
class LocalSolution:
    """Solution of a LocalProblem.

    Attributes
    ----------
    u : Array
        Gaps or velocities, (3m,).
    r : Array
        Forces or impulses, (3m,).
    """

    u: Array
    r: Array


def check_size(contacts: int) -> None:
    """Check the number of contacts of a problem.

    Parameters
    ----------
    contacts : int
        The number.

    Raises
    ------
    CaseError
        If there are no contacts, or more than MAX_CONTACTS.
    """
    if not 1 <= contacts <= MAX_CONTACTS:
        raise CaseError(
            f"FCLIB problem with {contacts} contacts; allowed: 1 to {MAX_CONTACTS}, because its matrix is dense"
        )


def natural_residual(problem: LocalProblem, reaction: Array) -> float:
    """Return the relative residual of reactions, which depends on the reactions only.

    Parameters
    ----------
    problem : LocalProblem
        The problem.
    reaction : Array
        Reactions r, (3m,).

    Returns
    -------
    float
        |r - P(r - rho (u + mu |u_T| N))| / |r| with P the projection onto the friction cones, u = W r + q and rho the
        inverse of the mean of W's diagonal; relative to |rho q| if r is zero. It is zero for a solution.

    Notes
    -----
    FCLIB's merit function is the same with rho = 1, which suits SI units badly: forces exceed gaps by many
    decades there.
    """
    rho = 1.0 / float(np.diag(problem.matrix).mean())
    r = reaction.reshape(-1, PER_CONTACT)
    u = (problem.matrix @ reaction + problem.q).reshape(r.shape)
    u[:, 0] += problem.mu * np.linalg.norm(u[:, 1:], axis=1)
    distance = np.linalg.norm(r - project_on_cones(r - rho * u, problem.mu))
    size = np.linalg.norm(reaction) or rho * np.linalg.norm(problem.q) or 1.0
    return float(distance / size)


def project_on_cones(reaction: Array, mu: Array) -> Array:
    """Return the Euclidean projection onto the friction cones |r_T| <= mu r_N.

    Parameters
    ----------
    reaction : Array
        Reactions, (m, 3), the normal component first.
    mu : Array
        Friction coefficients, (m,).

    Returns
    -------
    Array
        Projections, (m, 3).
    """
    tangential = np.linalg.norm(reaction[:, 1:], axis=1)
    along = np.where(
        tangential <= mu * reaction[:, 0], reaction[:, 0], (mu * tangential + reaction[:, 0]) / (1 + mu**2)
    )
    along = np.where(mu * tangential <= -reaction[:, 0], 0.0, along)
    factor = np.divide(mu * along, tangential, out=np.ones_like(along), where=tangential > mu * along)
    projected: Array = np.column_stack([along, factor[:, None] * reaction[:, 1:]])
    return projected


def write_local(path: Path, problem: LocalProblem, solution: LocalSolution | None = None) -> None:
    """Write a problem, with its solution if there is one, as a new file, completely or not at all.

    Parameters
    ----------
    path : Path
        The file.
    problem : LocalProblem
        The problem.
    solution : LocalSolution, optional
        Its solution.

    Raises
    ------
    ResultError
        If it cannot be written.
    """
    with replacing(path) as temporary, changed_file(temporary, "w") as file:
        local = file.create_group(_LOCAL)
        _put_integer(local, "spacedim", PER_CONTACT)
        _put_matrix(local.create_group("W"), problem.matrix)
        vectors = local.create_group("vectors")
        vectors["q"], vectors["mu"] = np.asarray(problem.q, float), np.asarray(problem.mu, float)
        info = local.create_group("info")
        for name in _TEXTS:
            _put_text(info, name, getattr(problem, name))
        if solution is not None:
            _put_solution(file, solution)


def write_solution(path: Path, solution: LocalSolution) -> None:
    """Write a solution into the file of its problem, in place of an earlier one.

    Parameters
    ----------
    path : Path
        The file.
    solution : LocalSolution
        The solution.

    Raises
    ------
    ResultError
        If it cannot be written.
    """
    with replacing(path) as temporary:
        shutil.copy(path, temporary)
        with changed_file(temporary, "r+") as file:
            file.pop(_SOLUTION, None)
            _put_solution(file, solution)


def read_local(path: Path) -> LocalProblem:
    """Return the problem of a file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    LocalProblem
        The problem.

    Raises
    ------
    ResultError
        If it cannot be read.
    CaseError
        If it is no local problem in three dimensions without equality constraints, or its numbers are not allowed.
    """
    with _opened(path) as file:
        try:
            if _LOCAL not in file:
                result = "a global problem" if "fclib_global" in file else "no problem of FCLIB"
                raise CaseError(f"holds {result}; allowed: a local problem, in the group {_LOCAL}")
            return _local(file[_LOCAL])
        except CaseError as error:
            raise CaseError(f"{path}: {error}") from None
        except _UNREADABLE as error:
            raise CaseError(f"{path}: is not a complete FCLIB problem: {error}") from None


def read_solution(path: Path) -> LocalSolution | None:
    """Return the solution in a file.

    Parameters
    ----------
    path : Path
        The file of the problem.

    Returns
    -------
    LocalSolution or None
        The solution; None if there is none.

    Raises
    ------
    ResultError
        If it cannot be read, is not finite or not one of the file's problem.
    """
    with _opened(path) as file:
        try:
            if _SOLUTION not in file:
                return None
            size = _integer(file[_LOCAL]["W"], "m")
            u, r = (_numbers(file[_SOLUTION], name) for name in ("u", "r"))
            if not (len(u) == len(r) == size and np.isfinite(u).all() and np.isfinite(r).all()):
                raise ValueError(f"u ({len(u)},), r ({len(r)},); allowed: finite numbers ({size},)")
            return LocalSolution(u.astype(float), r.astype(float))
        except _UNREADABLE as error:
            raise ResultError(f"{path}: its solution cannot be read: {error}") from None


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        with open_hdf5(path) as file:
            yield file
    except OSError as error:
        raise ResultError(f"{path}: cannot be read as HDF5: {error}") from None
    except ValueError as error:
        raise ResultError(f"{path}: {error}") from None


def _local(local: Any) -> LocalProblem:
    dimension = _integer(local, "spacedim")
    if dimension != PER_CONTACT:
        raise CaseError(f"spacedim = {dimension}; allowed: {PER_CONTACT}")
    if "V" in local or "R" in local:
        raise CaseError("has equality constraints (V, R, s); allowed: problems without them")
    rows, columns = (_integer(local["W"], name) for name in ("m", "n"))
    if rows != columns:
        raise CaseError(f"W has {rows} rows and {columns} columns; allowed: as many")
    check_size(rows // PER_CONTACT)
    vectors, info = local["vectors"], local.get("info", {})
    q, mu = (_numbers(vectors, name).astype(float) for name in ("q", "mu"))
    return LocalProblem(_matrix(local["W"]), q, mu, *(_text(info, name) for name in _TEXTS))


def _matrix(group: Any) -> Array:
    """Return a matrix in full, from any of the three ways in which it may be stored; entries that repeat add up."""
    full = np.zeros((_integer(group, "m"), _integer(group, "n")))
    count = _integer(group, "nz")
    p, i, x = (_numbers(group, name) for name in ("p", "i", "x"))
    if count >= 0:
        rows, columns, x = i[:count], p[:count], x[:count]
    elif count == _COLUMNS:
        rows, columns, x = i[: p[-1]], _lines(p, full.shape[1], len(x)), x[: p[-1]]
    elif count == _ROWS:
        rows, columns, x = _lines(p, full.shape[0], len(x)), i[: p[-1]], x[: p[-1]]
    else:
        raise ValueError(f"nz = {count} of its matrix; allowed: -2, -1 and numbers >= 0")
    indices = np.column_stack([rows, columns])
    outside = ((indices < 0) | (indices >= full.shape)).any(axis=1)
    if outside.any():
        row, column = indices[outside][0]
        raise ValueError(f"an entry of its matrix is at row {row}, column {column} of {full.shape}, counted from 0")
    np.add.at(full, (rows, columns), x)
    return full


def _lines(pointers: Indices, count: int, entries: int) -> Indices:
    """Return the number of the column, or row, of each of the entries of a compressed matrix with `count` of them."""
    if len(pointers) != count + 1:
        raise ValueError(f"{len(pointers)} pointers for {count} columns or rows of its matrix; allowed: one more")
    if pointers.min() < 0 or pointers.max() > entries:
        raise ValueError(
            f"pointers of its matrix are from {pointers.min()} to {pointers.max()}; it has {entries} entries"
        )
    return np.repeat(np.arange(count), np.diff(pointers))


def _put_matrix(group: Any, matrix: Array) -> None:
    """Write a matrix by compressed columns, without its zeros."""
    stored = sparse.csc_array(matrix)
    full = {"nzmax": stored.nnz, "m": matrix.shape[0], "n": matrix.shape[1], "nz": _COLUMNS}
    for name, number in full.items():
        _put_integer(group, name, number)
    group["p"], group["i"] = stored.indptr.astype(np.int32), stored.indices.astype(np.int32)
    group["x"] = stored.data.astype(float)


def _put_solution(file: Any, solution: LocalSolution) -> None:
    group = file.create_group(_SOLUTION)
    group["u"], group["r"] = np.asarray(solution.u, float), np.asarray(solution.r, float)


def _put_integer(group: Any, name: str, number: int) -> None:
    group[name] = np.array([number], np.int32)


def _integer(group: Any, name: str) -> int:
    return int(_numbers(group, name)[0])


def _numbers(group: Any, name: str) -> Any:
    """Return a dataset of real numbers, flat."""
    result = np.ravel(group[name][()])
    if result.dtype.kind not in "fiu":
        raise ValueError(f"{name} is of type {result.dtype}; allowed: whole numbers and floats")
    return result


def _put_text(group: Any, name: str, text: str) -> None:
    """Write a text like H5LTmake_dataset_string: programs in C need the zero byte at the end."""
    content = text.encode() + b"\0"
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(len(content))
    dataset = h5py.h5d.create(group.id, name.encode(), kind, h5py.h5s.create(h5py.h5s.SCALAR))
    dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, np.array(content, f"S{len(content)}"))


def _text(group: Any, name: str) -> str:
    if name not in group:
        return ""
    content = np.ravel(group[name][()])[0]
    return content.rstrip(b"\0").decode(errors="replace") if isinstance(content, bytes) else str(content)
