"""`python -m observer_rt`."""

from observer_rt.cli import main

main()
