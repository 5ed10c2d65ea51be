"""Three injectors on one bus with one rail pressure: the bench file by rule, each alone as one writes it, frames."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from observer_rt.config.bench import PACKAGE_DATA, load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.signals.recording import Recording
from tests.benches import SAMPLE_RATE
from tests.device import frames_of, worn_recording

NAMES = ("one", "two", "three")
RATE_ID, SUMMARY_ID, STATUS_ID, STEP = 0x300, 0x301, 0x302, 0x10
INJECTIONS = 4
_LIFT, _LINE = 0x111, 0x112  # of the database's own blocks

_ALL = """[link]
interface = "{interface}"
channel = "{channel}"
[[dbc]]
file = "injectors.dbc"
[signals.rail_pressure]
message = "RailPressureBlock"
pattern = "RailPressure_{{:02d}}"
[signals.needle_lift]
message = "NeedleLiftBlock_{name}"
pattern = "NeedleLift_{{:02d}}"
[signals.line_pressure]
message = "LinePressureBlock_{name}"
pattern = "LinePressure_{{:02d}}"
[sampling]
rate_hz = {rate}
[learning]
lockstep = true
"""


class Three(NamedTuple):
    """The bench of all, that of each by itself, what each sees, and the frames of all devices."""

    bench: Path
    alone: list[Path]
    recordings: list[Recording]
    frames: list[TimedFrame]

    def results_alone(self, number: int) -> dict[int, list[bytes]]:
        """Payloads with the results of one of them by itself, by their identifiers."""
        frames = evaluate(load_bench(self.alone[number]), [self.recordings[number]]).frames
        results = {
            identifier: [frame.payload for frame in frames if frame.frame_id == identifier]
            for identifier in (RATE_ID + number * STEP, SUMMARY_ID + number * STEP)
        }
        assert all(len(payloads) >= INJECTIONS for payloads in results.values())
        return results


def three_on(folder: Path, channel: str, interface: str = "virtual") -> Three:
    bench = three_injectors(folder, channel, interface)
    alone = [one_alone(folder, number, channel) for number in range(len(NAMES))]
    recordings = three_recordings()
    return Three(bench, alone, recordings, frames_of_all(alone, recordings))


def three_injectors(folder: Path, channel: str, interface: str = "virtual") -> Path:
    """The bench file, its database beside it; it names state files and journals."""
    (folder / "injectors.dbc").write_text(_database())
    path = folder / "bench.toml"
    text = _ALL.format(interface=interface, channel=channel, name="{injector}", rate=SAMPLE_RATE)
    text += (
        f"[outputs]\ninjection_rate_id = {RATE_ID}\ninjection_summary_id = {SUMMARY_ID}\nstatus_id = {STATUS_ID}\n"
        f'id_step = {STEP}\n[state]\nfile = "learned_{{injector}}.json"\njournal = "injections_{{injector}}.sqlite"\n'
    )
    path.write_text(text + "".join(f"[injectors.{name}]\n" for name in NAMES))
    return path


def one_alone(folder: Path, number: int, channel: str) -> Path:
    """The bench file of one of them by itself, nothing by rule."""
    path = folder / f"{NAMES[number]}.toml"
    text = _ALL.format(interface="virtual", channel=channel, name=NAMES[number], rate=SAMPLE_RATE)
    ids = (RATE_ID, SUMMARY_ID, STATUS_ID)
    keys = ("injection_rate_id", "injection_summary_id", "status_id")
    outputs = "".join(f"{key} = {first + number * STEP}\n" for key, first in zip(keys, ids, strict=True))
    path.write_text(f"{text}[outputs]\ninjector_id = {number + 1}\n{outputs}")
    return path


def three_recordings() -> list[Recording]:
    """Injectors of different wear under one rail pressure."""
    first, *others = (worn_recording(INJECTIONS, wear) for wear in (0.0, 0.2, -0.15))
    return [first, *(replace(each, rail_pressure=first.rail_pressure) for each in others)]


def frames_of_all(benches: Sequence[Path], recordings: Sequence[Recording]) -> list[TimedFrame]:
    """The frames of all devices in order of time, those of the rail pressure once."""
    frames: dict[tuple[int, float], TimedFrame] = {}
    for bench, recording in zip(benches, recordings, strict=True):
        for frame in frames_of(bench, recording):
            assert frames.setdefault((frame.frame_id, frame.time), frame) == frame
    return sorted(frames.values(), key=lambda frame: frame.time)


def lift_id(number: int) -> int:
    return _LIFT + STEP * (number + 1)


def with_copies(database: str, copies: Mapping[int, Mapping[int, str]]) -> str:
    """A database with more messages like some of its own: names by identifier, for the identifier of each."""
    own = rf'((?:BO_|CM_ BO_|CM_ SG_|BA_ "\w+" BO_|BA_ "\w+" SG_) )({"|".join(map(str, copies))})\b( \w+(?=:))?'
    out = []
    for block in re.split(r"(?m)^(?=BO_ |CM_ |BA_ |BA_DEF|VAL_|SIG_)", database):
        out.append(block)
        if match := re.match(own, block):
            for identifier, name in copies[int(match[2])].items():
                out.append(f"{match[1]}{identifier}{f' {name}' if match[3] else ''}{block[match.end() :]}")
    return "".join(out)


def _database() -> str:
    """Ours at 50 kHz, with a block of needle lift and one of line pressure for each."""
    ours = re.sub(
        r'(?m)^(BA_ "SamplePeriodNs" BO_ \d+) 10000;', r"\1 20000;", (PACKAGE_DATA / "observer_fd.dbc").read_text()
    )
    blocks = {_LIFT: "NeedleLiftBlock", _LINE: "LinePressureBlock"}
    numbered = [(STEP * number, name) for number, name in enumerate(NAMES, 1)]
    return with_copies(ours, {n: {n + by: f"{block}_{name}" for by, name in numbered} for n, block in blocks.items()})
