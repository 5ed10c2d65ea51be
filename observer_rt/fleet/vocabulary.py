"""Effects of the user's own in processes that may have worked for somebody else before."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from observer_rt.config.own_effects import use_effects
from observer_rt.foundation.errors import UserError
from observer_rt.model.effects import added_digests


@dataclass(frozen=True)
class OwnEffects:
    """Files with effects of the user's own; digests: of their content, and of installed effects."""

    paths: tuple[Path, ...] = ()
    digests: tuple[str, ...] = ()

    @classmethod
    def in_use(cls, paths: Sequence[Path]) -> Self:
        """Those of this process, read from these files."""
        return cls(tuple(path.absolute() for path in paths), added_digests())

    def use(self) -> None:
        """Have them in the vocabulary, and no others. Raises `UserError` where a worker has other ones."""
        if added_digests() == self.digests:
            return
        use_effects(self.paths)
        if added_digests() != self.digests:
            raise UserError(
                "worker",
                "has other effects of your own, or other installed ones, than this command",
                "have the same files and packages wherever a worker runs",
            )
