"""The panel of the missing effect: what it says of evidence, search and finding, whatever the verdict was."""

import asyncio
import json
import shutil
from pathlib import Path

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench
from observer_rt.config.injector import EvidenceConfig
from observer_rt.daemon.snapshot import ShownInjection
from observer_rt.desk.live_page.missing.panel import HEIGHT, gap_drawing, panel_html
from observer_rt.desk.live_page.missing.search import MissingSearch
from observer_rt.foundation.errors import UserError
from tests.desk.live_page import event_loop


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    path = tmp_path / "bench.toml"
    shutil.copyfile(EXAMPLE_BENCH, path)
    (tmp_path / "evidence" / "missing").mkdir(parents=True)
    return load_bench(path).with_sections(evidence=EvidenceConfig(folder="evidence"))


def shown(*injections: tuple[bool, float | None, str]) -> list[ShownInjection]:
    """Injections by validity, gap [MPa] and model."""
    names = ("valid", "gap_MPa", "model")
    return [
        ShownInjection(number, 0, {"number": number, **dict(zip(names, each, strict=True))})
        for number, each in enumerate(injections, 1)
    ]


def test_bars_are_as_high_as_their_gaps_and_a_change_of_model_is_marked() -> None:
    drawing = gap_drawing(shown((False, 4.0, "a"), (False, None, "a"), (True, 0.5, "b")))
    assert drawing is not None
    assert [bar.height / HEIGHT * drawing.top for bar in drawing.bars] == pytest.approx([4.0, 0.5])
    assert [bar.is_valid for bar in drawing.bars] == [False, True]
    assert len(drawing.changes) == 1
    assert gap_drawing(shown((True, None, "a"))) is None


@pytest.mark.parametrize("after", [0.2, None])
def test_a_finding_without_an_amended_model_has_no_button_for_it(bench: Bench, after: float | None) -> None:
    search = MissingSearch(bench)
    gap = {
        "line_pressure": {"before_MPa": 1.5, "after_MPa": after, "noise_floor_MPa": 0.17},
        "injected_mass": {"before_mg": after, "after_mg": None},
    }
    finding = {"verdict": "unknown", "effects": [], "gap": gap, "in_part": True}
    (search.out / "findings.json").write_text(json.dumps(finding))
    html = panel_html(bench, [], search)
    assert "unknown" in html
    assert 'data-ask="search"' in html
    assert 'data-ask="take_over"' not in html
    shutil.copyfile(bench.injector.parameters_path, search.out / "amended.toml")
    assert "This is in force" in panel_html(bench, [], search)
    (search.out / "amended.toml").write_text("[another]")
    html = panel_html(bench, [], search)
    assert 'data-ask="take_over"' in html
    assert "explains a part" in html


def test_evidence_is_counted_by_kind(bench: Bench, tmp_path: Path) -> None:
    for name in ("refused_60MPa_900us_1", "refused_100MPa_900us_2", "good_60MPa_900us_3"):
        (tmp_path / "evidence" / f"{name}.parquet").touch()
    html = panel_html(bench, [], MissingSearch(bench))
    assert "<b>2</b> events refused, <b>0</b> doubtful, <b>1</b> good" in html


def test_a_second_press_is_refused_and_a_search_that_cannot_begin_says_why(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = MissingSearch(bench)

    async def press_twice() -> None:
        search.start()
        with pytest.raises(UserError, match="on its way"):
            search.start()
        while search.seconds is not None:
            await asyncio.sleep(0.01)

    monkeypatch.setattr("observer_rt.desk.live_page.missing.search.question", lambda *_: ["/no/such/program"])
    event_loop.run(press_twice())
    assert "No such file" in search.failure
