"""`observer-rt` of somebody with a line of his own."""

import tests.model.line.three_lumps  # noqa: F401 - registers it
from observer_rt.cli.app import main

main()
