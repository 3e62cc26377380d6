"""Formulations: each condenses a body to a reduced system on its contact zone."""
