"""The device of the tests sends what plain cantools and autosar-e2e make of a recording, bit for bit."""

from pathlib import Path

import pytest

from observer_rt.files.signals.recording import Recording
from tests.benches import ONE_MESSAGE, PATTERNS, THREE_MESSAGES, sample_bench
from tests.daemon.end_to_end import DATABASE
from tests.device import Device, encoded, protected, simulated

UNITS = {"rail_pressure": 1e6, "needle_lift": 1e-6, "line_pressure": 1e6}
START = 4_000_000_000  # index of the first sample


def payloads_by_cantools(name: str, roles: list[str], recording: Recording) -> list[bytes]:
    """Of a message with so many samples of some roles as it has room for; other signals are 0 in its raw codes."""
    message = DATABASE.get_message_by_name(name)
    size = sum(signal.name.startswith(PATTERNS[roles[0]]) for signal in message.signals)
    payloads: list[bytes] = []
    for first in range(0, recording.samples - size + 1, size):
        values = {signal.name: float(signal.minimum or 0.0) for signal in message.signals}
        values["SampleIndex"] = START + first
        for role in roles:
            samples = getattr(recording, role)[first : first + size] / UNITS[role]
            values |= {f"{PATTERNS[role]}_{k:02d}": float(value) for k, value in enumerate(samples)}
        payloads.append(protected(encoded(message, values), message.frame_id, len(payloads)).payload)
    return payloads


@pytest.mark.parametrize("messages", [ONE_MESSAGE, THREE_MESSAGES], ids=["one message", "three messages"])
def test_frames_are_those_of_cantools(tmp_path: Path, messages: dict[str, str]) -> None:
    recording = simulated()
    sent = Device(sample_bench(tmp_path, messages), START).send(recording)
    for name in dict.fromkeys(messages.values()):
        frame_id = DATABASE.get_message_by_name(name).frame_id
        expected = payloads_by_cantools(name, [role for role, of in messages.items() if of == name], recording)
        assert [frame.payload for frame in sent if frame.frame_id == frame_id] == expected
