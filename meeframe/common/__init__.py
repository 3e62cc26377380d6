"""Errors, memoization, thread limits and TOML files, used by all other packages."""
