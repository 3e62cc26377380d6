"""`python -m meeframe`: the command line."""

from meeframe.cli import main

main()
