"""The database of what an ECU measures by XCP: the one message in which its link hands over every sample."""

from cantools.database.can import Database, Message, Signal
from cantools.database.conversion import BaseConversion

from observer_rt.bus.database.lookup import INDEX_BITS, USUAL_INDEX
from observer_rt.config.xcp import DATA_TYPES, MESSAGE, XcpConfig


def measurements(config: XcpConfig) -> Database:
    """The message `MESSAGE`: sample index, then the measurements in their order, little-endian without gaps."""
    signals = [Signal(USUAL_INDEX, 0, INDEX_BITS)]
    bits = INDEX_BITS
    for name, each in config.measurements.items():
        kind = DATA_TYPES[each.type]
        conversion = BaseConversion.factory(each.factor, each.offset, is_float=kind.is_float)
        signals.append(
            Signal(name, bits, 8 * kind.size, is_signed=kind.is_signed, conversion=conversion, unit=each.unit)
        )
        bits += 8 * kind.size
    return Database(
        [Message(config.sample_id, MESSAGE, bits // 8, signals, is_extended_frame=True, is_fd=True)]
    )
