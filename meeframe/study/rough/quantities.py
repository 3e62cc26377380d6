"""Quantities of rough contact at one mean pressure."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from meeframe.contact.problem import Status
from meeframe.fields import ELECTRIC, N_MECHANICAL, Array
from meeframe.results.records import StepResult, Zone
from meeframe.results.resultants import resultants

ROUND_OFF: Final = 1e-12
"""Potential drop, or closing, that is round-off, relative to the largest potential or height."""
CLOSED_GAP: Final = 1e-9
"""Gap that is round-off, relative to the largest height or the approach."""
CHARGE: Final = ELECTRIC - N_MECHANICAL
"""Column of the electric field among the scalar fields."""


@dataclass(frozen=True)
class Quantity:
    """A quantity of the dataset: its unit, "1" for ratios, and its name in words."""

    unit: str
    label: str


QUANTITIES: Final[Mapping[str, Quantity]] = {
    "area_fraction": Quantity("1", "contact area over nominal area"),
    "mean_gap": Quantity("m", "mean gap, zero in contact"),
    "separation": Quantity("m", "mean gap, negative where surfaces overlap"),
    "approach": Quantity("m", "approach"),
    "max_pressure": Quantity("Pa", "largest pressure"),
    "stiffness": Quantity("Pa/m", "incremental contact stiffness per area"),
    "charge_density": Quantity("C/m^2", "charge that enters the body per area"),
    "capacitance": Quantity("F/m^2", "contact capacitance per area"),
    "conductance": Quantity("S/m^2", "contact conductance per area"),
    "persson_area": Quantity("1", "area fraction of Persson's theory"),
    "bush_gibson_thomas_area": Quantity("1", "area fraction of Bush, Gibson and Thomas"),
}
"""Quantities in the order of tables."""


@dataclass(frozen=True)
class Contact:
    """Mean values of an increment.

    Attributes
    ----------
    pressure : float
        Mean pressure [Pa].
    area_fraction : float
        Contact area over nominal area.
    mean_gap, separation, approach : float
        Mean gap with overlaps counted as zero, mean gap with overlaps counted as negative, and approach [m].
    max_pressure : float
        Largest pressure [Pa].
    charge_density : float
        Charge that enters the body over the nominal area [C/m^2].
    potential_drop : float
        Potential of the indenter less the mean of the surface if it is periodic [V].
    max_gap, max_potential : float
        Largest modulus of the gap [m], and of the potentials of indenter and surface [V], in which round-off counts.
    """

    pressure: float
    area_fraction: float
    mean_gap: float
    separation: float
    approach: float
    max_pressure: float
    charge_density: float
    potential_drop: float
    max_gap: float
    max_potential: float

    @classmethod
    def of(cls, zone: Zone, step: StepResult, is_periodic: bool) -> "Contact":
        """Return the mean values over the nominal area; nan unless the increment converged.

        Parameters
        ----------
        zone : Zone
            Nodes of the contact zone.
        step : StepResult
            The increment.
        is_periodic : bool
            Whether the zone is one period.
        """
        if step.status is not Status.CONVERGED:  # its state is that of another load, or of none
            return cls(*[np.nan] * len(fields(cls)))
        weights = zone.weights
        area = float(weights.sum())

        def mean(values: Array) -> float:
            return float(weights @ values) / area

        gap, totals = step.gap, resultants(zone, step)
        potential = float(getattr(step.loading, step.fields.scalars[CHARGE].value_name))
        drop = potential - mean(step.potentials[:, CHARGE]) if is_periodic else potential
        return cls(
            pressure=mean(-step.traction[:, 2]),
            area_fraction=totals.contact_area / area,
            mean_gap=mean(np.maximum(gap, 0.0)),
            separation=mean(gap),
            approach=step.loading.approach,
            max_pressure=totals.max_pressure,
            charge_density=0.0 - mean(step.fluxes[:, CHARGE]),  # no -0.0
            potential_drop=drop,
            max_gap=float(np.abs(gap).max()),
            max_potential=max(abs(potential), float(np.abs(step.potentials[:, CHARGE]).max())),
        )


def is_full(contact: Contact, height: float) -> bool:
    """Return whether all nodes are in contact, with gaps that are round-off.

    Parameters
    ----------
    contact : Contact
        The contact.
    height : float
        Largest height of the surface about its mean [m].
    """
    closed = contact.max_gap <= CLOSED_GAP * max(height, abs(contact.approach))
    return closed and contact.area_fraction > 1.0 - ROUND_OFF


def stiffness(below: Contact, above: Contact, is_periodic: bool, height: float) -> float:
    """Return the incremental stiffness per area between two mean pressures.

    Parameters
    ----------
    below, above : Contact
        The contact at both pressures.
    is_periodic : bool
        True for the change of the pressure over that of the separation: the mean displacement of a periodic surface is
        that of a body whose size is arbitrary. False for that over the change of the approach.
    height : float
        Largest height of the surface about its mean [m].

    Returns
    -------
    float
        Stiffness [Pa/m], inf if nothing closes as in full contact of a periodic surface, nan if it opens.
    """
    closing = below.separation - above.separation if is_periodic else above.approach - below.approach
    if is_periodic and (abs(closing) <= ROUND_OFF * height or (is_full(below, height) and is_full(above, height))):
        return np.inf
    return (above.pressure - below.pressure) / closing if closing > 0.0 else np.nan


def per_drop(contact: Contact, reference: Contact | None = None, has_drop: bool = True) -> float:
    """Return the charge or current per area over the potential drop that causes it; inf without a drop.

    It is nan if one of the contacts did not converge.

    Parameters
    ----------
    contact : Contact
        The contact under a potential.
    reference : Contact, optional
        The contact without a potential, where the pressure alone causes a charge.
    has_drop : bool, optional
        False for a periodic contact that is perfect everywhere, whose drop is round-off.
    """
    charge = contact.charge_density - (reference.charge_density if reference else 0.0)
    drop = contact.potential_drop - (reference.potential_drop if reference else 0.0)
    scale = max(contact.max_potential, reference.max_potential if reference else 0.0)
    if has_drop and not abs(drop) <= ROUND_OFF * scale:
        return charge / drop
    return charge if np.isnan(charge) else np.inf
