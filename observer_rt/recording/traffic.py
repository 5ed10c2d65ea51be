"""Who else sends on a bus: two senders of one identifier destroy each other's frames, or mix two recordings."""

import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack

from observer_rt.bus.link import open_link
from observer_rt.config import LinkConfig
from observer_rt.errors import UserError

LISTENING = 0.5  # s; a windowed source pauses for about a tenth
_TURN = 0.02  # s, of one channel among several


def refuse_traffic(
    config: LinkConfig,
    channels: Sequence[str],
    identifiers: Sequence[tuple[int, bool]],
    stop: threading.Event,
) -> None:
    """Listen a moment on all channels. `stop` ends it early.

    Raises:
        UserError: one of the (identifier, is extended) is sent already.
        RunError: the interface cannot be used.
    """
    with ExitStack() as stack:
        links = {
            channel: stack.enter_context(open_link(config.interface, channel, config.fd, identifiers))
            for channel in channels
        }
        end = time.monotonic() + LISTENING
        while time.monotonic() < end and not stop.is_set():
            for channel, link in links.items():
                frame = link.receive(_TURN)
                if frame is not None:
                    raise UserError(
                        f"{config.interface} {channel}",
                        f"another sender is active: frames with identifier 0x{frame.frame_id:X} come in already",
                        "stop it, send under another identifier (--map-id), or send all the same (--force)",
                    )
