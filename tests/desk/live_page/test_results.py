"""Result frames read back: what was written, by every layout of ours; what is damaged is left out."""

import math
from typing import get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links.link import BusFrame, Frame
from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.bus.mapping.output_messages import OutputMessage
from observer_rt.bus.mapping.output_signals import StatusValues, SummaryValues
from observer_rt.config.bench import load_bench
from observer_rt.desk.live_page.samples import PublishedRates, Rates, ResultReader
from observer_rt.engine.service.messages import FrameWriter, OutputFrame
from tests.bus.extended_bench import write_extended_bench

_COUNT = st.integers(0, 6).map(float)
_PHYSICAL = st.one_of(st.just(math.nan), st.floats(0.0, 1.0))


@pytest.fixture(scope="module", params=["fd", "classic"])
def bus(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> BusMap:
    """Our layouts: of the classic one every result takes several frames."""
    if request.param == "fd":
        return map_bus(load_bench())
    return map_bus(load_bench(write_extended_bench(tmp_path_factory.mktemp("classic"))))


def came(sent: OutputFrame) -> BusFrame:
    return BusFrame(sent.bus, Frame(sent.frame_id, sent.payload, 0, sent.is_extended, sent.is_fd))


def read_back(bus: BusMap, message: OutputMessage, values: SummaryValues | StatusValues) -> object:
    reader = ResultReader(bus)
    *first, last = [reader.read(came(frame)) for frame in FrameWriter(message).write(values)]
    assert first == [None] * len(first)
    return last


def places_of(message: OutputMessage) -> list[int]:
    return sorted({int(place) for page in message.pages for place in page.places})


@pytest.mark.parametrize("kind", [SummaryValues, StatusValues])
@given(data=st.data())
def test_what_was_written_is_read(
    bus: BusMap, kind: type[SummaryValues] | type[StatusValues], data: st.DataObject
) -> None:
    message = bus.summary if kind is SummaryValues else bus.status
    whole = [hint is not float for hint in get_type_hints(kind).values()]
    values = [data.draw(_COUNT if is_whole else _PHYSICAL) for is_whole in whole]
    for name in ("valid", "learning", "state"):
        values[kind._fields.index(name)] = data.draw(st.integers(0, 1).map(float))
    for name in {"latency_p999", "largest_latency"}.intersection(kind._fields):
        values[kind._fields.index(name)] = data.draw(st.floats(0.0, 0.065))

    found = read_back(bus, message, kind._make(values))

    assert isinstance(found, kind)
    there = places_of(message)
    assert there
    for place, (written, read) in enumerate(zip(values, found, strict=True)):
        if "latency" in kind._fields[place]:
            written = min(written, 0.065533)  # s, the largest that is sent
        if place not in there:
            assert math.isnan(read)
        elif math.isnan(written):
            assert math.isnan(read) or read == 0.0  # a signal without a code for it
        else:
            assert read == pytest.approx(written, abs=0.051)  # an age has steps of 0.1 s


def test_a_damaged_frame_is_counted_and_left_out() -> None:
    bus = map_bus(load_bench())
    (frame,) = FrameWriter(bus.summary).write(SummaryValues._make([1.0] * len(SummaryValues._fields)))
    payload = bytearray(frame.payload)
    payload[20] ^= 1
    reader = ResultReader(bus)

    assert reader.read(came(frame._replace(payload=bytes(payload)))) is None
    assert reader.refused == 1
    assert isinstance(reader.read(came(frame)), SummaryValues)


def test_other_frames_are_none_of_ours() -> None:
    reader = ResultReader(map_bus(load_bench()))
    assert reader.read(BusFrame(0, Frame(0x7A0, bytes(64), 0))) is None
    assert reader.refused == 0


def test_rates_belong_to_the_samples_they_name() -> None:
    """Two frames of rates, the second not in order."""
    published = PublishedRates()
    published.take(Rates(128, np.arange(28.0)))
    published.take(Rates(100, 100.0 + np.arange(28.0)))

    assert published.at(np.array([100, 127, 128, 155])).tolist() == [100.0, 127.0, 0.0, 27.0]
    assert np.isnan(published.at(np.array([99, 156]))).all()
