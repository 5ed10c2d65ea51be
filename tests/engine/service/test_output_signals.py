"""Output signals: their table is in databases and frames, and a frame that says Valid has all its samples."""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple, get_type_hints

import cantools.database
import numpy as np
import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.bus.mapping.output_messages import output_message
from observer_rt.bus.mapping.output_signals import (
    OutputSignal,
    SentQuantity,
    StatusValues,
    SummaryValues,
    rows_of,
    signals_of,
)
from observer_rt.config.bench import load_bench
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import FrameWriter, value_of
from observer_rt.files.replay.framing import Span, TimedFrame
from tests.daemon.end_to_end import RATE
from tests.device import RATES, Device, Traffic, later, simulated
from tools.lib.word_tables import DATABASES, database_with_signals

LENGTH = SentQuantity(0.1, -5.0, "um", 1e-6)
MAKE: Any = NamedTuple
MORE = MAKE(
    "MORE",
    [
        *get_type_hints(SummaryValues, include_extras=True).items(),
        ("needle_bounces", Annotated[int, OutputSignal("counts.bounces", 8, 363, 7, 16, says="Of the needle.")]),
        ("bounce_height", Annotated[float, OutputSignal("report.bounce", 8, 371, 7, 24, LENGTH)]),
    ],
)

Disturbance = Callable[[Traffic], list[TimedFrame]]
VALID_FROM = 12_000  # sample: two events were judged long before
FIRST = VALID_FROM // 9  # frame


@pytest.mark.parametrize("path", DATABASES, ids=lambda path: path.stem)
def test_a_row_adds_a_signal_and_a_counter(path: Any) -> None:
    text = database_with_signals(path.read_text("utf-8"), {513: MORE})
    assert database_with_signals(text, {513: MORE}) == text
    message = cantools.database.load_string(text, "dbc").get_message_by_name("InjectionSummary")
    assert message.get_signal_by_name("NeedleBounces").comment == "Of the needle."
    parts = {"counts": np.array((7,), [("bounces", np.int64)])[()], "report": {"bounce": 2e-6, "mass": 40e-6}}
    sent: dict[str, Any] = {}
    for frame in FrameWriter([(MORE, output_message(message, signals_of(MORE)))]).write(parts):
        sent |= message.decode(frame.payload, decode_choices=False)
    assert (sent["NeedleBounces"], sent["BounceHeight"]) == (7, pytest.approx(2.0))
    assert sent["Mass"] == pytest.approx(40.0)
    assert sent["Volume"] == pytest.approx(-50.0 + 0.01 * 0xFFFF)  # there is none


@pytest.mark.parametrize("path", DATABASES, ids=lambda path: path.stem)
def test_a_row_that_goes_takes_its_lines_along(path: Any) -> None:
    text = path.read_text("utf-8")
    more = database_with_signals(text, {513: MORE})
    assert more != text
    assert database_with_signals(more) == text


def test_the_core_has_what_the_status_sends() -> None:
    bench = load_bench()
    parts = Core(bench.injector, map_bus(bench)).parts
    sources = [row.source for row in rows_of(StatusValues).values() if row.source.split(".")[0] in parts]
    assert len(sources) > 15
    for source in sources:
        assert (value_of(source, parts) is None) == source.startswith("energizing.")


def some_lost(traffic: Traffic) -> list[TimedFrame]:
    is_there = np.random.default_rng(6).random(len(traffic.frames)) > 0.02
    return [frame for k, frame in enumerate(traffic.frames) if k < FIRST or is_there[k]]


def restarted(traffic: Traffic) -> list[TimedFrame]:
    return [*traffic.frames[:FIRST], *later(Device(traffic.bench).send(simulated()), 0.3)]


def jumped(traffic: Traffic) -> list[TimedFrame]:
    device = Device(traffic.bench)
    return device.send(simulated(), Span(0, 9 * FIRST), Span(9 * FIRST + 900, 15_000))


def rates(frame: dict[str, Any]) -> list[Any]:
    """Numbers, or the reason, in words, why there are no numbers."""
    return [value for name, value in frame.items() if name.startswith("InjectionRate_")]


def is_complete(frame: dict[str, Any]) -> bool:
    return all(isinstance(rate, float) for rate in rates(frame))


@pytest.mark.parametrize("disturbance", [some_lost, restarted, jumped, lambda traffic: traffic.frames[:FIRST]])
def test_a_frame_that_is_cut_short_is_not_valid(clean: Traffic, disturbance: Disturbance) -> None:
    frames: list[Any] = [
        RATE.decode(frame.payload)
        for frame in clean.run(disturbance(clean)).frames
        if frame.frame_id == RATE.frame_id
    ]
    cut = [
        not is_complete(frame) and isinstance(rates(frame)[0], float)
        for frame in frames
        if frame["SampleIndex"] >= VALID_FROM - RATES
    ]
    valid = [frame for frame in frames if frame["Valid"] == 1]
    assert any(cut)
    assert len(valid) > 10
    assert all(map(is_complete, valid))
