"""Case files: from TOML to a checked case, and from a case to its result."""
