"""Normal laws of the interface: compliance, attraction, initial gaps."""

from meeframe.core.law import ContactLaw
from meeframe.plugin.hookspecs import Record

RECORDS: list[Record[ContactLaw]] = []
"""What this module registers."""
