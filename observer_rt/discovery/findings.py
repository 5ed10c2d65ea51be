"""What `discover` answers, with what it rests on."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

from observer_rt.discovery.caveats import Caveat, caveats_of
from observer_rt.discovery.comparison.disagreement import Disagreement
from observer_rt.discovery.comparison.gaps import ModelGaps
from observer_rt.discovery.comparison.overlays import Overlay
from observer_rt.discovery.comparison.standstill import StandstillFigure
from observer_rt.discovery.opinion import Opinion, contradictions
from observer_rt.discovery.search.result import Discovery, FittedEffect, Verdict
from observer_rt.model.baseline import HealthyRemainder
from observer_rt.model.parameters import EffectInForce


@dataclass(frozen=True)
class Findings:
    """The answer with what it rests on.

    opinion: of the learning observer, None where it could not be run; healthy_warning: what healthy recordings
    say against the model, empty when nothing; like_inertance: the change found is one that another inertance of
    the line would make as well; level_measured: whether the fit of the model had a measured rate or mass; chosen:
    effects the user chose among those that explain as much; amended_model: name of the file beside the document,
    None when no effect is added; in_force: all effects that it has then; overlays: injections to be shown; files:
    names of the recordings; in_part: which of these were too long to be judged as a whole, and how injections
    were chosen of them; points: of their operating points, each of which counts as a recording; fitted_on,
    held_out: of these; seconds: it took; healthy:
    what the model leaves of the healthy injector, None where nothing is known of it.
    """

    discovery: Discovery
    where: tuple[Disagreement, ...]
    gaps: ModelGaps
    checks: tuple[StandstillFigure, ...]
    opinion: Opinion | None
    healthy_warning: str
    like_inertance: bool
    level_measured: bool
    chosen: tuple[str, ...]
    amended_model: str | None
    in_force: tuple[EffectInForce, ...]
    overlays: tuple[Overlay, ...]
    files: tuple[str, ...]
    in_part: tuple[str, ...]
    points: tuple[str, ...]
    fitted_on: tuple[str, ...]
    held_out: tuple[str, ...]
    seconds: float = 0.0
    healthy: HealthyRemainder | None = None

    @property
    def contradictions(self) -> tuple[str, ...]:
        """Where the learning observer says otherwise."""
        return () if self.opinion is None else contradictions(self.discovery, self.opinion)

    @property
    def held_apart(self) -> bool:
        """Whether the gaps are those of operating points that the sizes were not fitted to."""
        return set(self.held_out) != set(self.fitted_on)

    @property
    def caveats(self) -> tuple[Caveat, ...]:
        """What must be kept in mind with the answer, the gravest first."""
        return caveats_of(self)

    @property
    def is_open(self) -> bool:
        """Whether several explanations are tied and none was chosen."""
        return self.discovery.verdict is Verdict.AMBIGUOUS and not self.chosen


@dataclass(frozen=True)
class Sources:
    """What an answer was made from.

    model, model_hash: name and SHA-256 of the injector file; in_force: effects in it already; recordings: SHA-256 by
    file name; healthy: names of healthy recordings.
    """

    model: str
    model_hash: str
    in_force: tuple[str, ...]
    recordings: Mapping[str, str]
    healthy: tuple[str, ...]
    made: datetime


def explained_share(found: Discovery) -> float:
    """Share of the disagreement that is explained: of what -2 log L has above that of an adequate model."""
    left = sum(cell.samples * (cell.variance - 1.0) for cell in found.after)
    return found.gain / (found.gain + max(0.0, left)) if found.gain > 0.0 else 0.0


def gap_share(found: Discovery, effect: FittedEffect) -> float:
    """An effect's part of that share, by what is lost without it."""
    return explained_share(found) * effect.gain / sum(one.gain for one in found.effects)
