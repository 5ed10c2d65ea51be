"""The one interface of the optional inputs."""

import math
from typing import Generic, TypeVar

Reading = TypeVar("Reading", contravariant=True)


class OptionalInput(Generic[Reading]):
    """What the service makes of one optional input; time is that of the samples [s]."""

    def take(self, reading: Reading, now: float) -> None:
        """A frame came that carries it."""

    def heed(self, now: float) -> None:
        """Samples are about to be observed: what the input says of them takes effect."""

    def heeded_by(self, now: float) -> float:
        """When `heed` is to be called again at the latest, inf: not before a frame that carries it."""
        return math.inf

    @property
    def waits_for_rest(self) -> bool:
        """Whether `heed` is to be called as soon as no event is under way."""
        return False

    @property
    def looks_at_each(self) -> bool:
        """Whether `look` is to be called after every frame, so that what it tells depends on none but these."""
        return False

    def look(self) -> None:
        """Samples were observed."""
