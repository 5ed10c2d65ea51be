"""Chunks of a recording taken apart and put together."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.files.replay.framing import Span
from observer_rt.files.replay.recording_frames import pieces
from observer_rt.files.signals.recording import Chunk
from observer_rt.files.signals.stream import copied, cut
from observer_rt.foundation.errors import RunError
from tests.files.signals.generated import RepeatedRecording

SAMPLES = 200


def whole_chunk(samples: int = SAMPLES) -> Chunk:
    values = np.arange(float(samples))
    return Chunk(values / 1e5, values, values + 0.25, values + 0.5, values + 0.75, None, 1e5)


places = st.sets(st.integers(0, SAMPLES))


@given(bounds=places, edges=places)
def test_pieces_are_those_of_the_whole_however_it_is_chunked(bounds: set[int], edges: set[int]) -> None:
    ordered = sorted(edges)
    spans = [Span(*pair) for pair in pairwise(ordered)][:: 1 + len(ordered) % 2]  # some touch, some do not
    within = pairwise([0, *sorted(bounds - {0, SAMPLES}), SAMPLES])
    result = list(pieces([cut(whole_chunk(), start, end) for start, end in within], spans))
    assert [(piece.first, piece.samples) for piece in result] == [(s.start, s.end - s.start) for s in spans]
    for piece, span in zip(result, spans, strict=True):
        for name, values in whole_chunk().signals.items():
            np.testing.assert_array_equal(piece.signals[name], values[span.start : span.end])


def test_a_file_that_became_shorter_is_told() -> None:
    with pytest.raises(RunError, match="became shorter"):
        list(pieces([whole_chunk(50)], [Span(0, 20), Span(40, 60)]))


def test_a_copy_does_not_hold_what_it_was_cut_from() -> None:
    part = copied(cut(whole_chunk(), 3, 7))
    assert part.first == 3
    assert [values.base for values in (part.time, *part.signals.values())] == [None] * 5


def test_stretches_on_one_grid_are_a_hole_apart() -> None:
    stream = RepeatedRecording(whole_chunk(), 3, 1)
    recording = stream.collected()
    assert recording.samples == stream.grid_samples == 4 * SAMPLES + 100_000
    available = np.flatnonzero(~np.isnan(recording.rail_pressure))
    np.testing.assert_array_equal(available, [*range(600), *range(100_600, 100_800)])
    np.testing.assert_array_equal(recording.rail_pressure[available], np.tile(np.arange(200.0), 4))
    assert [chunk.first for chunk in stream.on_one_grid()][-1] == 100_600
