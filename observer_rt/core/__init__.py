"""The compiled core: every loop that runs once a sample, in Cython. Knows no Python module of the package."""
