"""Where the energizing is shown: `check`, the view, the status, the document of `evaluate`; and its mistakes."""

from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.desk.check.bench_rules import checkup
from observer_rt.desk.check.findings import Level
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.foundation.errors import UserError
from observer_rt.model.effects import effective_model
from tests.daemon.participants import BLOCK_ID, HeardDaemon, ScriptedLink, serving, until
from tests.daemon.pulses import BED, EnergizingBy, durations, injected, misfired, pulse_bench, samples, triple_bench
from tests.desk.evaluation.documents import recording_json, screen_text
from tests.device import EPOCH, frames_of, merged
from tests.files.canlog.log_cases import sent_log, write_log

TWO = 'signals = ["{0}_00", "{0}_01"]\n'
BY_INDEX = "by the sample index"


def traffic() -> list[TimedFrame]:
    """Three injections; the second command misfires, the third injection has none."""
    pulses, recording = injected(3)
    return merged(samples(misfired(recording, (pulses[1][0], pulses[1][0] + 5e-3))), durations(pulses[:2]))


def findings(bench: Path, topic: str, name: str) -> list[tuple[Level, str]]:
    return [(one.level, one.text) for one in checkup(load_bench(bench)) if one.topic == topic and name in one.text]


@pytest.mark.parametrize(
    ("lines", "mapping", "level", "accuracy"),
    [
        (EnergizingBy.LEVEL, "PulseLevel 0x330, Energized, energized while it is not 0", Level.OK, BY_INDEX),
        (EnergizingBy.TIME, "PulseTime 0x331, Duration, energizing time", Level.OK, BY_INDEX),
        (EnergizingBy.LEVELS_IN_BLOCK, "20 samples a frame, Level_00 to Level_19", Level.OK, BY_INDEX),
        (EnergizingBy.TIME_BY_STAMP, "energizing time", Level.WARNING, "receive stamps"),
        (EnergizingBy.CYCLIC, "Energized", Level.WARNING, "receive stamps"),
    ],
)
def test_check_says_what_to_expect(tmp_path: Path, lines: str, mapping: str, level: Level, accuracy: str) -> None:
    bench = pulse_bench(tmp_path, lines)
    [(result, text)] = findings(bench, "mapping", "energizing")
    assert result is Level.OK
    assert mapping in text
    assert "missing 3 ms after" in text
    [(result, text)] = findings(bench, "time", "opening delays")
    assert result is level
    assert accuracy in text
    assert bool(findings(bench, "time", "misses shorter energizing")) == (lines == EnergizingBy.CYCLIC)


@pytest.mark.parametrize(
    ("lines", "location", "word"),
    [
        ('message = "PulseVolts"\nsignal = "Volts"\n', "signals.energizing", "'V'"),
        (EnergizingBy.LEVEL.replace("PulseIndex", "Energized"), "signals.energizing.index", "32 bits"),
        (EnergizingBy.LEVEL + 'time_base = "other"\n', "signals.energizing.index", "stamps"),
        (f'message = "SampleBlock"\n{TWO.format("RailPressure")}unit = "-"\n', "signals.energizing", "9 samples"),
        (f'message = "PulseBlock"\n{TWO.format("Level")}unit = "us"\n', "signals.energizing", "levels"),
    ],
)
def test_mistakes_name_the_key(tmp_path: Path, lines: str, location: str, word: str) -> None:
    bench = pulse_bench(tmp_path, lines)
    with pytest.raises(UserError, match=f"(?s): {location}: .*{word}"):
        map_bus(load_bench(bench))


def test_document_of_a_log(tmp_path: Path) -> None:
    bench = load_bench(pulse_bench(tmp_path, EnergizingBy.TIME))
    log = tmp_path / "bus.log"
    write_log(log, sent_log(traffic(), EPOCH))
    evaluation = evaluate(bench, [LoggedSignals(bench, log)], learning=False).evaluations[0]
    c = effective_model(bench.injector.parameters).coefficients
    document = recording_json(evaluation, c)
    first, third = (one["energizing"] for one in document["injections"])
    assert third is None
    assert (first["command"], first["opening_delay_us"]) == (1, pytest.approx(320, abs=20))
    assert first["energizing_time_us"] == pytest.approx(1100, abs=0.2)
    assert document["summary"]["energizing"] == {
        "commands": 2,
        "missing_injections": 1,
        "mean_opening_delay_us": pytest.approx(first["opening_delay_us"]),
        "opening_delay_sigma_us": 0.0,
    }
    assert "2 commands, 1 injections missing" in screen_text(evaluation, c)


@pytest.mark.parametrize(("signal", "code"), [("Level", 3), ("LevelPlain", 0), ("Time", 20)])
def test_frames_of_a_recording_say_nothing_of_it(tmp_path: Path, signal: str, code: int) -> None:
    bench = load_bench(triple_bench(tmp_path, signal))
    _, recording = injected(1)
    frame = frames_of(bench, recording)[0]
    assert BED.get_message_by_name("Triple").decode(frame.payload, scaling=False)[signal] in (code, "SNA")


def test_view_and_status(tmp_path: Path) -> None:
    path = pulse_bench(tmp_path, EnergizingBy.TIME, '[outputs]\nstatus = "BedStatus"\n[learning]\nenabled = false\n')
    frames = traffic()
    link = ScriptedLink(frames)
    daemon = HeardDaemon(path, link)
    with serving(daemon) as stop:
        until(lambda: daemon.core.frames_taken == sum(frame.frame_id == BLOCK_ID for frame in frames))
        stop.set()
    lines = daemon.drawn().splitlines()
    assert len(lines) <= 24
    assert "2 commands, 1 injections missing, opening delay 3" in daemon.drawn()
    assert any("command" in line and "delay" in line for line in lines)
    status = BED.get_message_by_name("BedStatus")
    last = [frame.payload for frame in link.sent if frame.frame_id == status.frame_id][-1]
    assert status.decode(last) == {"MissingInjections": 1}
    assert [one.command for one in daemon.notes.missing] == [2]
