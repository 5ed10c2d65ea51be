"""What must be kept in mind with an answer: told wherever the answer is, on the screen, in the file, on the page."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from observer_rt.discovery.search.result import Discovery, Verdict
from observer_rt.discovery.search.search import indistinguishable
from observer_rt.evidence.operating_points import distinct
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY
from observer_rt.observer.learning.doubts.adequacy import looks_like_inertance

if TYPE_CHECKING:
    from observer_rt.discovery.findings import Findings

LEAST_MASS = 0.01 * MILLIGRAM  # kg, below which a change or gap is not worth a number
RECORD_MORE = "record at least three rail pressures and two durations"


@dataclass(frozen=True)
class Caveat:
    """A reservation. id: for programs; words: for a headline; sentence: what it means, and what would mend it."""

    id: str
    words: str
    sentence: str


def caveats_of(findings: "Findings") -> tuple[Caveat, ...]:
    """The reservations an answer is given with, the gravest first."""
    every = (_of_opponents, _of_bench, _of_coverage, _of_names, _of_level)
    return tuple(caveat for arising in every for caveat in arising(findings))


def remedies(found: Discovery) -> tuple[str, ...]:
    """What to do about the effects found that no injector file can have in force."""
    return tuple(remedy for effect in found.effects if (remedy := VOCABULARY[effect.id].remedy))


def is_level_measured(nominal: EffectiveModel) -> bool:
    """Whether a rate or mass told the level of all flows when the model was fitted."""
    baseline = nominal.injector.baseline
    return baseline is not None and baseline.level != "file"


def is_like_inertance(nominal: EffectiveModel, amended: EffectiveModel) -> bool:
    """Whether nozzle flow and stiffness of the line were changed as if the line's inertance were another."""
    before, after = nominal.injector, amended.injector
    stiffness = [one.fluid.bulk_modulus_line / one.line.volume for one in (before, after)]
    nozzle = after.nozzle.flow_coefficient / before.nozzle.flow_coefficient
    return looks_like_inertance(nozzle - 1.0, stiffness[1] / stiffness[0] - 1.0)


def _of_opponents(findings: "Findings") -> Iterator[Caveat]:
    if findings.healthy_warning:
        yield Caveat(
            "healthy_recordings", "what is named may be the model's own error", findings.healthy_warning
        )
    if findings.contradictions:
        yield Caveat(
            "observer",
            "the learning observer does not agree",
            f"The learning observer does not agree: {'; '.join(findings.contradictions)}. Do not act before this is "
            "understood.",
        )


def _of_bench(findings: "Findings") -> Iterator[Caveat]:
    for remedy in remedies(findings.discovery):
        yield Caveat(
            "bench_file",
            remedy,
            f"What was found is of the bench, not of the injector: {remedy}, and give the command again with it. "
            "Until then there is no amended model.",
        )


def _of_coverage(findings: "Findings") -> Iterator[Caveat]:
    if not findings.held_apart:
        yield Caveat(
            "one_operating_point",
            "one operating point, nothing held out",
            "All this rests on one operating point: nothing could be held out, and what shows at another rail "
            f"pressure or duration only cannot be told; {RECORD_MORE}.",
        )
    elif distinct({cell.rail_pressure for cell in findings.discovery.before}) == 1:
        yield Caveat(
            "one_rail_pressure",
            "one rail pressure",
            "All this rests on one rail pressure: a factor and an offset of a sensor, or a stiffness and its rise "
            f"with pressure, look alike there; {RECORD_MORE}.",
        )


def _of_names(findings: "Findings") -> Iterator[Caveat]:
    for effect in findings.discovery.effects:
        others = " or ".join(indistinguishable(VOCABULARY[effect.id]))
        if others:
            yield Caveat(
                "same_signals",
                f"{others} would look the same",
                f"{effect.id} and {others} have the same effect on every signal; either name is right for the model.",
            )


def _of_level(findings: "Findings") -> Iterator[Caveat]:
    """Without a measured rate, now or when the model was fitted, the level of all flows is the line's inertance."""
    found = findings.discovery
    if findings.gaps.injection_rate is not None or found.verdict is Verdict.UNKNOWN:
        return
    if findings.like_inertance:
        settled = " (right when the model was fitted: another fuel since then, say)"
        yield Caveat(
            "line_inertance",
            "another line inertance would look the same",
            "Flow and stiffness of the line changed together as they would for another inertance of the line "
            f"(density, length and diameter in the model){settled if findings.level_measured else ''}; the "
            "injection rate measured tells them apart.",
        )
    elif not findings.level_measured and (
        not found.effects or any(abs(effect.moves.mass) >= LEAST_MASS for effect in found.effects)
    ):
        yield Caveat(
            "mass_not_measured",
            "injected mass not measured",
            "No injection rate was measured: masses follow from the line pressure and the inertance of the line "
            "(density, length and diameter in the model), and are wrong by the same share where that is. A model "
            "fitted with a measured rate or mass (`observer-rt fit`) has it right.",
        )
