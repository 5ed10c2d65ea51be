"""The one interface of the optional inputs."""

from typing import Generic, TypeVar

Reading = TypeVar("Reading", contravariant=True)


class OptionalInput(Generic[Reading]):
    """What the service makes of one optional input; time is that of the samples [s]."""

    def take(self, reading: Reading, now: float) -> None:
        """A frame came that carries it."""

    def heed(self, now: float) -> None:
        """Samples are about to be observed: what the input says of them takes effect."""

    def look(self) -> None:
        """Samples were observed."""
