"""Missing samples, counted while a recording is read."""

from itertools import groupby, pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.identification.likelihood.measurement import MissingSamples


@given(missing=st.lists(st.booleans(), max_size=40), cuts=st.sets(st.integers(0, 40)))
def test_parts_are_counted_as_the_whole(missing: list[bool], cuts: set[int]) -> None:
    gaps = MissingSamples()
    for start, end in pairwise([0, *sorted(min(cut, len(missing)) for cut in cuts), len(missing)]):
        gaps.take(np.array(missing[start:end], np.bool_))
    lengths = [len(list(run)) for is_gap, run in groupby(missing) if is_gap]
    found = gaps.samples, gaps.missing, gaps.count, gaps.longest
    assert found == (len(missing), sum(missing), len(lengths), max(lengths, default=0))
