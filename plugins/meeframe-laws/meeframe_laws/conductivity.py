"""Conductivity laws of rough and coated surfaces in contact, and of the gap next to it."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, final

import numpy as np

from meeframe.plugin import Array, CaseError, ConductivityLaw, Quantity, Record, check_quantities


@final
@dataclass(frozen=True)
class PowerLaw(ConductivityLaw):
    """Power law kappa(p) = reference_conductivity * (|p| / reference_pressure)^exponent in contact.

    Attributes
    ----------
    reference_conductivity : float
        kappa at the reference pressure, in F/m^2 (electric), H/m^2 (magnetic) or W/(m^2 K) (thermal).
    reference_pressure : float
        Reference pressure [Pa].
    exponent : float
        Dimensionless exponent.

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    The conductance of two rough surfaces grows nearly in proportion to the real area of contact. For asperities that
    deform plastically, Cooper, Mikic & Yovanovich (Int. J. Heat Mass Transfer 12 (1969) 279) derive a conductance
    proportional to about pressure^0.985, for heat. The exponent 0.95 is that of a later correlation of their theory,
    conductance = 1.25 (slope / roughness) conductivity (pressure / hardness)^0.95. Electric and magnetic contacts obey
    the same potential problem.

    References
    ----------
    Yovanovich, Thermal contact correlations, Prog. Astronaut. Aeronaut. 83, 1982.
    """

    reference_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", "W/m^2/K", "S/m^2", ge=0, lt=math.inf)]
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
    """Saturating law kappa(p) = largest_conductivity * (1 - exp(-|p| / saturation_pressure)) in contact.

    Attributes
    ----------
    largest_conductivity : float
        Conductivity of complete coverage, in F/m^2 (electric), H/m^2 (magnetic) or W/(m^2 K) (thermal).
    saturation_pressure : float
        Hardness [Pa].

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    Spots of real contact yield at the hardness H, so that their areas sum to the fraction |p| / H of the apparent area
    (Bowden & Tabor, The Friction and Lubrication of Solids, 1950). Spots at independent random positions overlap and
    cover the fraction 1 - exp(-|p| / H) of it (Hall, Introduction to the Theory of Coverage Processes, 1988), which
    conducts.
    """

    largest_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", "W/m^2/K", "S/m^2", ge=0, lt=math.inf)]
    saturation_pressure: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa (n,) of the normal traction (n,) [Pa], <= 0 in compression."""
        return np.asarray(-self.largest_conductivity * np.expm1(-_pressure(normal_traction, self.saturation_pressure)))


