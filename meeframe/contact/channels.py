"""Flux channels: how each scalar field of a problem crosses the contact."""

from collections.abc import Sequence
from dataclasses import dataclass

from meeframe.fields import MEE, FieldSet, ScalarField
from meeframe.laws.base import ConductivityLaw, is_conducting


@dataclass(frozen=True)
class FluxChannel:
    """Scalar field with the conductivity law by which its flux crosses the contact.

    The law gives the flux density +kappa(pressure, gap, drop) drop, with the drop of the potential from the body to the
    indenter.

    Attributes
    ----------
    field : ScalarField
        The scalar field.
    law : ConductivityLaw
        Its conductivity law.
    """

    field: ScalarField
    law: ConductivityLaw

    @property
    def is_conducting(self) -> bool:
        """True if the law conducts anywhere."""
        return is_conducting(self.law)


def flux_channels(*laws: ConductivityLaw, fields: FieldSet = MEE) -> tuple[FluxChannel, ...]:
    """Return the channels of a field set with one law for each scalar field, in their order."""
    return tuple(FluxChannel(field, law) for field, law in zip(fields.scalars, laws, strict=True))


def field_set(channels: Sequence[FluxChannel]) -> FieldSet:
    """Return the field set of a sequence of channels."""
    return FieldSet(tuple(channel.field for channel in channels))
