"""Hooks through which everything that has a name in a case file is registered, built-in or not."""
