"""Causes of a log without samples, or with odd stamps: each is named, its remedy gives samples, or none is said."""

import struct
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.foundation.errors import UserError
from tests.benches import own_bench

RATE = 10e3
DATABASE = """VERSION ""
BU_: Daq
BO_ 768 Rig: 8 Daq
 SG_ Rail : 0|16@1+ (0.005,0) [0|0] "MPa" Daq
 SG_ Lift : 16|16@1+ (0.01,0) [0|0] "um" Daq
 SG_ Line : 32|16@1+ (0.005,0) [0|0] "MPa" Daq
 SG_ N : 48|8@1+ (1,0) [0|0] "" Daq
BO_ 769 Lone: 8 Daq
 SG_ Lift : 16|16@1+ (0.01,0) [0|0] "um" Daq
 SG_ N : 48|8@1+ (1,0) [0|0] "" Daq
"""
SHORTER = DATABASE.replace("Rig: 8", "Rig: 7")
SCALED = DATABASE.replace("Rail : 0|16@1+ (0.005,0)", "Rail : 0|16@1+ (5e4,0)")
WIDE = DATABASE.replace("Rail : 0|16@1+ (0.005,0)", "Rail : 0|32@1- (1,0)").replace("Lift : 16|16", "Lift : 32|8", 1)
WIDE = WIDE.replace("Line : 32|16", "Line : 40|16").replace("N : 48|8", "N : 56|8", 1)
FLOATS = f"{WIDE}SIG_VALTYPE_ 768 Rail : 1;\n"
Frames = Iterable[tuple[float, str]]


def frames(data: str = "<HHHBx", rail: float = 20_000, count: int = 200, identifier: str = "300") -> Frames:
    """Times [s] and lines of candump, of 100 MPa and a shut needle."""
    for n in range(count):
        values = struct.pack(data, rail, 0, 20_000, n % 256)
        yield n / RATE, f"can{identifier[-1]} {identifier}#{values.hex()}"


def late(sent: Frames, by: float, since: float = 0.0) -> Frames:
    return ((time + by * (time >= since), line) for time, line in sent)


def both(by: float, count: int) -> Frames:
    """A second message on a channel of its own, whose clock is ahead."""
    return chain.from_iterable(zip(frames(count=count), late(frames(count=count, identifier="301"), by), strict=True))


def decoded(
    folder: Path, sent: Frames, database: str = DATABASE, rate: float = RATE, base: str = ""
) -> LoggedSignals:
    """By a bench; base: time base of a lift that comes alone."""
    lines = 'message = "Rig"\nsignal = "{}"\nindex = ""\ncounter = "N"\ntime_base = "rig"'
    signals = {f"{name.lower()}_pressure": lines.format(name) for name in ("Rail", "Line")}
    signals["needle_lift"] = lines.format("Lift")
    if base:
        signals["needle_lift"] = signals["needle_lift"].replace("Rig", "Lone").replace('"rig"', f'"{base}"')
    bench, log = own_bench(folder, database, signals, f"[sampling]\nrate_hz = {RATE}\n"), folder / "rig.log"
    log.write_text("".join(f"({1_700_000_000 + time:.6f}) {line}\n" for time, line in sent))
    return LoggedSignals(load_bench(bench), log)


@pytest.mark.parametrize(
    ("wrong", "data", "rail", "said", "remedy", "right"),
    [
        (SHORTER, "<HHHBx", 20_000, "200 of wrong length: Rig 0x300 with 8 bytes for 7", "Rig to 8 bytes", DATABASE),
        (DATABASE, "<HHHB", 20_000, "200 of wrong length: Rig 0x300 with 7 bytes for 8", "", ""),
        (WIDE, "<fBHB", 100.0, "Rail of Rig is 1.12e+09 to 1.12e+09 MPa", "SIG_VALTYPE_ 768 Rail : 1;", FLOATS),
        (WIDE, "<fBHB", 900.0, "Rail of Rig is 1.15e+09 to 1.15e+09 MPa", "", ""),
        (SCALED, "<HHHBx", 20_000, "Rail of Rig is 1e+09 to 1e+09 MPa", "", ""),
    ],
)
def test_a_fault_of_the_database_is_named_with_a_remedy_that_gives_samples(
    tmp_path: Path, wrong: str, data: str, rail: float, said: str, remedy: str, right: str
) -> None:
    with pytest.raises(UserError) as refused:
        decoded(tmp_path, frames(data, rail), wrong)
    assert refused.value.problem == f"its 200 input frames give 0 samples: {said}"
    assert remedy in refused.value.remedy
    assert bool(remedy) == bool(refused.value.remedy)
    assert not right or decoded(tmp_path, frames(data, rail), right).samples == 200


@pytest.mark.parametrize(("by", "remedy"), [(3600.0, "take 3600 s from the stamps of Lone"), (3000.0, "")])
def test_clocks_an_hour_apart_are_named(tmp_path: Path, by: float, remedy: str) -> None:
    with pytest.raises(UserError) as refused:
        decoded(tmp_path, both(by, 9000), base="own")
    said = f"Lone begins {by:g} s after Rig, when that has ended: their clocks differ"
    assert refused.value.problem == f"its 18000 input frames give 0 samples: {said}"
    assert refused.value.remedy == remedy
    if remedy:
        assert decoded(tmp_path, both(by - 3600.0, 9000), base="own").samples > 100


def test_too_few_frames_to_know_the_clocks_are_named(tmp_path: Path) -> None:
    said = r"samples of Lone are joined by clocks, which takes 1 s of frames, and it has 0.0299 s$"
    with pytest.raises(UserError, match=said):
        decoded(tmp_path, both(0.0, 300), base="rig")


def test_a_pause_is_no_sample_rate(tmp_path: Path) -> None:
    logged = decoded(tmp_path, late(frames(count=2500), 60.0, since=0.015))
    assert logged.samples == 2500
    (note,) = logged.notes
    assert "after 0.0149 s its stamps step ahead by 60.0001 s, while its samples go on" in note


def test_a_pause_that_the_reader_of_the_log_made_is_told_once(tmp_path: Path) -> None:
    (note,) = decoded(tmp_path, late(frames(count=2500), -0.01, since=0.015)).notes
    assert "steps back by 0.0099 s" in note


@pytest.mark.parametrize(
    ("speed", "remedy"), [(2, ", else set sampling.rate_hz = 20000"), (0.5, ""), (0.01, ""), (1, None)]
)
def test_stamps_of_another_speed_are_told(tmp_path: Path, speed: float, remedy: str | None) -> None:
    notes = decoded(tmp_path, ((time / speed, line) for time, line in frames(count=2500))).notes
    assert len(notes) == (remedy is not None)
    assert all("by its stamps" in note and note.endswith(f"at another speed{remedy}") for note in notes)
