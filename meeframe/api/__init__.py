"""Cases built and solved in Python; the names are exported by `meeframe`."""
