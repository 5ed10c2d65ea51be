"""The identification gain l of (5): between what the line does and what the samples show."""

from observer_rt.estimation.gain import NoiseLevels
from observer_rt.foundation.errors import UserError
from observer_rt.model.coefficients import Coefficients

WELL_ABOVE = 4.0  # times the line mode, below which the target of phi is mostly the fault's derivative
ROUNDING = 1e-9  # a sample rate may be known as the inverse of an interval
LARGEST_NOISE = 0.1  # of the nozzle flow at p_0, the noise of one sample of the target


def check_gain(place: str, gain: float, c: Coefficients, sample_rate: float) -> None:
    """Refuse a gain l [1/s] that cannot identify anything at `sample_rate` [Hz].

    L l e~ is the fault through l s / (s^2 + l s + w^2), w the line mode: a high pass that only a gain well above w
    moves out of the way. Above the sample rate there is nothing between two samples for x~ to follow.
    Raises `UserError` naming `place`.
    """
    lowest = WELL_ABOVE * c.line.mode
    if gain <= c.line.mode:
        raise UserError(
            place,
            f"{gain:g} 1/s is not above the line's own {c.line.mode:.0f} rad/s: x~ would follow the fault",
            f"give {lowest:.2g} to {sample_rate:g} 1/s"
            if lowest < sample_rate
            else f"sample at {lowest:.2g} Hz or more, and give a gain up to that",
        )
    if gain > sample_rate * (1.0 + ROUNDING):
        raise UserError(
            place,
            f"{gain:g} 1/s is faster than the samples, {sample_rate:g} Hz",
            f"give at most {sample_rate:g} 1/s, or sample faster",
        )


def doubts_about_gain(gain: float, c: Coefficients, noise: NoiseLevels) -> str | None:
    """What speaks against an admissible gain l [1/s], None when nothing does."""
    if gain < WELL_ABOVE * c.line.mode:
        return (
            f"only {gain / c.line.mode:.2g} times the line's own {c.line.mode:.0f} rad/s: "
            "the target of phi is mostly the derivative of the fault"
        )
    share = gain * noise.line_pressure / c.pressure_scale / c.line.a2_nozzle
    if share > LARGEST_NOISE:
        return f"a sample of the target of phi has noise of {share:.0%} of the nozzle flow"
    return None
