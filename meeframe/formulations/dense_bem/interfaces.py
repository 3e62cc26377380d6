"""Coupling of the regions of a layered body: the multi-region boundary element method, condensed on interfaces.

Each region has equations of its own, H u = G t, on its closed surface. From the base upwards, the regions below an
interface are condensed to their response to fluxes on it, u = offset + matrix t, as a body is to its contact zone. For
the region above, whose fluxes on the interface are opposite, this and the compliance S of the interface make values
on the interface functions of its unknown fluxes,

    u = offset - (matrix + S) t.

A node on the border of an interface has one unknown flux of each field there in the region above, and one unknown value
in the region below, as many as it has equations. Where the sides prescribe the value, the fluxes on sides and
interface are unknown in the region above, and collocated inside the elements as at other edges (collocation.py).

The potential of a floating electrode is one more load on the regions below it, and one more unknown of the region
above; the additional equation is that its total charge is zero. The mean charge that the regions below bring to it is
one more row of their response.
"""

from dataclasses import dataclass

import numpy as np

from meeframe.fields import ELECTRIC, MECHANICAL, N_MECHANICAL, Array
from meeframe.formulations.dense_bem.assembly import System
from meeframe.formulations.dense_bem.layout import Layout, boundary_fields
from meeframe.formulations.dense_bem.regions import Region
from meeframe.formulations.dense_bem.system import BoundarySolution, zone_values
from meeframe.formulations.dense_bem.units import Units
from meeframe.system.reduced import NodalFields


@dataclass(frozen=True, eq=False)
class Foundation:
    """Response of the regions below an interface and of the interface itself, offset + matrix @ loads.

    Loads are the outward fluxes of the regions below at the m nodes, (f m,), and the potential of a floating electrode.
    The response is the values above the interface, (f m,), and with a floating electrode the mean over the interface
    of the outward flux of the electric field of the regions below.

    Attributes
    ----------
    offset : Array
        Response to the prescribed data, (f m,) or (f m + 1,).
    matrix : Array
        Response to unit loads, (f m, f m) or (f m + 1, f m + 1).
    """

    offset: Array
    matrix: Array

    @classmethod
    def of(cls, solution: BoundarySolution, region: Region) -> "Foundation":
        """Return that of a condensed region, and of the interface between it and the region above, in SI units."""
        layout = solution.layout
        rows, columns = _factors(solution.units, len(layout.zone), layout.joints.floats_above)
        response = zone_values(solution)
        response *= rows[:, None]
        response[:, :-1] *= columns
        assert region.interface is not None
        fields, normal = region.body.fields, region.normal
        tangential, _, along, *scalars = region.interface.compliance(fields)
        springs = np.diag([*[tangential] * N_MECHANICAL, *scalars])
        springs[MECHANICAL, MECHANICAL] += (along - tangential) * np.outer(normal, normal)
        entries = np.arange(fields.size * len(layout.zone)).reshape(-1, fields.size)
        response[entries[:, :, None], entries[:, None, :]] += springs
        return cls(response[:, -1], response[:, :-1])

    def scaled(self, units: Units, layout: Layout) -> "Foundation":
        """Return it in the units of the region above."""
        rows, columns = _factors(units, len(layout.lower_patches), layout.joints.floats_below)
        return Foundation(self.offset / rows, self.matrix / rows[:, None] / columns)


def couple(system: System, layout: Layout, foundation: Foundation | None, region: Region) -> None:
    """Enter the response below the lower interface of a region into its equations, and those of floating electrodes.

    Parameters
    ----------
    system : System
        Equations of the region, in which values on interfaces are left out.
    layout : Layout
        Numbers of its unknowns.
    foundation : Foundation or None
        Response below, in units of the region; None at the base.
    region : Region
        The region.
    """
    added = layout.n_unknowns - layout.n_added
    if foundation is not None:
        fluxes = layout.flux_column[layout.lower_patches].ravel()
        n = len(fluxes)
        values = system.joined[:, :n]
        system.matrix[:, fluxes] -= values @ foundation.matrix[:n, :n]
        system.rhs[:] -= values @ foundation.offset[:n]
        if layout.joints.floats_below:
            system.matrix[:, added] += values @ foundation.matrix[:n, n]
            system.matrix[added, fluxes] = -foundation.matrix[n, :n]
            system.matrix[added, fluxes[ELECTRIC :: layout.n_fields]] += region.shares(layout.joints.below)
            system.matrix[added, added] = foundation.matrix[n, n]
            system.rhs[added] = -foundation.offset[n]
            added += 1
    if layout.joints.floats_above:
        system.load_matrix[:, -1] -= system.joined[:, -len(layout.zone) :].sum(axis=1)
        system.matrix[added, layout.flux_column[layout.zone_patches, ELECTRIC]] = -region.shares(layout.joints.above)
        system.matrix[added, added] = 1.0


@dataclass(frozen=True, eq=False)
class LayeredSolution:
    """The eliminated systems of all regions of a body.

    Attributes
    ----------
    regions : tuple of BoundarySolution
        Regions from the contact zone down.
    foundations : tuple of Foundation
        Response below each region but the last one, in its units.
    """

    regions: tuple[BoundarySolution, ...]
    foundations: tuple[Foundation, ...] = ()

    def fields(self, load: Array) -> NodalFields:
        """Return the fields on the boundaries of all regions for a load (n, fields) in SI units and global axes.

        Points on interfaces belong to the regions above and below, with opposite fluxes.
        """
        regions = self.fields_of_regions(load)
        starts = np.cumsum([0, *(len(region.points) for region in regions)])
        cells = [
            (name, numbers + start)
            for region, start in zip(regions, starts[:-1], strict=True)
            for name, numbers in region.cells
        ]
        arrays = ([getattr(region, name) for region in regions] for name in ("points", "values", "fluxes"))
        points, values, fluxes = (np.concatenate(each) for each in arrays)
        return NodalFields(points, tuple(cells), values, fluxes)

    def fields_of_regions(self, load: Array) -> list[NodalFields]:
        """Return the fields on the boundary of each region for a load (n, fields) in SI units and global axes."""
        fields, loads = [], self.regions[0].units.fluxes(load).ravel()
        for number, region in enumerate(self.regions):
            layout = region.layout
            count, floats = len(layout.lower_patches), layout.joints.floats_below
            n = layout.n_fields * count
            unknowns, joined = region.unknowns(loads), np.zeros(layout.n_joined)
            if layout.joints.floats_above:
                joined[n:] = loads[-1]
            added = unknowns[layout.n_unknowns - layout.n_added :]
            below = np.append(-unknowns[layout.flux_column[layout.lower_patches].ravel()], added[:1] if floats else [])
            if count:
                foundation = self.foundations[number]
                joined[:n] = (foundation.offset + foundation.matrix @ below)[:n]
            values = np.concatenate([unknowns, loads, [0.0], joined])
            fields.append(boundary_fields(layout, region.units, region.mesh, values, unknowns, loads))
            if count:
                from_si = (_factors(self.regions[k].units, count, floats)[1] for k in (number + 1, number))
                loads = below * next(from_si) / next(from_si)
        return fields


def _factors(units: Units, nodes: int, floats: bool) -> tuple[Array, Array]:
    """Return factors from units of a system to SI units of responses, and from SI units to those of loads."""
    ones = np.ones(units.scaling.factors.size)
    rows, columns = np.tile(units.values_si(ones), nodes), np.tile(units.fluxes(ones), nodes)
    if not floats:
        return rows, columns
    return np.append(rows, units.fluxes_si(ones)[ELECTRIC]), np.append(columns, units.values(ones)[ELECTRIC])
