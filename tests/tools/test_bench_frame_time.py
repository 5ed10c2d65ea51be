"""The benchmark of a frame: it times what it says."""

from tools.benchmarks.frame_time import frame_lines, measure_frame_times


def test_a_frame_costs_more_than_the_way_to_it_and_that_more_than_a_bare_call() -> None:
    times = measure_frame_times(seconds=0.1)
    assert 0.0 < times.bare_call.fastest < times.border.fastest < times.frame.fastest
    assert all(time.fastest <= time.median for time in times)
    assert len(frame_lines(times).splitlines()) == 3
