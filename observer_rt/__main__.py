"""`python -m observer_rt`."""

from observer_rt.cli.app import main

main()
