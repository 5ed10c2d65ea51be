"""The stream is the same code for every line: only what steps the pair is compiled for one."""

from numba import typeof

from observer_rt.model.parameters import InjectorParameters
from tests.observer.sample_stream import NOMINAL, Stream


def with_line(**line: str | int) -> InjectorParameters:
    return NOMINAL.model_copy(update={"line": NOMINAL.line.model_copy(update=line)})


def test_the_stream_knows_nothing_of_the_line() -> None:
    lump = Stream().observer
    for line in (with_line(model="wave", cells=5), with_line(model="wave", cells=9)):
        assert typeof(Stream(line).observer) == typeof(lump)


def test_the_number_of_cells_is_in_no_type() -> None:
    few, many = (Stream(with_line(model="wave", cells=cells)).observer for cells in (5, 9))
    assert few.x_hat.shape != many.x_hat.shape
    assert typeof(few.stepper) == typeof(many.stepper)


def test_each_observer_steps_its_own_model() -> None:
    lines = (NOMINAL, with_line(model="wave", cells=5), with_line(model="wave", cells=9))
    streams = [Stream(line).rest(2e-3) for line in lines]
    assert [stream.rows["x_hat"].shape[1] for stream in streams] == [
        stream.observer.constants.coefficients.states for stream in streams
    ]
    for stream in streams:
        assert abs(stream.rows["x_hat"][-1, 0] - stream.rows["line_pressure"][-1]) < 1e-9
