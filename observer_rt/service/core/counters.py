"""What the service counts."""

from dataclasses import dataclass

from observer_rt.service.compiled.pipeline import Pipeline
from observer_rt.service.inputs.energizing import EnergizingFigures
from observer_rt.service.reports.judging import Judging


@dataclass(frozen=True)
class Counters:
    """What was counted since the start."""

    samples: int
    lost_samples: int
    interpolated_samples: int
    spikes: int
    bridged_samples: int
    frames: int
    crc_errors: int
    length_errors: int
    sequence_errors: int
    repeated_frames: int
    old_frames: int
    restarts: int
    jumps: int
    events: int
    injections: int
    adoptions: int
    rejected_adoptions: int
    late_adoptions: int
    passed_over: int
    """Events judged, and not learned from since more came than can be."""
    commands: int
    """Energizings of the injector; 0, as the next, where that is no input."""
    missing_injections: int
    uncommanded_injections: int

    @property
    def outliers(self) -> str:
        """Spikes and bridged values, in words; empty: there were none."""
        if not self.spikes and not self.bridged_samples:
            return ""
        return f"{self.spikes} spikes replaced, {self.bridged_samples} values of frozen or missing inputs bridged"

    def since(self, earlier: "Counters") -> "Counters":
        """What was counted since an earlier look."""
        return Counters(**{name: count - getattr(earlier, name) for name, count in vars(self).items()})


def counted(pipeline: Pipeline, energizing: EnergizingFigures | None, judging: Judging) -> Counters:
    """What all parts have counted."""
    receiver = pipeline.receiver[0]
    alignment = pipeline.alignment.memory[0]
    memory = pipeline.observer.memory[0]
    return Counters(
        samples=int(memory["processed"]),
        lost_samples=int(alignment["lost"]),
        interpolated_samples=int(memory["interpolated"]),
        spikes=int(memory["spikes"]),
        bridged_samples=int(memory["bridged"]),
        frames=int(receiver["frames"]),
        crc_errors=int(receiver["crc_errors"]),
        length_errors=int(receiver["length_errors"]),
        sequence_errors=int(receiver["sequence_errors"]),
        repeated_frames=int(alignment["repeated"]),
        old_frames=int(alignment["old"]),
        restarts=int(alignment["restarts"]),
        jumps=int(alignment["jumps"]),
        events=int(memory["events_judged"]),
        injections=int(memory["injections_reported"]),
        adoptions=judging.adoptions,
        rejected_adoptions=judging.rejected,
        late_adoptions=judging.late,
        passed_over=judging.passed_over,
        commands=energizing.commands if energizing else 0,
        missing_injections=energizing.missing if energizing else 0,
        uncommanded_injections=energizing.uncommanded if energizing else 0,
    )
