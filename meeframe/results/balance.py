"""Balance of a body: its reactions against the loads of its contact and of its boundary data."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.common.memoize import memoize_by_identity
from meeframe.elements import ELEMENTS
from meeframe.elements.base import shape_functions
from meeframe.fields import MECHANICAL, MEE, N_MECHANICAL, POTENTIALS, Array, FieldSet
from meeframe.mesh.measures import corners, gauss_rule, normal_vectors, vector_areas
from meeframe.results.records import ZoneFields
from meeframe.system.reduced import NodalFields

_BY_TYPE: Final = {element.meshio_type: element for element in ELEMENTS.values()}
_ORDER: Final = 3
"""Number of Gauss points per direction, exact for quadratic fields on plane elements."""
_MAX_OPENING: Final = 1e-6
"""Largest integral of the normal over a closed surface, as a fraction of its area."""
_ROUNDING: Final = 1e-10
"""Fraction of the largest work of a field below which a field is zero but for rounding."""
WARNING_THRESHOLD: Final = 0.02
"""Relative unbalance above which a warning is given."""


@dataclass(frozen=True, eq=False)
class Unbalance:
    """Integrals over the whole boundary that vanish in equilibrium.

    force: (3,) [N], global axes; fluxes: (scalars,) totals of the scalar fields, SI units; relative: (1 + scalars,) of
    force and fluxes, over half the integral of the modulus, which passes through the body from one part of its boundary
    to the others; 0 where that is no more than rounding leaves. A field whose flux does not pass through the contact
    has little flux, which flows between grounds only: there the larger flux serves whose work on the largest potential
    is the work of the loads.
    """

    force: Array
    fluxes: Array
    relative: Array


def unbalance(boundary: NodalFields | ZoneFields | None, contact_fluxes: Array | None = None) -> Unbalance | None:
    """Return the unbalance of the fields on a boundary; None where it is not defined.

    It is None without fields, for elements of plugins, and for boundaries that are not closed, as those of half spaces,
    which bear the rest at infinity.

    Parameters
    ----------
    boundary : NodalFields, ZoneFields or None
        Fields on the boundary.
    contact_fluxes : Array, optional
        Fluxes (n, scalars) at the nodes of the contact; without them all fluxes count as passing through.

    Returns
    -------
    Unbalance or None
        The unbalance.
    """
    if boundary is None or isinstance(boundary, ZoneFields) or any(name not in _BY_TYPE for name, _ in boundary.cells):
        return None
    if not _closed(boundary):
        return None
    n_fields = boundary.fluxes.shape[1]
    total, through = np.zeros(n_fields), np.zeros(1 + n_fields - N_MECHANICAL)
    for name, nodes in boundary.cells:
        element = _BY_TYPE[name]
        xi, weights = gauss_rule(element.reference, _ORDER)
        normals = normal_vectors(boundary.points, element, nodes, xi)
        shares = np.linalg.norm(normals, axis=2) * weights
        fluxes = np.einsum("mk,ekj->emj", shape_functions(element, xi), boundary.fluxes[nodes])
        total += np.einsum("em,emj->j", shares, fluxes)
        tractions = np.linalg.norm(fluxes[:, :, MECHANICAL], axis=2)
        moduli = tractions, *np.abs(fluxes[:, :, POTENTIALS]).transpose(2, 0, 1)
        through += [float((shares * modulus).sum()) / 2 for modulus in moduli]
    sizes = np.array([np.linalg.norm(total[MECHANICAL]), *np.abs(total[POTENTIALS])])
    displacement = np.linalg.norm(boundary.values[:, MECHANICAL], axis=1)
    works = through * [displacement.max(), *np.abs(boundary.values[:, POTENTIALS]).max(axis=0)]
    significant = works > _ROUNDING * works.max()
    insulated = np.zeros(len(sizes), bool)
    if contact_fluxes is not None:
        insulated[1:] = ~contact_fluxes.any(axis=0)
    excess = np.divide(works.max(), works, out=np.ones_like(works), where=significant)
    scales = np.where(insulated, excess, 1.0) * through
    relative = np.divide(sizes, scales, out=np.zeros_like(sizes), where=significant)
    return Unbalance(total[MECHANICAL], total[POTENTIALS], relative)


@memoize_by_identity
def _closed(boundary: NodalFields) -> bool:
    """Return whether the integral of the normal vanishes, by the straight sides of the elements."""
    outlines = [np.zeros((0, 3)), *(vector_areas(boundary.points[outline]) for outline in corners(boundary.cells))]
    area = np.concatenate(outlines)
    return bool(np.linalg.norm(area.sum(axis=0)) <= _MAX_OPENING * np.linalg.norm(area, axis=1).sum())


def balanced_names(fields: FieldSet) -> tuple[str, ...]:
    """Return the names of the quantities that `unbalance` measures, in words."""
    return ("force", *(scalar.resultant.replace("_", " ") for scalar in fields.scalars))


def unbalance_warning(
    boundary: NodalFields | ZoneFields | None, fields: FieldSet = MEE, contact_fluxes: Array | None = None
) -> Iterator[str]:
    """Yield a warning if the fields on the boundary are noticeably out of equilibrium; arguments as for `unbalance`."""
    result = unbalance(boundary, contact_fluxes)
    if result is None or result.relative.max() <= WARNING_THRESHOLD:
        return
    shares = zip(balanced_names(fields), result.relative, strict=True)
    texts = ", ".join(f"{share:.0%} of the {name}" for name, share in shares if share > WARNING_THRESHOLD)
    yield (
        f"tractions and fluxes on the boundary violate equilibrium by {texts}: those at supports and grounds have "
        "errors of this size, which more elements there reduce; those of the contact are not affected"
    )
