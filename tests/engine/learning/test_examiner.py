"""After which events the examiner believes another."""

import numpy as np
import pytest

from observer_rt.engine.estimation.parameters import PARAMETERS
from observer_rt.engine.estimation.phases import no_statistics
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.adequacy import Examiner, Innovations
from observer_rt.engine.learning.healthy import NOT_FITTED
from tests.engine.learning.strokes import CONSTANTS


@pytest.mark.parametrize(
    ("events", "passed"),
    [
        ("good good good bad good good", "yes yes yes no yes yes"),
        ("good good good bad bad bad good good", "yes yes yes no no no yes yes"),
        ("good bad good good good", "yes no no yes yes"),
        ("good good good bad good bad good good", "yes yes yes no yes no no yes"),
    ],
)
def test_an_event_is_believed_again_sooner_where_all_was_well_before(events: str, passed: str) -> None:
    """Statistics over recent events keep nothing of one that was refused by itself."""
    rng = np.random.default_rng(4)
    window = Window(np.zeros((1200, 2)), np.zeros(1200), np.ones(1200, np.bool_), np.zeros(4), opening=0)
    examiner, result = Examiner(no_statistics(), NOT_FITTED), []
    for event in events.split():
        innovations = Innovations(rng.normal(0.0, 6.0 if event == "bad" else 1.0, 1200), 1.0)
        examination = examiner.examine(window, innovations, np.zeros(PARAMETERS), CONSTANTS)
        examiner.take(examination)
        result.append("no" if examination.objections else "yes")
    assert " ".join(result) == passed
