"""Imports the package before any test imports Numba: it chooses the folder of the compiled code."""

import observer_rt  # noqa: F401
