"""Fundamental solutions of the extended equations of equilibrium."""

from meeframe.fundamental.line_integral import LineIntegral

__all__ = ["LineIntegral"]
