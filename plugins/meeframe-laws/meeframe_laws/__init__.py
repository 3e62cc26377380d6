"""Contact and conductivity laws beyond the built-in ones of meeframe."""

from collections.abc import Iterable

from meeframe.plugin import ConductivityLaw, ContactLaw, Record, hookimpl
from meeframe_laws import conductivity, friction, interface
from meeframe_laws.conductivity import PowerLaw

__all__ = ["PowerLaw", "meeframe_conductivity_laws", "meeframe_contact_laws"]


@hookimpl
def meeframe_contact_laws() -> Iterable[Record[ContactLaw]]:
    """Register the contact laws of this package."""
    return [*friction.RECORDS, *interface.RECORDS]


@hookimpl
def meeframe_conductivity_laws() -> Iterable[Record[ConductivityLaw]]:
    """Register the conductivity laws of this package."""
    return conductivity.RECORDS
