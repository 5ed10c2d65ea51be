"""Parameters of an injector, as in `injector.toml`: in SI units, validated and immutable.

`Departures` hold what an injector may do beyond (19)-(23), which have no parameter for it. Densities and bulk moduli
are those without pressure; `model.fuel` has what pressure makes of them, `model.surroundings` what temperature does.
"""

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, NamedTuple

from pydantic import AfterValidator, BeforeValidator, Field

from observer_rt.core.model.needle import NeedleLaw
from observer_rt.foundation.documents import Section
from observer_rt.model.accuracy import Accuracy
from observer_rt.model.baseline import Baseline, Remainder
from observer_rt.model.fuel import Compressibility
from observer_rt.model.terms.in_force import TermInForce

FORMAT = 1  # of `injector.toml`; raised when an older program would misread a newer file
WAVE_LINES = ("wave", "wave_two_part")  # in which pressure travels; in two parts where impedances differ
LINE_MODELS = ["lump", *WAVE_LINES]
FEWEST_CELLS, MOST_CELLS = 4, 64  # of those in which pressure travels

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
ValveTime = Annotated[float, Field(ge=-0.5e-3, le=1e-3)]  # s
Area = Annotated[float, Field(ge=-1e-5, le=1e-4)]  # m2, of either sign
Temperature = Annotated[float, Field(ge=200, le=500)]  # K; what is given in degC is refused


def _known_line(name: str) -> str:
    if name not in LINE_MODELS:
        raise ValueError(f"there is no such line; known are {', '.join(sorted(LINE_MODELS))}")
    return name


class UnitName(str):
    """Unit of a parameter, among the annotations of its field."""


class LineOutflow(StrEnum):
    """Flow that drains the line in (20): the paper's Q_H, or Q_S as mass conservation demands."""

    NOZZLE = "nozzle"
    SEAT = "seat"


class Fluid(Section):
    fuel: str | None = None  # of data/fuels.toml, whose values the keys have that a file leaves out
    density_line: Annotated[Positive, UnitName("kg/m3")]  # rho_L
    density_nozzle: Annotated[Positive, UnitName("kg/m3")]  # rho_C
    bulk_modulus_line: Annotated[Positive, UnitName("Pa")]  # K_L, or K_0 of it where K_1 is not 0
    bulk_modulus_sac: Annotated[Positive, UnitName("Pa")]  # K_C, likewise
    bulk_modulus_by_pressure: Annotated[float, Field(ge=0, le=20)] = 0.0  # K_1, -
    vapour_pressure: Annotated[NonNegative, UnitName("Pa")]  # p_v
    # needed only on a bench that measures the temperature of the fuel
    reference_temperature: Annotated[Temperature | None, UnitName("K")] = None  # T_0 of the values above
    thermal_expansion: Annotated[float, Field(ge=0, le=2e-3), UnitName("1/K")] = 7e-4  # alpha
    bulk_modulus_slope: Annotated[float, Field(ge=-30e6, le=0), UnitName("Pa/K")] = -7e6  # dK/dT

    @property
    def in_line(self) -> Compressibility:
        """How the fuel in the line yields to pressure."""
        return Compressibility(self.bulk_modulus_line, self.bulk_modulus_by_pressure)

    @property
    def in_sac(self) -> Compressibility:
        """How the fuel in sac and nozzle does."""
        return Compressibility(self.bulk_modulus_sac, self.bulk_modulus_by_pressure)


class LineParameters(Section):
    length: Annotated[Positive, UnitName("m")]  # L_L
    diameter: Annotated[Positive, UnitName("m")]
    volume: Annotated[Positive, UnitName("m3")]  # V_L
    loss_factor: NonNegative  # xi, -
    model: Annotated[str, AfterValidator(_known_line)] = "lump"
    # of a line in which pressure travels, see `line.wave`
    cells: Annotated[int, Field(ge=FEWEST_CELLS, le=MOST_CELLS)] | None = None  # None: by the speed of sound
    damping: Annotated[NonNegative | None, UnitName("m2/s")] = None  # nu
    end_volume: Annotated[NonNegative | None, UnitName("m3")] = None  # of the injector's body
    wall_viscosity: Annotated[NonNegative | None, UnitName("m2/s")] = None  # nu_w, of friction that remembers
    inlet_loss_factor: NonNegative | None = None  # xi_I of a throttle between rail and line, -
    impedance_ratio: Annotated[float, Field(ge=0.2, le=5.0)] | None = None  # injector's part over the rail's
    impedance_step: Annotated[float, Field(ge=0.1, le=0.9)] | None = None  # its place from the rail, or 0.5
    # of a servo injector, see `model.hydraulics`; each None means that the injector has none of it
    control_flow: Annotated[NonNegative | None, UnitName("m3/s")] = None  # c, of the pilot valve at 100 MPa
    # before the needle leaves its seat, at 100 MPa
    control_start: Annotated[ValveTime | None, UnitName("s")] = None
    control_end: Annotated[ValveTime | None, UnitName("s")] = None  # before it begins to fall
    control_hold: Annotated[float, Field(ge=-1, le=1)] | None = None  # h, while the needle is at its stop
    # n, of both times by the rail pressure
    control_exponent: Annotated[float, Field(ge=-2, le=2)] | None = None
    control_edge: Annotated[Annotated[float, Field(ge=1e-6, le=1e-3)] | None, UnitName("s")] = None  # half width
    control_displacement: Annotated[Area | None, UnitName("m2")] = None  # A_c, of the needle's end in its chamber
    displacement: Annotated[Area | None, UnitName("m2")] = None  # A_d, of the needle at the line's end

    @property
    def area(self) -> float:
        """Cross-section A_L, m2."""
        return math.pi / 4 * self.diameter**2


