"""Whole files of every format, small ones, for `damage.py`."""

import gzip
import random
import shutil
from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.bus.can_frame import FD_LENGTHS
from observer_rt.bus.links.link import Frame
from observer_rt.config.bench import PACKAGE_DATA
from observer_rt.files import formats
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.canlog.pcap import CAN
from observer_rt.files.signals.recording import Recording
from tests.files.logger_file import Field, pcapng, write_logger_file

FRAMES = 40
SAMPLES = 60
START = 1_700_000_000_000_000_000  # ns since 1970
STORED = (
    Field("ID", 29),
    Field("IDE", 1),
    Field("DataLength", 7),
    Field("EDL", 1),
    Field("BRS", 1),
    Field("ESI", 1),
    Field("Dir", 1),
    Field("BusChannel", 0, offset=1),
)
FRAGMENT = 512  # bytes
DATABASE = "database.dbc"


@cache
def makers() -> dict[str, Callable[[Path], None]]:
    """The kinds of files by their name: every format that is written, files of loggers, a database."""
    logs = formats.suffixes_of(formats.written(formats.log_formats()))
    signals = formats.suffixes_of(formats.written(formats.signal_formats()))
    known: dict[str, Callable[[Path], None]] = {f"frames{suffix}": _write_frames for suffix in logs}
    known |= {f"signals{suffix}": _write_signals for suffix in signals}
    known |= {"card.mf4": _write_card, "card_fixed.mf4": partial(_write_card, finalised=True, data_width=64)}
    known |= {  # as asammdf saves them: sorted, in one block of data, in a list of blocks, packed, both
        f"{made.split('.')[0]}_{how}.mf4": partial(
            _write_saved, made=made, fragment=fragment, packing=packing
        )
        for made in ("card.mf4", "card_fixed.mf4", "signals.mf4")
        for how, fragment, packing in (
            ("saved", 0, 0),
            ("listed", FRAGMENT, 0),
            ("packed", 0, 1),
            ("packed_list", FRAGMENT, 2),
        )
    }
    known |= {
        "signals_plain.parquet": _write_parquet,
        "signals_paged.parquet": partial(_write_parquet, paged=True),
    }
    known |= {"busmaster.log": _write_busmaster, "screen.log": _write_screen, "packed.asc.gz": _write_packed}
    known |= {"savvycan.csv": _write_savvycan, "capture.pcapng": _write_capture}
    return known | {DATABASE: write_database}


def write_database(path: Path) -> None:
    """A copy of our database for CAN FD."""
    shutil.copy(PACKAGE_DATA / "observer_fd.dbc", path)


def write_log(path: Path, frames: Iterable[LogFrame], start_ns: int) -> None:
    """Write frames in the format of the name."""
    with formats.open_writer(path, start_ns) as writer:
        for frame in frames:
            writer.write(frame)


def standstill(samples: int, line_noise: float) -> Recording:
    """Noise of three sensors at 100 kHz; line_noise [Pa]."""
    noise = np.random.default_rng(1).normal(size=(3, samples))
    rail, lift, line = noise * np.array([[0.1e6], [0.4e-6], [line_noise]])
    return Recording(np.arange(samples) / 100e3, 100e6 + rail, lift, 100e6 + line)


def _write_frames(path: Path) -> None:
    write_log(path, _frames(formats.log_format(path).keeps_fd), START)


def _write_signals(path: Path) -> None:
    formats.write_recording(path, standstill(SAMPLES, 0.1e6))


def _write_card(path: Path, **how: Any) -> None:
    write_logger_file(path, _frames(True), list(STORED), START, **how)


def _write_saved(path: Path, made: str, fragment: int, packing: int) -> None:
    """As asammdf saves a file of another kind, without what our own have of us. fragment: bytes, 0: as it likes."""
    from asammdf import MDF

    unsaved = path.with_name(f"unsaved_{made}")
    makers()[made](unsaved)
    with MDF(unsaved) as file:
        file.file_history.clear()
        if fragment:
            file.configure(write_fragment_size=fragment)
        file.save(path, compression=packing, overwrite=True)
    unsaved.unlink()


def _write_parquet(path: Path, paged: bool = False) -> None:
    """As others write it. paged: with check sums of its pages."""
    import pyarrow.parquet

    ours = path.with_name("ours.parquet")
    _write_signals(ours)
    content = pyarrow.parquet.read_table(ours)
    pyarrow.parquet.write_table(content, path, write_page_checksum=paged)
    ours.unlink()


def _write_busmaster(path: Path) -> None:
    lines = [
        "***BUSMASTER Ver 3.2.2***",
        "***START DATE AND TIME 14:11:2023 22:13:20:000***",
        "***HEX***",
        "***ABSOLUTE MODE***",
    ]
    for frame, channel, is_sent in _frames(False):
        seconds, rest = divmod(frame.stamp_ns - START, 10**9)
        lines.append(
            f"00:00:{seconds:02d}:{rest // 10**5:04d} {'Tx' if is_sent else 'Rx'} {channel} 0x{frame.frame_id:X} "
            f"{'x' if frame.is_extended else 's'} {len(frame.payload)} {frame.payload.hex(' ').upper()}".rstrip()
        )
    path.write_text("\n".join([*lines, "***[STOP LOGGING SESSION]***", ""]))


def _write_savvycan(path: Path) -> None:
    lines = ["Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"]
    for frame, channel, is_sent in _frames(False):
        flags = f"{str(frame.is_extended).lower()},{'Tx' if is_sent else 'Rx'},{channel},{len(frame.payload)}"
        data = frame.payload.ljust(8, b"\0").hex(",").upper()
        lines.append(f"{frame.stamp_ns // 1000},{frame.frame_id:08X},{flags},{data},")
    path.write_text("\n".join([*lines, ""]))


def _write_capture(path: Path) -> None:
    path.write_bytes(pcapng(_frames(True), "<", CAN))


def _write_screen(path: Path) -> None:
    lines = []
    for frame, _, is_sent in _frames(True):
        seconds, rest = divmod(frame.stamp_ns, 10**9)
        size = f"{len(frame.payload):02d}" if frame.is_fd else str(len(frame.payload))
        flags = f"{'TX' if is_sent else 'RX'} {'B' if frame.bit_rate_switch else '-'} -"
        lines.append(
            f" ({seconds}.{rest // 1000:06d})  can0  {flags}  {frame.frame_id:0{8 if frame.is_extended else 3}X}   "
            f"[{size}]  {frame.payload.hex(' ').upper()}\n"
        )
    path.write_text("".join(lines))


def _write_packed(path: Path) -> None:
    text = path.with_name("frames.asc")
    _write_frames(text)
    path.write_bytes(gzip.compress(text.read_bytes(), mtime=0))


def _frames(with_fd: bool) -> list[LogFrame]:
    """Frames of all kinds on one channel."""
    chance = random.Random(1)
    frames = []
    for number in range(FRAMES):
        is_fd, is_extended = with_fd and chance.random() < 0.5, chance.random() < 0.5
        payload = chance.randbytes(chance.choice(FD_LENGTHS if is_fd else FD_LENGTHS[:9]))
        identifier = chance.randrange(0x2000_0000 if is_extended else 0x800)
        stamp = START + number * 1_234_567_000
        frame = Frame(identifier, payload, stamp, is_extended, is_fd, is_fd and chance.random() < 0.5)
        frames.append(LogFrame(frame, "1", chance.random() < 0.5))
    return frames