@final
@dataclass(frozen=True)
class Thresholded(ConductivityLaw):
    """Insulating film that breaks, kappa(p) = contact_conductivity * clip((|p| - threshold) / ramp, 0, 1).

    Attributes
    ----------
    contact_conductivity : float
        Conductivity without the film, in F/m^2 (electric), H/m^2 (magnetic) or W/(m^2 K) (thermal).
    threshold : float
        Pressure at which the film begins to break [Pa].
    ramp : float
        Further pressure over which it breaks [Pa].

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    Oxides and other films insulate metal surfaces until the pressure breaks them (Holm, Electric Contacts, 1967). The
    law has a ramp instead of a step, since there is no solution where the pressure equals that of a step.
    """

    contact_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", "W/m^2/K", "S/m^2", ge=0, lt=math.inf)]
    threshold: Annotated[float, Quantity("Pa", ge=0, lt=math.inf)]
    ramp: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa (n,) of the normal traction (n,) [Pa], <= 0 in compression."""
        broken_fraction = np.clip((-normal_traction - self.threshold) / self.ramp, 0.0, 1.0)
        return np.asarray(self.contact_conductivity * broken_fraction)


@final
@dataclass(frozen=True)
class AcrossGap(ConductivityLaw):
    """Conduction across the gap, kappa = gap_constant / (gap + residual_gap), plus contact_conductivity in contact.

    Attributes
    ----------
    gap_constant : float
        Permittivity [F/m], permeability [H/m] or thermal conductivity [W/(m K)] of the medium in the gap.
    contact_conductivity : float
        Conductivity of the spots of contact, in F/m^2, H/m^2 or W/(m^2 K); inf is allowed.
    residual_gap : float
        Gap that roughness leaves between surfaces in contact [m].

    Raises
    ------
    CaseError
        If one of them is out of bounds, or if contact_conductivity is finite and residual_gap zero (unless gap_constant
        is zero).

    Notes
    -----
    The field in a narrow gap is uniform across it, as in a capacitor of parallel plates at each point (semi-permeable
    condition of cracks: Hao & Shen, Eng. Fract. Mech. 47 (1994) 793). Where surfaces touch, the spots of contact and
    the gap that roughness leaves next to them conduct in parallel, so that contact never conducts less than a gap.
    Without a residual gap the conductivity is unbounded as the gap closes, so that contact conducts perfectly; a finite
    contact_conductivity therefore requires a residual gap. The attraction of the surfaces by the field is neglected.
    """

    across_gap: ClassVar[bool] = True

    gap_constant: Annotated[float, Quantity("F/m", "H/m", "W/m/K", "S/m", ge=0, lt=math.inf)]
    contact_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", "W/m^2/K", "S/m^2", ge=0)] = math.inf
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

    Attributes
    ----------
    gap_constant, contact_conductivity, residual_gap : float
        As for `AcrossGap`.
    breakdown_field : float
        Breakdown field, in V/m (electric) or A/m (magnetic).
    breakdown_conductivity : float
        Conductivity of the discharge, in F/m^2, H/m^2 or W/(m^2 K).

    Raises
    ------
    CaseError
        As for `AcrossGap`.

    Notes
    -----
    flux = gap_constant / g |drop| + breakdown_conductivity max(|drop| - breakdown_field g, 0), g = gap + residual_gap,
    with the sign of the drop. kappa = flux / drop is continuous and never below that of AcrossGap. The larger the
    conductivity of the discharge, the less the field |drop| / g exceeds the breakdown field. The contact_conductivity
    is added where there is pressure. The breakdown field of air is about 3 MV/m between distant plates, and larger in
    gaps of micrometres (Paschen, Ann. Phys. 273 (1889) 69).

    References
    ----------
    Discharge in cracks: Landis, Int. J. Solids Struct. 41 (2004) 6291.
    """

    across_gap: ClassVar[bool] = True

    gap_constant: Annotated[float, Quantity("F/m", "H/m", "W/m/K", "S/m", ge=0, lt=math.inf)]
    breakdown_field: Annotated[float, Quantity("V/m", "A/m", "K/m", gt=0, lt=math.inf)]
    breakdown_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", "W/m^2/K", "S/m^2", ge=0, lt=math.inf)]
    contact_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", "W/m^2/K", "S/m^2", ge=0)] = math.inf
    residual_gap: Annotated[float, Quantity("m", ge=0, lt=math.inf)] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)
        _check_residual_gap(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa (n,) of normal tractions (n,) [Pa], normal gaps (n,) >= 0 [m] and drops (n,) [V] or [A]."""
        spots = np.where(normal_traction < 0.0, self.contact_conductivity, 0.0)
        distance, size = gap + self.residual_gap, np.abs(drop)
        excess = np.maximum(size - self.breakdown_field * distance, 0.0)
        discharge = self.breakdown_conductivity * (excess / np.where(excess > 0.0, size, 1.0))
        return np.asarray(spots + discharge + _plates(self.gap_constant, distance))


@final
@dataclass(frozen=True)
class Robin(ConductivityLaw):
    """Condition of the third kind, with the same kappa on the entire zone under the indenter, in contact or not.

    Attributes
    ----------
    kappa : float
        Conductivity, in F/m^2 (electric), H/m^2 (magnetic) or W/(m^2 K) (thermal); inf prescribes the potential on the
        entire zone.

    Raises
    ------
    CaseError
        If it is negative or NaN.

    Notes
    -----
    This is the linear case of all other laws: a layer that covers the surface and touches the indenter everywhere.

    References
    ----------
    Carslaw & Jaeger, Conduction of Heat in Solids (1959), section 1.9 (radiation into a medium).
    """

    kappa: Annotated[float, Quantity("F/m^2", "H/m^2", "W/m^2/K", "S/m^2", ge=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa at all nodes, (n,)."""
        return np.full_like(normal_traction, self.kappa)


def _check_residual_gap(law: AcrossGap | Breakdown) -> None:
    """Raise CaseError if contact_conductivity has no effect, since a completely closed gap conducts perfectly."""
    if law.residual_gap == 0.0 < law.gap_constant and law.contact_conductivity < math.inf:
        raise CaseError(
            f"{type(law).__name__}: contact_conductivity = {law.contact_conductivity:g} with residual_gap = 0 has no "
            "effect, since a completely closed gap conducts perfectly; allowed: residual_gap > 0, or "
            "contact_conductivity = inf (the default), or gap_constant = 0"
        )


def _pressure(normal_traction: Array, unit: float) -> Array:
    """Return the contact pressure (n,) in a unit [Pa], zero without contact."""
    return np.asarray(np.maximum(-normal_traction, 0.0) / unit)


def _plates(constant: float, distance: Array) -> Array:
    """Return the conductivity (n,) of a gap as that of parallel plates at distances (n,) >= 0 [m]; inf at zero."""
    if constant == 0.0:
        return np.zeros_like(distance)
    with np.errstate(over="ignore"):  # a nearly closed gap conducts like a closed one
        return np.divide(constant, distance, out=np.full_like(distance, np.inf), where=distance > 0.0)


RECORDS: list[Record[ConductivityLaw]] = [
    Record(
        "power-law",
        PowerLaw,
        "kappa_0 (|p| / p_0)^exponent in contact, which grows with pressure like the real contact area",
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
        "permittivity or permeability over the gap, plus kappa in contact",
        "Hao & Shen, Eng. Fract. Mech. 47 (1994) 793-802 (semi-permeable condition)",
    ),
    Record(
        "breakdown",
        Breakdown,
        "as across-gap, plus discharge in parallel beyond a breakdown field",
        "Landis, Int. J. Solids Struct. 41 (2004) 6291-6315 (discharge); Paschen, Ann. Phys. 273 (1889) 69-96",
    ),
    Record(
        "robin",
        Robin,
        "one kappa on the whole zone, in contact or not",
        "Carslaw & Jaeger, Conduction of Heat in Solids, 2nd ed. (1959), section 1.9",
    ),
]
"""Conductivity laws that this module registers."""
