"""Formulations, which condense a body to a reduced system on its contact zone."""
