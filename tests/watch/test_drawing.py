"""What a browser is sent comes back out of its messages, and not more of them than it can draw."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.watch.page.channel import Drawing, Parts, packed
from observer_rt.watch.page.panel import PanelPart
from tests.watch.message import unpacked

_VALUES = st.lists(st.floats(width=32), max_size=20).map(lambda each: np.array(each, np.float32))
_PANELS = st.dictionaries(st.text(), st.dictionaries(st.text(), _VALUES))
_LETTERS = st.dictionaries(st.text(), st.text())


@given(_PANELS, _LETTERS)
def test_parts_come_back_out_of_a_message(
    panels: dict[str, dict[str, np.ndarray]], letters: dict[str, str]
) -> None:
    letters = {name: text for name, text in letters.items() if name not in panels}
    parts: Parts = {
        **{name: PanelPart((0.0, 1.0), (-1.0, 2.0), columns) for name, columns in panels.items()},
        **letters,
    }
    number, letters_read, columns_read = unpacked(packed(7, parts))
    assert (number, letters_read) == (7, letters)
    assert columns_read.keys() == panels.keys()
    for name, columns in panels.items():
        assert columns_read[name].keys() == columns.keys()
        for column, values in columns.items():
            np.testing.assert_array_equal(columns_read[name][column], values)


def test_a_browser_that_does_not_answer_is_sent_no_more() -> None:
    sent: list[bytes] = []
    drawing = Drawing()
    assert drawing.is_behind, "nobody is there"
    drawing.connect(sent.append)
    assert _sent_until_behind(drawing, sent) in (1, 2, 3)
    drawing.drawn = unpacked(sent[-1])[0]
    assert _sent_until_behind(drawing, sent) in (1, 2, 3)
    drawing.connect(sent.append)  # another browser: it begins anew
    assert _sent_until_behind(drawing, sent) in (1, 2, 3)


def _sent_until_behind(drawing: Drawing, sent: list[bytes]) -> int:
    before = len(sent)
    while not drawing.is_behind:
        drawing.send({"top": "now"})
    return len(sent) - before
