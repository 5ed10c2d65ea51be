"""Records of MDF4 files: none is lost in silence, wherever a file is damaged or cut, however its data are stored."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.formats import is_log, open_log
from observer_rt.files.mdf4.records import count_records
from observer_rt.foundation.errors import UserError
from tests.files.canlog.log_cases import START, mixture
from tests.files.logger_file import FRAME_RECORDS, Field, write_logger_file

FRAMES = 30
ERRORS = 2
FIELDS = [
    Field(name, bits) for name, bits in (("ID", 29), ("IDE", 1), ("DataLength", 7), ("Dir", 1), ("EDL", 1))
]
WIDTHS = pytest.mark.parametrize("data_width", [None, 64])
GROUP = 24 + 6 * 8  # bytes of a channel group before its record id, which its cycles follow


def frames_of(count: int) -> list[LogFrame]:
    return [
        frame._replace(
            channel="1", frame=frame.frame._replace(bit_rate_switch=False, error_state_indicator=False)
        )
        for frame in mixture(".mf4", count)
    ]


def card(path: Path, data_width: int | None = None, finalised: bool = False, id_size: int = 1) -> bytes:
    """A file as a logger leaves it on its card, which ends with its records."""
    write_logger_file(path, frames_of(FRAMES), FIELDS, START, finalised, ERRORS, data_width, id_size)
    return path.read_bytes()


def data_place(data: bytes | bytearray) -> int:
    return data.index(b"##DT") + 24


def read(path: Path) -> tuple[list[LogFrame], list[str]] | None:
    """Frames and notes; None where it is refused by name."""
    log = open_log(path)
    try:
        return list(log), log.notes()
    except UserError as error:
        refusal = str(error)
    assert str(path) in refusal
    return None


def set_number(data: bytes, place: int, number: int) -> bytes:
    return data[:place] + struct.pack("<Q", number) + data[place + 8 :]


def in_pieces(data: bytes, kind: str) -> bytes:
    """A finalised file with its data in a list of blocks that end anywhere: plain, packed, packed by columns."""
    begin = data_place(data)
    records, made, places = data[begin:], bytearray(data), []

    def append(kind: bytes, links: list[int], content: bytes) -> int:
        made.extend(bytes(-len(made) % 8))
        place = len(made)
        made.extend(
            struct.pack(
                f"<4s4xQQ{len(links)}Q", b"##" + kind, 24 + 8 * len(links) + len(content), len(links), *links
            )
        )
        made.extend(content)
        return place

    for first in range(0, len(records), 101):
        piece = records[first : first + 101]
        if kind == "plain":
            places.append(append(b"DT", [], piece))
            continue
        row, packing, sorted_piece = 7, kind == "columns", piece
        if packing:
            whole = len(piece) // row * row
            sorted_piece = np.frombuffer(piece[:whole], "u1").reshape(-1, row).T.tobytes() + piece[whole:]
        packed = zlib.compress(sorted_piece)
        content = struct.pack("<2sBxIQQ", b"DT", packing, row, len(piece), len(packed)) + packed
        places.append(append(b"DZ", [], content))
    half = len(places) // 2
    lists = [
        append(b"DL", [0, *some], struct.pack("<B3xI", 0, len(some)) + bytes(8 * len(some)))
        for some in (places[:half], places[half:])
    ]
    struct.pack_into("<Q", made, lists[0] + 24, lists[1])
    head = append(b"HL", [lists[0]], bytes(8)) if kind != "plain" else lists[0]
    struct.pack_into("<Q", made, data.index(b"##DG") + 24 + 2 * 8, head)
    return bytes(made)


@WIDTHS
@pytest.mark.parametrize("id_size", [1, 2, 4, 8])
@pytest.mark.parametrize("kind", ["one block", "plain", "packed", "columns"])
def test_ids_of_any_size_in_data_stored_in_any_way(
    tmp_path: Path, data_width: int | None, id_size: int, kind: str
) -> None:
    path = tmp_path / "card.mf4"
    data = card(path, data_width, True, id_size)
    if kind != "one block":
        path.write_bytes(in_pieces(data, kind))
    found = read(path)
    assert found == (frames_of(FRAMES), [f"{path}: left out: {ERRORS} error frames"])


@pytest.mark.slow
@WIDTHS
@pytest.mark.parametrize(("kind", "step"), [("card", 41), ("plain", 97), ("packed", 97)])
def test_no_bit_loses_frames_in_silence(tmp_path: Path, data_width: int | None, kind: str, step: int) -> None:
    """A frame may come otherwise: the format has no check sum."""
    path = tmp_path / "card.mf4"
    data = card(path, data_width, finalised=kind != "card")
    begin = data_place(data)
    if kind != "card":
        begin, data = len(data), in_pieces(data, kind)
    undamaged = {f"{path}: left out: {ERRORS} error frames"}
    outcomes = []
    for place in range(begin, len(data), step):
        for bit in range(8):
            damaged = bytearray(data)
            damaged[place] ^= 1 << bit
            path.write_bytes(damaged)
            found = read(path)
            outcomes.append(found is None)
            assert found is None or len(found[0]) == FRAMES or set(found[1]) - undamaged, (place, bit)
    assert 0 < sum(outcomes) < len(outcomes)


@WIDTHS
def test_a_card_that_was_cut_anywhere_is_read_up_to_there(tmp_path: Path, data_width: int | None) -> None:
    path = tmp_path / "card.mf4"
    data = card(path, data_width)
    begin = data_place(data)
    borders = 0
    for end in range(begin, begin + 250, 3 if data_width else 2):
        path.write_bytes(data[:end])
        found = read(path)
        assert found is not None
        frames, notes = found
        assert frames == frames_of(FRAMES)[: len(frames)]
        at_border = not (end - begin) or (notes == [] and len(frames) > 0)
        borders += at_border
        assert at_border or any("is cut short" in note or "end is missing" in note for note in notes)
    assert borders < 6


def test_data_that_are_missing_at_the_end_take_their_frame_with_them(tmp_path: Path) -> None:
    path = tmp_path / "card.mf4"
    data = card(path)
    place = data_place(data)
    length = 1 + 8 + 5 + 8  # of a record with its id
    path.write_bytes(data[: place + length])
    found = read(path)
    assert found is not None
    assert found[0] == []
    assert "its last 1 records have no data and are left out: its end is missing" in found[1][0]


def test_the_byte_with_an_unknown_id_is_named_and_the_file_can_be_cut_there(tmp_path: Path) -> None:
    path, beginning = tmp_path / "card.mf4", tmp_path / "BEGINNING.mf4"
    data = card(path, 64)
    place = data_place(data) + 10 * (1 + 8 + 5 + 64)
    assert data[place] == FRAME_RECORDS
    path.write_bytes(data[:place] + b"\x41" + data[place + 1 :])
    with pytest.raises(UserError, match=rf"no record has the id that stands at byte {place}\n") as refused:
        list(open_log(path))
    assert f"head -c {place} FILE > BEGINNING.mf4" in refused.value.remedy
    beginning.write_bytes(data[:place])
    assert read(beginning) == (frames_of(FRAMES)[:10], [])


def test_a_length_beyond_the_data_is_damage_and_no_end(tmp_path: Path) -> None:
    path = tmp_path / "card.mf4"
    data = card(path)
    place = data_place(data) + 1 + 8 + 5 + 8
    damaged = bytearray(data)
    damaged[place + 3] = 1  # 64 KB more
    path.write_bytes(damaged)
    with pytest.raises(UserError, match=rf"the record at byte {place} ends \d+ bytes beyond the data"):
        list(open_log(path))


def test_a_length_that_takes_in_the_last_frame(tmp_path: Path) -> None:
    """The data end where they should: only that the frame before is shorter than its data tells."""
    path = tmp_path / "card.mf4"
    frames = [
        frame._replace(frame=frame.frame._replace(payload=b"\1\2\3\4\5")) for frame in frames_of(FRAMES)
    ]
    write_logger_file(path, frames, FIELDS, START)
    data = bytearray(path.read_bytes())
    both = 32  # bytes of a record of a frame and of one with its data
    assert len(data) - data_place(data) == FRAMES * both
    length = len(data) - both - len(frames[0].frame.payload) - 4
    assert data[length] == 5
    data[length] += both
    path.write_bytes(data)
    with pytest.raises(UserError, match="the data of one of its frames are longer than the frame"):
        list(open_log(path))


@pytest.mark.parametrize("blank", [1, 500])
def test_a_blank_end(tmp_path: Path, blank: int) -> None:
    """As a file system leaves it after a loss of power."""
    path = tmp_path / "card.mf4"
    path.write_bytes(card(path) + bytes(blank))
    found = read(path)
    assert found is not None
    assert found[0] == frames_of(FRAMES)
    told = [f"{path}: its last 500 bytes are blank: its end may be missing"] if blank == 500 else []
    assert found[1][1:] == told


@WIDTHS
@pytest.mark.parametrize("kind", ["one block", "plain", "packed"])
@pytest.mark.parametrize("stated", [FRAMES - 9, FRAMES + 9])
def test_a_heading_that_counts_otherwise_is_reported(
    tmp_path: Path, data_width: int | None, kind: str, stated: int
) -> None:
    path = tmp_path / "card.mf4"
    data = card(path, data_width, True)
    if kind != "one block":
        data = in_pieces(data, kind)
    place = data.index(struct.pack("<QQ", FRAME_RECORDS, FRAMES)) + 8
    path.write_bytes(set_number(data, place, stated))
    found = read(path)
    if found is None:  # what asammdf leaves of data of variable length
        assert stated < FRAMES
        return
    frames, notes = found
    assert frames == frames_of(FRAMES)[: len(frames)]
    assert len(frames) == min(FRAMES, stated)
    wrong = "leaves out 9 frames that are" if stated < FRAMES else "counts 9 frames that are not"
    assert any(f"its heading {wrong} in it" in note for note in notes)


def test_a_list_of_data_that_was_not_finished_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "card.mf4"
    data = bytearray(card(path))
    data[60] |= 0x10
    path.write_bytes(data)
    found = read(path)
    assert found is not None
    assert found[0] == frames_of(FRAMES)
    assert any("its list of data was not finished" in note for note in found[1])


@pytest.mark.parametrize("lost", ["name", "count", "flag", "data"])
def test_a_log_whose_frames_are_lost_is_no_recording(tmp_path: Path, lost: str) -> None:
    path = tmp_path / "card.mf4"
    data = card(path, 64, True)
    group = data.index(struct.pack("<QQ", FRAME_RECORDS, FRAMES))
    if lost == "name":
        data = data.replace(b"CAN_DataFrame\0", b"CAN_DataFrbme\0")
    elif lost == "count":
        data = set_number(data, group + 8, 0)
    elif lost == "flag":
        data = data[: group + 16] + bytes(2) + data[group + 18 :]
    else:
        data = set_number(data, data.index(b"##DG") + 24 + 2 * 8, 0)
    path.write_bytes(data)
    assert is_log(path)
    found = read(path)
    assert found is not None
    if lost == "flag":  # which says nothing that the names do not
        assert found[0] == frames_of(FRAMES)
        return
    assert found[0] == []
    assert "it is a CAN log without a data frame: nothing was recorded, or it is damaged" in found[1][-1]


@pytest.mark.parametrize("link", [0, 1, 2])
def test_links_in_circles_are_refused(tmp_path: Path, link: int) -> None:
    path = tmp_path / "card.mf4"
    data = card(path)
    place = data.index(b"##DG")
    path.write_bytes(set_number(data, place + 24 + 8 * link, place))
    with pytest.raises(UserError, match="a damaged MDF file"):
        count_records(path)


def test_a_file_cut_in_its_blocks_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "card.mf4"
    data = card(path)
    for end in range(0, data_place(data), 97):
        path.write_bytes(data[:end])
        with pytest.raises(UserError, match="MDF"):
            count_records(path)
