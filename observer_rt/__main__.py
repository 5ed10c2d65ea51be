"""`observer-rt`, or `python -m observer_rt`."""

import gc
import os
import sys

from observer_rt.foundation.errors import InterruptionError

LIBRARY_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment by which a library of linear algebra is told its number of threads."""


def collect_seldom() -> None:
    """Look for garbage after 50,000 objects instead of 700.

    Starting makes many that stay: a tenth of the time goes by looking through them again and again.
    """
    gc.set_threshold(50_000, 5, 2)


def calculate_in_one_thread() -> None:
    """Have linear algebra keep to the thread that asks, unless the environment says otherwise.

    All matrices are small. Its other threads would wait for the next ones by spinning, on the core of the loop.
    """
    for variable in LIBRARY_THREADS:
        os.environ.setdefault(variable, "1")


def open_closed_streams() -> None:
    """Open what the starting process closed of standard streams, so that no file of ours takes their place.

    A file name that the encoding of a stream lacks is written with escapes.
    """
    names = "stdin", "stdout", "stderr"
    while os.open(os.devnull, os.O_RDWR) < len(names):
        pass
    for number, name in enumerate(names):
        if (stream := getattr(sys, name)) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r"))
        elif number and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")


def main() -> None:
    """Import the command line, which takes a while in which it may be interrupted, and run it."""
    open_closed_streams()
    os.environ["MPLBACKEND"] = "agg"  # figures are files; that of a notebook may not be installed here
    collect_seldom()
    calculate_in_one_thread()
    try:
        _import_python_can()
        from observer_rt.desk.cli.app import main as command_line

        command_line()
    except KeyboardInterrupt:
        sys.exit(InterruptionError.exit_code)
    except ImportError as error:
        if error.name != "observer_rt.core":
            raise
        sys.exit(f"observer-rt: {error}")


def _import_python_can() -> None:
    """Without asammdf and pandas, half a second, which it imports for MF4 logs: these are read without it."""
    if "asammdf" in sys.modules:
        return
    sys.modules["asammdf"] = None  # type: ignore[assignment]
    try:
        import can  # noqa: F401
    finally:
        del sys.modules["asammdf"]


if __name__ == "__main__":
    main()
