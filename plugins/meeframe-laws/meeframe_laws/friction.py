"""Friction laws: limits of the tangential traction, and how they change with slip, rate and pressure."""

from meeframe.core.law import ContactLaw
from meeframe.plugin.hookspecs import Record

RECORDS: list[Record[ContactLaw]] = []
"""What this module registers."""
