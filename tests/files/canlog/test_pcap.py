"""Captures of SocketCAN: of one interface or all, in both orders of bytes, cut and damaged."""

import random
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.canlog.pcap import ALL, ALL_2, CAN
from observer_rt.files.formats import is_log, open_log
from observer_rt.foundation.errors import UserError
from tests.files.canlog.log_cases import mixture
from tests.files.logger_file import Capture, pcap, pcapng

CAPTURES = [("bus.pcap", pcap), ("bus.pcapng", pcapng)]


def channel_of(make: Capture, link: int) -> str:
    return "7" if link == ALL_2 else "1" if make is pcap else "can_0"


@pytest.mark.parametrize(("name", "make"), CAPTURES)
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("link", [CAN, ALL, ALL_2])
def test_frames_of_all_kinds(tmp_path: Path, name: str, make: Capture, order: str, link: int) -> None:
    frames = mixture(".log", 30)
    path = tmp_path / name
    path.write_bytes(make(frames, order, link))
    assert is_log(path)
    channel = channel_of(make, link)
    assert list(open_log(path)) == [
        entry._replace(channel=channel, is_sent=entry.is_sent and link != CAN) for entry in frames
    ]


@given(cut=st.integers(0, 1000), which=st.sampled_from(CAPTURES))
def test_a_capture_cut_anywhere(cut: int, which: tuple[str, Capture]) -> None:
    name, make = which
    frames = mixture(".log", 8)
    whole = make(frames, "<", CAN)
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(whole[: max(0, len(whole) - cut)])
        try:
            log = open_log(path)
            found = [entry.frame for entry in log]
        except UserError as error:
            assert "is no capture" in str(error)  # noqa: PT017
            return
    assert found == [entry.frame for entry in frames[: len(found)]]
    ends = {len(make(frames[:count], "<", CAN)) for count in range(9)}
    if found and len(whole) - cut not in ends:
        assert any("it ends within packet" in note for note in log.notes())


@given(seed=st.integers(0, 2**32), which=st.sampled_from(CAPTURES))
def test_damage_is_refused_by_name_or_read(seed: int, which: tuple[str, Capture]) -> None:
    name, make = which
    chance = random.Random(seed)
    data = bytearray(make(mixture(".log", 5), "<", ALL))
    for _ in range(chance.randrange(1, 4)):
        data[chance.randrange(len(data))] = chance.randrange(256)
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        said = name
        try:
            list(open_log(path))
        except UserError as error:
            said = str(error)
    assert name in said


def test_what_the_capture_says_was_lost_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "bus.pcapng"
    path.write_bytes(pcapng(mixture(".log", 3), "<", CAN, lost=17))
    log = open_log(path)
    assert len(list(log)) == 3
    assert f"{path}: 17 frames were lost while it was recorded" in log.notes()


def test_captures_of_other_links_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bus.pcap"
    path.write_bytes(pcap([LogFrame(Frame(1, b"", 10**18, False, False), "1")], "<", 1))
    with pytest.raises(UserError, match="packet 1: is damaged: link type 1 is none of SocketCAN"):
        list(open_log(path))


def test_a_capture_under_another_name_is_named(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    path.write_bytes(pcapng(mixture(".log", 3), "<", CAN))
    with pytest.raises(UserError, match=r"(?s)it looks like a capture\n.*name it so: bus\.pcapng"):
        list(open_log(path))
