"""A link that ends in the test."""

from observer_rt.bus.links.link import SWITCHED, FdFlags, Frame, Link


class FakeLink(Link):
    """Receives nothing, keeps sent frames, has lost `lost` frames; tests change what they need."""

    def __init__(self) -> None:
        self.sent: list[Frame] = []
        self.lost = 0

    def receive(self, timeout_s: float) -> Frame | None:
        return None

    def send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: FdFlags = SWITCHED) -> None:
        self.on_sent(Frame(frame_id, payload, 0, is_extended, is_fd))

    def on_sent(self, frame: Frame) -> None:
        self.sent.append(frame)

    @property
    def dropped(self) -> int:
        return self.lost

    def close(self) -> None:
        pass
