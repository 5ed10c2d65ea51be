"""What the lift sensor adds is told once, with its size and what to do, and again when it is over."""

from observer_rt.observer.stream.standstill import LiftFigures
from observer_rt.service.watch.input_watch import LiftWatch

FINE = LiftFigures(at_stop=0.3e-3, stop=0.3e-3)


def test_crosstalk_is_told_once() -> None:
    watch = LiftWatch()
    pressed = LiftFigures(crosstalk=0.15e-12)
    (found,) = watch.look(pressed)
    assert "1.5 um per 10 MPa" in found.text
    assert watch.look(pressed) == []
    (over,) = watch.look(FINE)
    assert over.is_over


def test_scale_is_told_once() -> None:
    watch = LiftWatch()
    assert watch.look(LiftFigures()) == []
    short = LiftFigures(at_stop=0.27e-3, stop=0.3e-3)
    (found,) = watch.look(short)
    assert "270 um" in found.text
    assert "seat.max_lift = 300 um" in found.text
    assert not found.is_over
    assert watch.look(short) == []
    assert [one.is_over for one in watch.look(FINE)] == [True]
