"""MF4 files of CAN loggers, byte by byte: as left on the card, or finalised, with constants as virtual channels."""

import struct
from dataclasses import dataclass
from pathlib import Path

from observer_rt.files.canlog.can_log import LogFrame

UPDATE_CYCLES, UPDATE_LAST_LENGTH, UPDATE_VARIABLE_BYTES = 0x1, 0x4, 0x20
VARIABLE_GROUP, BUS_EVENT, PLAIN = 0x1, 0x2, 0x4
FIXED, VARIABLE, MASTER, VIRTUAL = 0, 1, 2, 6  # channels
UNSIGNED, BYTES = 0, 10
TIME_BYTES = 8
FRAME_RECORDS, DATA_RECORDS, ERROR_RECORDS = 1, 2, 3


@dataclass(frozen=True)
class Field:
    """A field of a frame: stored in so many bits, or else (0) virtual; `factor` and `offset` of its conversion."""

    name: str
    bits: int
    factor: float = 1.0
    offset: float = 0.0


class _File:
    def __init__(self, identification: bytes) -> None:
        self.data = bytearray(identification)

    def block(self, kind: str, links: list[int], content: bytes) -> int:
        self.data += bytes(-len(self.data) % 8)
        position = len(self.data)
        size = 24 + 8 * len(links) + len(content)
        self.data += struct.pack(f"<4s4xQQ{len(links)}Q", f"##{kind}".encode(), size, len(links), *links) + content
        return position

    def link(self, block: int, number: int, target: int) -> None:
        struct.pack_into("<Q", self.data, block + 24 + 8 * number, target)

    def text(self, text: str) -> int:
        return self.block("TX", [], text.encode() + b"\0")

    def linear(self, factor: float, offset: float) -> int:
        return self.block("CC", [0] * 4, struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0.0, 0.0, offset, factor))

    def channel(
        self, name: str, kind: int, data_type: int, bits: int, position: int, conversion: int = 0, data: int = 0
    ) -> int:
        sync = 1 if kind == MASTER else 0
        content = struct.pack(
            "<BBBBIIIIBxH6d", kind, sync, data_type, position % 8, position // 8, bits, 0, 0, 0, 0, *[0.0] * 6
        )
        return self.block("CN", [0, 0, self.text(name), 0, conversion, data, 0, 0], content)

    def group(self, record: int, cycles: int, flags: int, size: int, channels: list[int]) -> int:
        for earlier, later in zip(channels[:1] + channels[2:], channels[1:2] + channels[3:], strict=False):
            self.link(earlier, 0, later)
        if len(channels) > 2:
            self.link(channels[1], 1, channels[2])
        source = self.block("SI", [0, 0, 0], bytes((2, 2, 0, 0, 0, 0, 0, 0)))
        content = struct.pack("<QQHHIII", record, cycles, flags, 0x2E, 0, size, 0)
        return self.block("CG", [0, channels[0] if channels else 0, 0, source, 0, 0], content)


