"""Accuracies of sensors, geometry and fuel, and of the level of all flows, which no pressure shows.

Flows grow with the rail sensor's gain, with the square of the line's bore over its length, and with what leaves the
line beside the nozzle; the same innovations fit other levels as well. Of the two pressure sensors only the gain of
one over the other shows. All are one sigma.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from observer_rt.foundation.documents import Section

Percent = Annotated[float, Field(ge=0, le=30)]
LEAK = 1.1  # change of a mass by a flow beside the nozzle, over that flow's share
# Of nozzle and seat flow, over that of the level: by the pressures' common gain, and by the density.
WEAR_BY_GAIN, WEAR_BY_DENSITY = 0.5, 0.5
_GEOMETRY = ("line_diameter_percent", "line_length_percent", "parallel_flow_percent")


class Accuracy(Section):
    """Accuracy of an injector file, one sigma each; the defaults are those of a workshop that knows its parts."""

    line_diameter_percent: Percent = 1.0
    line_length_percent: Percent = 0.5
    fuel_density_percent: Percent = 0.5
    parallel_flow_percent: Percent = 0.2  # that leaves the line beside the open nozzle, over the injected one
    control_flow_percent: Percent = 10.0  # of a servo injector: its difference while the needle is open
    mass_percent: Percent | None = None  # of the level, where masses were measured, in place of geometry and gains

    @model_validator(mode="after")
    def _stated_once(self) -> Self:
        if self.mass_percent is not None and (both := self.model_fields_set.intersection(_GEOMETRY)):
            raise ValueError(f"'mass_percent' stands in place of {', '.join(sorted(both))}; leave out either")
        return self


EXACT_PARAMETERS = Accuracy(**{name: 0.0 for name in Accuracy.model_fields if name != "mass_percent"})
"""Accuracy of an injector file that is right, as that of a simulation."""


@dataclass(frozen=True)
class StatedAccuracy:
    """Accuracies of the pressure sensors' gains, and of what the injector file states: shares, one sigma."""

    line_sensor: float = 0.0
    rail_sensor: float = 0.0
    line_diameter: float = 0.0
    line_length: float = 0.0
    fuel_density: float = 0.0
    parallel_flow: float = 0.0
    measured: float | None = None  # of the level, by measured masses; None: none was
    control_flow: float = 0.0
    event_control_flow: float = 0.0  # of an event: as far as its control flow is unknown

    @classmethod
    def of(cls, line_percent: float, rail_percent: float, stated: Accuracy) -> "StatedAccuracy":
        """What the accuracies of the pressure sensors and of an injector file say."""
        shares: dict[str, Any] = {name.removesuffix("_percent"): each and 0.01 * each for name, each in stated}
        return cls(0.01 * line_percent, 0.01 * rail_percent, measured=shares.pop("mass"), **shares)

    def of_event(self, controlled: float) -> "StatedAccuracy":
        """Accuracy of an event whose control flow is this share of the injected volume."""
        return replace(self, event_control_flow=self.control_flow * controlled)

    @property
    def gain(self) -> float:
        """Share by which the line sensor's gain over the rail's is known; it is learned."""
        return math.hypot(self.line_sensor, self.rail_sensor)

    @property
    def rail_share(self) -> float:
        """Share of the learned gain that is the rail sensor's: sigma_rail^2 / (sigma_rail^2 + sigma_line^2)."""
        return (self.rail_sensor / self.gain) ** 2 if self.gain else 0.0

    def level(self, gain: float) -> float:
        """Factor on flows, which are reckoned in the rail sensor's units, where the learned gain is known."""
        return 1.0 + self.rail_share * gain

    @property
    def common_gain(self) -> float:
        """Share by which the gain that both sensors have in common is known; no signal shows it."""
        return self.line_sensor * self.rail_sensor / self.gain if self.gain else 0.0

    @property
    def line(self) -> float:
        """Share by which a flow is known as far as it follows from the line's inertance."""
        return math.hypot(2.0 * self.line_diameter, self.line_length)

    @property
    def mass(self) -> float:
        """Share by which every mass is known, as stated where masses were measured; constant but for control flow."""
        if self.measured is not None:
            return self.measured
        return math.hypot(self.common_gain, self.line, LEAK * self.parallel_flow, self.event_control_flow)

    @property
    def rate(self) -> float:
        """Share by which rate and volume are known."""
        return math.hypot(self.mass, self.fuel_density)

    @property
    def wear(self) -> float:
        """Share by which flows of nozzle and seat over those of a new part are known."""
        if self.measured is not None:
            return self.measured
        by_fuel = WEAR_BY_GAIN * self.common_gain, WEAR_BY_DENSITY * self.fuel_density
        return math.hypot(*by_fuel, self.line, self.parallel_flow)

    @property
    def is_calibrated(self) -> bool:
        """Whether a measured mass fixed the level, or there is nothing to fix."""
        return self.measured is not None or self.mass == 0.0

    @property
    def bound_pct(self) -> float:
        """Half width of the level's 95 % interval [%]."""
        return 196.0 * self.mass

    def as_text(self) -> str:
        """The level with its 95 % bound; empty where nothing is unknown."""
        if self.mass == 0.0:
            return ""
        return f"level ±{self.bound_pct:.1f} %, {'calibrated' if self.is_calibrated else 'not calibrated'}"


EXACT = StatedAccuracy()
"""Accuracy of results where sensors and injector file are right."""
