"""Conjugate gradients for contact without friction."""
