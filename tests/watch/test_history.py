"""Masses and wear of what is kept, whichever injections were shown before."""

from collections.abc import Sequence

import numpy as np

from observer_rt.bus.mapping.output_messages import SummaryValues
from observer_rt.watch.page.history import history_panels
from observer_rt.watch.results import SampleCurves, SeenInjection

_NOTHING = np.empty(0, np.float32)
_NO_CURVES = SampleCurves(
    _NOTHING, _NOTHING, _NOTHING, _NOTHING, _NOTHING, _NOTHING, np.empty((3, 0), np.float32)
)


def seen(number: int, valid: bool = True) -> SeenInjection:
    said = SummaryValues._make([float(number)] * len(SummaryValues._fields))
    return SeenInjection(said._replace(mass=10.0 * number, valid=valid), 0, _NO_CURVES, 2.0 * number)


def columns_of(injections: Sequence[SeenInjection]) -> list[dict[str, bytes]]:
    parts = [panel.part(injections)[panel.name] for panel in history_panels()]
    return [{name: values.tobytes() for name, values in part.columns.items()} for part in parts]


def test_what_was_shown_before_changes_nothing() -> None:
    one, other = [seen(number) for number in range(1, 30)], [seen(number) for number in range(50, 60)]
    panels = history_panels()
    for shown in (one[:1], one[:5], one[:5], one[2:9], other, one[4:12], one[20:], one[3:6]):
        found = [panel.part(shown)[panel.name].columns for panel in panels]
        assert [{name: each.tobytes() for name, each in part.items()} for part in found] == columns_of(shown)


def test_masses_stand_by_number_and_validity() -> None:
    mass = history_panels()[0].part([seen(1), seen(2, valid=False)])["mass"]
    assert mass.columns["number"].tolist() == [1.0, 2.0]
    assert mass.columns["nominal"].tolist() == [2.0, 4.0]
    np.testing.assert_array_equal(mass.columns["valid"], [10.0, np.nan])
    np.testing.assert_array_equal(mass.columns["refused"], [np.nan, 20.0])
