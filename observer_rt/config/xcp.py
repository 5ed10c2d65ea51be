"""Measurements that an ECU sends by XCP on CAN, as a bench file states them."""

from collections.abc import Mapping
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from observer_rt.config.toml_file import Positive, Section

MESSAGE = "XCP"  # to the rest of the bench file all measurements of an ECU are one message of this name


class DataType(NamedTuple):
    """How a measurement is stored."""

    size: int  # bytes
    is_signed: bool = False
    is_float: bool = False


DATA_TYPES: Mapping[str, DataType] = {  # by their names in A2L files
    "UBYTE": DataType(1),
    "SBYTE": DataType(1, True),
    "UWORD": DataType(2),
    "SWORD": DataType(2, True),
    "ULONG": DataType(4),
    "SLONG": DataType(4, True),
    "FLOAT32_IEEE": DataType(4, True, True),
}
TypeName = Literal["UBYTE", "SBYTE", "UWORD", "SWORD", "ULONG", "SLONG", "FLOAT32_IEEE"]
EXTENDED_MASK = 0x1FFF_FFFF
Identifier = Annotated[int, Field(ge=0, le=EXTENDED_MASK)]  # above 0x7FF it is extended


class MeasurementConfig(Section):
    """Variable of the ECU; its value is raw * factor + offset, in the unit."""

    address: Annotated[int, Field(ge=0, le=0xFFFF_FFFF)]
    extension: Annotated[int, Field(ge=0, le=0xFF)] = 0  # of the address
    type: TypeName
    factor: float = 1.0
    offset: float = 0.0
    unit: str = ""


class XcpConfig(Section):
    """ECU that is asked to send measurements at every `event`, of which there are `rate_hz` in a second."""

    master_id: Identifier  # of commands to the ECU
    slave_id: Identifier  # of all that it sends
    event: Annotated[int, Field(ge=0, le=0xFFFF)]  # number of the event channel
    rate_hz: Positive
    measurements: Annotated[Mapping[str, MeasurementConfig], Field(min_length=1, max_length=14)]

    @property
    def sample_id(self) -> int:
        """Extended identifier under which its link hands over samples; on the bus nothing has it."""
        return EXTENDED_MASK ^ self.slave_id
