"""The bench file of commands that need one only for some files."""

from pathlib import Path

from observer_rt.config.bench import Bench, load_bench
from observer_rt.foundation.errors import UserError


def decoder_of(
    bench: Path | None, injector: str | None, lenient: bool, model: Path | None = None
) -> Bench | None:
    """The bench of `--bench`, with the injector of `--injector` only; None without one.

    Raises `UserError` for files that do not fit, and for an injector of no bench file.
    """
    if bench is not None:
        return load_bench(bench, model, lenient).of(injector)
    if injector is not None:
        raise UserError(f"--injector {injector}", "names one of a bench file", "give that by --bench")
    return None
