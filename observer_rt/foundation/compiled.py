"""The decorator of functions that only compiled code calls."""

from numba import njit

inner = njit(cache=True, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""`njit` without the entry from Python: that takes most of the time in which a small function compiles.

Called from Python such a function crashes; tests/foundation/test_compiled.py forbids it.
"""
