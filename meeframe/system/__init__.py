"""Reduced systems on the contact zone: contracts, dense and composed systems."""
