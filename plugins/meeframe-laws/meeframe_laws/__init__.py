"""Contact and conductivity laws beyond the built-in ones of meeframe."""

from collections.abc import Iterable

from meeframe.core.law import ConductivityLaw
from meeframe.plugin.hookspecs import Record, hookimpl
from meeframe_laws.conductivity import PowerLaw

__all__ = ["PowerLaw", "meeframe_conductivity_laws"]


@hookimpl
def meeframe_conductivity_laws() -> Iterable[Record[ConductivityLaw]]:
    """Register the conductivity laws of this package."""
    return [
        Record(
            name="power-law",
            factory=PowerLaw,
            summary="kappa_0 (|p| / p_0)^exponent in contact, growing with pressure like the real contact area",
            source="Cooper, Mikic & Yovanovich, Int. J. Heat Mass Transfer 12 (1969) 279-300 (exponent 0.95)",
        )
    ]
