"""Conductivity laws: of rough and of covered surfaces in contact, and of what fills the gap beside it."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, final

import numpy as np

from meeframe.plugin import Array, CaseError, ConductivityLaw, Quantity, Record, check_quantities


@final
@dataclass(frozen=True)
class PowerLaw(ConductivityLaw):
    """kappa(p) = reference_conductivity * (|p| / reference_pressure)^exponent in contact, 0 where the contact is open.

    The conductance of two rough surfaces grows nearly in proportion to the area that truly touches. For asperities that
    deform plastically, with heat for charge, Cooper, Mikic & Yovanovich (Int. J. Heat Mass Transfer 12 (1969) 279)
    found about pressure^0.985; the exponent 0.95 is that of a later correlation of their theory, conductance =
    1.25 (slope / roughness) conductivity (pressure / hardness)^0.95 (Yovanovich, Thermal contact correlations, Prog.
    Astronaut. Aeronaut. 83, 1982). An electric or magnetic contact is governed by the same potential problem.

    reference_conductivity: kappa at the reference pressure, F/m^2 (electric) or H/m^2 (magnetic); reference_pressure
    [Pa]; exponent: dimensionless. Raises CaseError if one is out of bounds.
    """

    reference_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0, lt=math.inf)]
    reference_pressure: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]
    exponent: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 0.95

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa (n,) of the normal traction (n,) [Pa], <= 0 in compression."""
        pressure = _pressure(normal_traction, self.reference_pressure)
        return np.asarray(self.reference_conductivity * pressure**self.exponent)


@final
@dataclass(frozen=True)
class Saturating(ConductivityLaw):
    """kappa(p) = largest_conductivity * (1 - exp(-|p| / saturation_pressure)) in contact, 0 where it is open.

    Spots of true contact yield at the hardness H, so that their areas add up to |p| / H of the apparent one (Bowden &
    Tabor, The Friction and Lubrication of Solids, 1950); at places that do not know of each other they overlap and
    cover 1 - exp(-|p| / H) of it (Hall, Introduction to the Theory of Coverage Processes, 1988). What is covered
    conducts: saturation_pressure is the hardness.

    largest_conductivity: where all is covered, F/m^2 (electric) or H/m^2 (magnetic); saturation_pressure [Pa]. Raises
    CaseError if one is out of bounds.
    """

    largest_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0, lt=math.inf)]
    saturation_pressure: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa (n,) of the normal traction (n,) [Pa], <= 0 in compression."""
        return np.asarray(-self.largest_conductivity * np.expm1(-_pressure(normal_traction, self.saturation_pressure)))


@final
@dataclass(frozen=True)
class Thresholded(ConductivityLaw):
    """kappa(p) = contact_conductivity * clip((|p| - threshold) / ramp, 0, 1): none until a film gives way.

    Oxides and other films insulate metal surfaces until the pressure breaks them (Holm, Electric Contacts, 1967). A
    ramp and not a step, as a step under pressure leaves no solution where the pressure is that of the step.

    contact_conductivity: F/m^2 (electric) or H/m^2 (magnetic), where the film is gone; threshold: pressure at which it
    begins to break [Pa]; ramp: further pressure over which it does [Pa]. Raises CaseError if one is out of bounds.
    """

    contact_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0, lt=math.inf)]
    threshold: Annotated[float, Quantity("Pa", ge=0, lt=math.inf)]
    ramp: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa (n,) of the normal traction (n,) [Pa], <= 0 in compression."""
        broken = np.clip((-normal_traction - self.threshold) / self.ramp, 0.0, 1.0)
        return np.asarray(self.contact_conductivity * broken)


