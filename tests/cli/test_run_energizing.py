"""`observer-rt run` with the energizing on the bus."""

import re
from pathlib import Path

from observer_rt.bus.links.opening import open_link
from observer_rt.config.bench import load_bench
from observer_rt.recording.formats import read_recording
from tests.cli.bench_engineer import bench_engineer
from tests.cli.conftest import Command
from tests.device import frames_of, merged
from tests.service.participants import listening
from tests.service.pulses import TEXT, Told, durations

# Those of the recording, and one that does nothing.
PULSES = [(0.12, 0.5e-3), *((0.15 + 0.05 * number, 1.1e-3) for number in range(4))]
LINE = re.compile(r"injection (\d+) at .* command (\d+), opened after (\d+) us")


def test_commands_and_missing_injections_are_printed(
    command: Command, bench: Path, worn: Path, tmp_path: Path
) -> None:
    (tmp_path / "bed.dbc").write_text(TEXT)
    text = (
        bench.read_text().replace('"can0"', f'"{tmp_path.name}"').replace("enabled = true", "enabled = false")
    )
    bench.write_text(f'{text}\n[[dbc]]\nfile = "bed.dbc"\n[signals.energizing]\n{Told.TIME}')
    channel = load_bench(bench).config.link.channel
    recording = read_recording(worn)
    frames = merged(frames_of(bench, recording), durations(PULSES))

    with (
        listening("virtual", channel) as listener,
        open_link("virtual", channel, True, []) as player,
        bench_engineer(listener, player, frames, recording.samples),
    ):
        outcome = command("run", "--bench", bench)

    assert outcome.code == 0
    printed = " ".join(outcome.err.split())
    assert "injection missing: the needle did not open within 3 ms of command 1 at index 6000" in printed
    found = [[int(number) for number in one] for one in LINE.findall(outcome.err)]
    assert [one[:2] for one in found] == [[1, 2], [2, 3], [3, 4], [4, 5]]
    assert all(280 <= delay <= 360 for _, _, delay in found)
    assert "energizing: 5 commands, 1 injections missing, 0 without a command, opening delay 3" in printed
