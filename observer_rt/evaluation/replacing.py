"""Files that take their place only once they are complete."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from observer_rt.foundation.errors import UserError


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A file beside the target that takes its place if all goes well, and else is gone."""
    part = target.with_name(f".{target.stem}.part{target.suffix}")
    try:
        yield part
        part.replace(target)
    except UserError as error:
        raise UserError(error.place.replace(str(part), str(target)), error.problem, error.remedy) from None
    finally:
        part.unlink(missing_ok=True)