@final
@dataclass(frozen=True)
class AcrossGap(ConductivityLaw):
    """kappa = gap_constant / (gap + residual_gap), and contact_conductivity besides where there is pressure.

    The field in a narrow gap is uniform across it: at each point a capacitor of parallel plates (semi-permeable
    condition of cracks: Hao & Shen, Eng. Fract. Mech. 47 (1994) 793). Where surfaces touch, the spots of contact and
    the gap that roughness leaves beside them conduct in parallel, so that contact never conducts less than a gap.
    Without a residual gap the conductivity grows beyond all bounds while the gap closes, so that contact conducts
    perfectly: a finite contact_conductivity asks for a residual gap. The pull of the field on the surfaces is not in
    it.

    gap_constant: permittivity [F/m] (electric) or permeability [H/m] (magnetic) of what fills the gap;
    contact_conductivity: F/m^2 or H/m^2, of the spots of contact, may be inf; residual_gap: what roughness leaves
    between surfaces that touch [m]. Raises CaseError if one is out of bounds, or if contact_conductivity is finite and
    residual_gap zero (but for gap_constant zero).
    """

    across_gap: ClassVar[bool] = True

    gap_constant: Annotated[float, Quantity("F/m", "H/m", ge=0, lt=math.inf)]
    contact_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0)] = math.inf
    residual_gap: Annotated[float, Quantity("m", ge=0, lt=math.inf)] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)
        _check_residual_gap(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa (n,) of normal tractions (n,) [Pa], < 0 in contact, and normal gaps (n,) >= 0 [m]."""
        spots = np.where(normal_traction < 0.0, self.contact_conductivity, 0.0)
        return np.asarray(spots + _plates(self.gap_constant, gap + self.residual_gap))


@final
@dataclass(frozen=True)
class Breakdown(ConductivityLaw):
    """Conduction across the gap and, beyond a breakdown field, discharge in parallel to the capacitor.

    flux = gap_constant / g |drop| + breakdown_conductivity max(|drop| - breakdown_field g, 0), g = gap + residual_gap,
    with the sign of the drop; kappa = flux / drop is continuous and never below that of AcrossGap. The larger the
    conductivity of the discharge, the less the field |drop| / g exceeds the breakdown field. Where there is pressure
    contact_conductivity is added. Source: discharge in cracks, Landis, Int. J. Solids Struct. 41 (2004) 6291; about
    3 MV/m in air between plates far apart, more in gaps of micrometres (Paschen, Ann. Phys. 273 (1889) 69).

    gap_constant, contact_conductivity, residual_gap: see AcrossGap; breakdown_field: V/m (electric) or A/m (magnetic);
    breakdown_conductivity: F/m^2 or H/m^2. Raises CaseError as AcrossGap does.
    """

    across_gap: ClassVar[bool] = True

    gap_constant: Annotated[float, Quantity("F/m", "H/m", ge=0, lt=math.inf)]
    breakdown_field: Annotated[float, Quantity("V/m", "A/m", gt=0, lt=math.inf)]
    breakdown_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0, lt=math.inf)]
    contact_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0)] = math.inf
    residual_gap: Annotated[float, Quantity("m", ge=0, lt=math.inf)] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)
        _check_residual_gap(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa (n,) of normal tractions (n,) [Pa], normal gaps (n,) >= 0 [m] and drops (n,) [V] or [A]."""
        spots = np.where(normal_traction < 0.0, self.contact_conductivity, 0.0)
        plates, size = gap + self.residual_gap, np.abs(drop)
        excess = np.maximum(size - self.breakdown_field * plates, 0.0)
        discharge = self.breakdown_conductivity * (excess / np.where(excess > 0.0, size, 1.0))
        return np.asarray(spots + discharge + _plates(self.gap_constant, plates))


@final
@dataclass(frozen=True)
class Robin(ConductivityLaw):
    """Condition of the third kind: the same kappa on the whole zone under the indenter, in contact or not.

    The linear case of all the others: a layer that covers the surface and touches the indenter everywhere. Source:
    Carslaw & Jaeger, Conduction of Heat in Solids (1959), section 1.9 (radiation into a medium).

    kappa: F/m^2 (electric) or H/m^2 (magnetic); inf holds the potential on the whole zone. Raises CaseError if it is
    negative or NaN.
    """

    kappa: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa everywhere, (n,)."""
        return np.full_like(normal_traction, self.kappa)


def _check_residual_gap(law: AcrossGap | Breakdown) -> None:
    """Raise CaseError where contact_conductivity would be ignored: a gap that closes altogether conducts perfectly."""
    if law.residual_gap == 0.0 < law.gap_constant and law.contact_conductivity < math.inf:
        raise CaseError(
            f"{type(law).__name__}: contact_conductivity = {law.contact_conductivity:g} with residual_gap = 0 has no "
            "effect, as a gap that closes altogether conducts perfectly; allowed: residual_gap > 0, or "
            "contact_conductivity = inf (the default), or gap_constant = 0"
        )


def _pressure(normal_traction: Array, unit: float) -> Array:
    """Return the contact pressure (n,) in units of one [Pa], zero where nothing presses."""
    return np.asarray(np.maximum(-normal_traction, 0.0) / unit)


def _plates(constant: float, distance: Array) -> Array:
    """Return the conductivity (n,) of a gap as that of parallel plates at distances (n,) >= 0 [m]; inf at zero."""
    if constant == 0.0:
        return np.zeros_like(distance)
    with np.errstate(over="ignore"):  # a gap that is all but closed conducts as a closed one
        return np.divide(constant, distance, out=np.full_like(distance, np.inf), where=distance > 0.0)


RECORDS: list[Record[ConductivityLaw]] = [
    Record(
        "power-law",
        PowerLaw,
        "kappa_0 (|p| / p_0)^exponent in contact, growing with pressure like the real contact area",
        "Cooper, Mikic & Yovanovich, Int. J. Heat Mass Transfer 12 (1969) 279-300 (exponent 0.985); Yovanovich, Prog. "
        "Astronaut. Aeronaut. 83 (1982) (0.95)",
    ),
    Record(
        "saturating",
        Saturating,
        "kappa_max (1 - exp(-|p| / p_s)) in contact, as contact spots overlap",
        "Bowden & Tabor, The Friction and Lubrication of Solids (1950); Hall, Introduction to the Theory of Coverage "
        "Processes (1988)",
    ),
    Record(
        "thresholded",
        Thresholded,
        "none up to a threshold pressure, kappa beyond a ramp: an insulating film that breaks",
        "Holm, Electric Contacts, 4th ed. (1967)",
    ),
    Record(
        "across-gap",
        AcrossGap,
        "permittivity or permeability over the gap, and kappa in contact besides",
        "Hao & Shen, Eng. Fract. Mech. 47 (1994) 793-802 (semi-permeable condition)",
    ),
    Record(
        "breakdown",
        Breakdown,
        "as across-gap, and beyond a breakdown field discharge conducts besides, in parallel",
        "Landis, Int. J. Solids Struct. 41 (2004) 6291-6315 (discharge); Paschen, Ann. Phys. 273 (1889) 69-96",
    ),
    Record(
        "robin",
        Robin,
        "one kappa on the whole zone, in contact or not",
        "Carslaw & Jaeger, Conduction of Heat in Solids, 2nd ed. (1959), section 1.9",
    ),
]
"""What this module registers."""