class SeatParameters(Section):
    flow_coefficient: Positive  # alpha_S, -
    diameter: Annotated[Positive, UnitName("m")]  # d_S
    cone_angle: Annotated[float, Field(gt=0, lt=180), UnitName("deg")]  # full angle
    max_lift: Annotated[Positive, UnitName("m")]


class NozzleParameters(Section):
    flow_coefficient: Positive  # alpha_H at a difference of 100 MPa, -
    coefficient_by_pressure: Annotated[float, Field(ge=-0.3, le=0.3)] = 0.0  # k_H, share of alpha_H per 100 MPa
    holes: Annotated[int, Field(ge=1)]
    hole_diameter: Annotated[Positive, UnitName("m")]
    sac_volume: Annotated[Positive, UnitName("m3")]  # V_S

    @property
    def area(self) -> float:
        """Cross-section of all holes A_H, m2."""
        return self.holes * math.pi / 4 * self.hole_diameter**2


class Chamber(Section):
    pressure: Annotated[NonNegative, UnitName("Pa")]  # p_C


class Scaling(Section):
    pressure: Annotated[Positive, UnitName("Pa")] = 1.0e8  # p_0
    flow: Annotated[Positive, UnitName("m3/s")] = 6.0e-5  # Q_0
    area: Annotated[Positive, UnitName("m2")] = 7.0e-7  # A_0


class Needle(Section):
    """Energizing time -> lift: for simulation, and where the lift is not measured."""

    opening_delay: Annotated[NonNegative, UnitName("s")]
    opening_speed: Annotated[Positive, UnitName("m/s")]  # at 100 MPa, ~ rail pressure ^ 0.4
    closing_delay: Annotated[NonNegative, UnitName("s")]
    closing_speed: Annotated[Positive, UnitName("m/s")]  # at 100 MPa, ~ rail pressure ^ 0.3
    landing_bounce: Annotated[NonNegative, UnitName("m")] = 0.0  # to which it lifts once more ..
    bounce_length: Annotated[Positive, UnitName("s")] = 0.09e-3  # .. from landing on
    # n: the opening delay goes as (rail pressure / 100 MPa)^-n
    delay_exponent: Annotated[float, Field(ge=-2, le=2)] = 0.0


class EffectValue(Section):
    """A parameter of an effect, in the unit named; without an interval where nobody estimated it."""

    value: Finite
    ci95: tuple[Finite, Finite] | None = None
    unit: str


class EffectInForce(Section):
    """An effect added to the nominal model, because `discover` found it or somebody knows it of this injector."""

    id: str
    parameters: Mapping[str, EffectValue] = {}
    origin: str = ""
    evidence: str = ""
    date: Annotated[str, BeforeValidator(str)] = ""  # TOML has dates of its own

    @property
    def words(self) -> str:
        """Identifier and sizes in one line, such as `orifice_area v_H = 0.3`."""
        sizes = (f"{name} = {of.value:g}{f' {of.unit}' * (of.unit != '-')}" for name, of in self.parameters.items())
        return " ".join([self.id, *sizes])


def _known_format(number: int) -> int:
    if number != FORMAT:
        newer = "a later version of observer-rt wrote the file" if number > FORMAT else "there is no such format"
        raise ValueError(f"{newer}; this one reads format {FORMAT}")
    return number


class InjectorParameters(Section):
    """Parameters of one injector and its line (SI units; effects in the units they name)."""

    format: Annotated[int, AfterValidator(_known_format)] = FORMAT
    line_outflow: LineOutflow = LineOutflow.NOZZLE
    effects: tuple[EffectInForce, ...] = ()
    terms: tuple[TermInForce, ...] = ()
    fluid: Fluid
    line: LineParameters
    seat: SeatParameters
    nozzle: NozzleParameters
    chamber: Chamber
    scaling: Scaling = Scaling()
    accuracy: Accuracy = Accuracy()
    needle: Needle
    baseline: Baseline | None = None  # of the healthy injector, where the file was fitted
    remainder: Remainder | None = None  # of terms that were accepted in part

    @property
    def needle_law(self) -> NeedleLaw:
        """How its needle answers commands."""
        return NeedleLaw(**dict(self.needle), stop=self.seat.max_lift)

    @property
    def in_force(self) -> tuple[str, ...]:
        """Effects and terms that are added to the nominal model, in words."""
        return (*(effect.words for effect in self.effects), *(term.words for term in self.terms))


class Departures(NamedTuple):
    """Departures from (19)-(23) in SI units, all off by default."""

    leakage: float = 0.0  # c, m3/(s Pa): p_L' gets -K_L/V_L c (p_L - p_C)
    air: float = 0.0  # g of 1/K_eff = 1/K + g/p, in the line
    stiffness_slope: float = 0.0  # n of K = K_L + n (p_L - 100 MPa), in the line
    critical_excess: float = 0.0  # N_crit - 1: the nozzle cavitates below the cavitation number N_crit
    chamber_rise: float = 0.0  # Pa, of p_C in (23) while the needle is open
    chamber_rise_with_seat: float = 0.0  # Pa, of p_C at full lift, in proportion to the seat's area before
    seat_loss: float = 0.0  # a of alpha_S (1 - a exp(-x_N/x_c))
    seat_loss_lift: float = 50e-6  # x_c, m


NO_DEPARTURES = Departures()
