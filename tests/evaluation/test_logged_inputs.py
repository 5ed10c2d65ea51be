"""Which cable was off while a log was recorded: its inputs are watched as the daemon watches them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.evaluation.logged import read_logged
from observer_rt.foundation.errors import UserError
from tests.benches import block_bench
from tests.device import frames_of, worn_recording
from tests.recording.canlog.log_cases import sent_log, write_log


def test_a_message_that_is_not_in_the_log_is_named(tmp_path: Path) -> None:
    """Not the bench file is blamed: the frames of the other messages are good."""
    bench = block_bench(tmp_path, "virtual", ["x"])
    sent = frames_of(bench, worn_recording())
    write_log(tmp_path / "a.log", sent_log(frame for frame in sent if frame.frame_id != 0x111))
    with pytest.raises(UserError) as refused:
        read_logged(load_bench(bench), tmp_path / "a.log")
    assert "NeedleLiftBlock 0x111 (needle_lift): no frame in the log" in refused.value.problem
    assert "--bench" not in (refused.value.remedy or "")


def test_a_message_that_ends_early_is_named(tmp_path: Path) -> None:
    bench = block_bench(tmp_path, "virtual", ["x"])
    sent = frames_of(bench, worn_recording(injections=24))
    part = [frame for frame in sent if frame.frame_id != 0x111 or frame.time < 0.5]
    write_log(tmp_path / "a.log", sent_log(part))
    notes = read_logged(load_bench(bench), tmp_path / "a.log").notes
    assert any("NeedleLiftBlock 0x111 (needle_lift): no frame in the last 0.9 s" in note for note in notes)


def test_a_dead_sensor_in_a_log_is_named(tmp_path: Path) -> None:
    bench = block_bench(tmp_path, "virtual", ["x"])
    recording = worn_recording(injections=12)
    dead = replace(recording, needle_lift=np.zeros_like(recording.needle_lift))
    write_log(tmp_path / "a.log", sent_log(frames_of(bench, dead)))
    (note,) = read_logged(load_bench(bench), tmp_path / "a.log").notes
    assert "NeedleLiftBlock 0x111 (needle_lift): needle_lift is frozen" in note