def write_logger_file(
    path: Path,
    frames: list[LogFrame],
    fields: list[Field],
    start_ns: int,
    finalised: bool = False,
    errors: int = 0,
    data_width: int | None = None,
    id_size: int = 1,
) -> None:
    """Write frames as a logger does: one group of data frames, one of error frames, one of data (VLSD).

    fields: without data bytes; a virtual one has the value of its offset. data_width: bytes a record has for data,
    None: variable, in records of their own; id_size: bytes of a record's id.
    """
    flags = 0 if finalised else UPDATE_CYCLES | UPDATE_LAST_LENGTH | UPDATE_VARIABLE_BYTES * (data_width is None)
    mark = b"MDF     " if finalised else b"UnFinMF "
    file = _File(mark + b"4.11    logger\0\0" + struct.pack("<4xH30xHH", 411, flags, 0))
    header = file.block("HD", [0] * 6, struct.pack("<QhhBBBBdd", start_ns, 0, 0, 0, 0, 0, 0, 0.0, 0.0))
    history = file.block("FH", [0, file.block("MD", [], b"<FHcomment><TX>log</TX></FHcomment>\0")], bytes(16))
    records, size, data_bytes = _records(frames, fields, start_ns, errors, data_width, id_size)

    def cycles(count: int) -> int:
        return count if finalised else 0

    data_group = 0
    if data_width is None:
        data_group = file.group(DATA_RECORDS, cycles(len(frames)), VARIABLE_GROUP, data_bytes * finalised, [])
    channels = [file.channel("Timestamp", MASTER, UNSIGNED, 64, 0, file.linear(1e-9, 0.0))]
    channels.append(file.channel("CAN_DataFrame", FIXED, BYTES, 8 * size - 64, 64))
    position = 8 * TIME_BYTES
    for field in fields:
        conversion = 0
        if not field.bits:
            conversion = file.linear(0.0, field.offset)
        elif (field.factor, field.offset) != (1.0, 0.0):
            conversion = file.linear(field.factor, field.offset)
        kind = FIXED if field.bits else VIRTUAL
        channels.append(file.channel(f"CAN_DataFrame.{field.name}", kind, UNSIGNED, field.bits, position, conversion))
        position += field.bits
    position += -position % 8
    kind, bits = (VARIABLE, 64) if data_width is None else (FIXED, 8 * data_width)
    channels.append(file.channel("CAN_DataFrame.DataBytes", kind, BYTES, bits, position, data=data_group))
    first = file.group(FRAME_RECORDS, cycles(len(frames)), BUS_EVENT | PLAIN, size, channels)
    error_channels = [
        file.channel("Timestamp", MASTER, UNSIGNED, 64, 0, file.linear(1e-9, 0.0)),
        file.channel("CAN_ErrorFrame", FIXED, BYTES, 8, 64),
        file.channel("CAN_ErrorFrame.BusChannel", FIXED, UNSIGNED, 8, 64),
    ]
    second = file.group(ERROR_RECORDS, cycles(errors), BUS_EVENT | PLAIN, TIME_BYTES + 1, error_channels)
    file.link(first, 0, second)
    file.link(second, 0, data_group)
    groups = file.block("DG", [0, first, 0, 0], bytes((id_size, *[0] * 7)))
    file.link(header, 0, groups)
    file.link(header, 1, history)
    data = file.block("DT", [], records)
    file.link(groups, 2, data)
    if not finalised:
        struct.pack_into("<Q", file.data, data + 8, 24)  # its length is not known yet
    path.write_bytes(file.data)


def _records(
    frames: list[LogFrame], fields: list[Field], start_ns: int, errors: int, data_width: int | None, id_size: int
) -> tuple[bytes, int, int]:
    records = bytearray()
    size = 0
    data_bytes = 0
    for frame in frames:
        position = number = 0
        for field in fields:
            if field.bits:
                stored = round((value_of(frame, field.name) - field.offset) / field.factor)
                number |= stored << position
                position += field.bits
        fixed = number.to_bytes((position + 7) // 8, "little")
        payload = frame.frame.payload
        data = struct.pack("<Q", data_bytes) if data_width is None else payload.ljust(data_width, b"\0")
        record = struct.pack("<Q", frame.frame.stamp_ns - start_ns) + fixed + data
        size = len(record)
        records += FRAME_RECORDS.to_bytes(id_size, "little") + record
        if data_width is None:
            records += DATA_RECORDS.to_bytes(id_size, "little") + struct.pack("<I", len(payload)) + payload
            data_bytes += 4 + len(payload)
    for number in range(errors):
        records += ERROR_RECORDS.to_bytes(id_size, "little") + struct.pack("<QB", number, 1)
    return bytes(records), size, data_bytes


def value_of(entry: LogFrame, field: str) -> int:
    """What a field of ASAM's holds for a frame."""
    frame = entry.frame
    return {
        "ID": frame.frame_id,
        "IDE": int(frame.is_extended),
        "BusChannel": int(entry.channel),
        "DLC": 0,
        "DataLength": len(frame.payload),
        "Dir": int(entry.is_sent),
        "EDL": int(frame.is_fd),
        "BRS": int(frame.bit_rate_switch),
        "ESI": int(frame.error_state_indicator),
    }[field]
