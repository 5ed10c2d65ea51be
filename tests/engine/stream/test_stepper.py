"""The stream is the same for every line: only what steps the pair knows it."""

from observer_rt.model.parameters import InjectorParameters
from tests.engine.sample_stream import NOMINAL, Stream


def with_line(**line: str | int) -> InjectorParameters:
    return NOMINAL.model_copy(update={"line": NOMINAL.line.model_copy(update=line)})


def test_each_observer_steps_its_own_model() -> None:
    lines = (NOMINAL, with_line(model="wave", cells=5), with_line(model="wave", cells=9))
    streams = [Stream(line).stay_shut(2e-3) for line in lines]
    assert [stream.rows["x_hat"].shape[1] for stream in streams] == [
        stream.observer.constants.coefficients.states for stream in streams
    ]
    for stream in streams:
        assert abs(stream.rows["x_hat"][-1, 0] - stream.rows["line_pressure"][-1]) < 1e-9
