"""What a fit says in sentences: level, verdict, what to try."""

from observer_rt.estimation.phases import Phase
from observer_rt.fit.calibrate import GATE, Calibrated, FlowLevel
from observer_rt.fit.suitability import WORTH_A_WORD, share_between_samples

_SEAT = "check the lift's calibration and the seat's geometry, and run `discover` on these recordings"
_TRY = {
    Phase.STANDSTILL: "with the needle shut there is more than white noise: give the line pressure as "
    "it was sampled, not smoothed, interpolated or resampled; else look for an offset that drifts",
    Phase.OPENING: _SEAT,
    Phase.OPEN: "check the chamber pressure, and run `discover` on these recordings: cavitation, or a coefficient "
    "of the seat that depends on the lift, shows here",
    Phase.CLOSING: _SEAT,
    Phase.AFTER: "the line rings otherwise than any structure tried (friction that depends on frequency is in none): "
    "check line.length, and where along the line the pressure is measured",
}
_FOREIGN = 500.0  # chi2 that no wrong number of the file leaves
_OF_FOREIGN = (
    "most probably the signals do not belong together: a lift that is later or earlier than the pressures (another "
    "clock, a delay of its channel; 0.1 ms does this), or a line pressure of another place, or of the wrong sign; "
    "compare them in --plot. Lengths and diameters wrong by less than a factor of two are not the cause: the fit "
    "makes up for them"
)
_OF_INSTANTS = "; if samples are means over the sample period, state it (warning above)"
_FITTED = "; line.diameter stands for A_L/(rho_L L_L) and was fitted with it"


def phase_name(phase: Phase) -> str:
    """In lower case."""
    return phase.name.lower()


def level_words(done: Calibrated) -> str:
    """What the absolute level of flow rests on."""
    if done.level is FlowLevel.RATE:
        return f"fixed by the measured injection rate{_FITTED}"
    if done.level is FlowLevel.MASS:
        return f"fixed by the measured masses{_FITTED}"
    return (
        "rests one to one on A_L/(rho_L L_L) of the file (line.diameter, line.length, fluid.density_line): pressures "
        "alone do not tell it. If that is 5 % too large, so are all masses and the fitted alpha_H, alpha_S, V_S and "
        "V_L/K_L. A measured rate (column injection_rate) or one measured mass (--mass) fixes it"
    )


def kept_words(done: Calibrated) -> list[str]:
    """Of each parameter that stays as in the file."""
    return [
        f"{one.name} ({one.symbol}) stays {one.of(done.injector) / one.si:.4g} {one.unit}: "
        "these recordings do not tell it"
        for one in done.kept
    ]


def verdict_words(done: Calibrated) -> str:
    """Adequate or not, where, and what to try."""
    left = done.left
    if not done.inadequate:
        return (
            f"adequate: chi2 at most {left.chi2[left.worst]:.2f} ({phase_name(left.worst)}; limit {GATE:g})"
        )
    where = ", ".join(f"{phase_name(phase)} {left.chi2[phase]:.3g}" for phase in done.inadequate)
    return f"INADEQUATE: chi2 above {GATE:g} in {where}. To try: {_to_try(done)}"


def _to_try(done: Calibrated) -> str:
    """By the most probable cause."""
    worst = done.inadequate[0]
    if done.left.chi2[worst] > _FOREIGN:
        return _OF_FOREIGN
    if Phase.STANDSTILL in done.inadequate:
        return _TRY[Phase.STANDSTILL]
    slow = max(map(share_between_samples, done.found)) > WORTH_A_WORD
    return _TRY[worst] + (_OF_INSTANTS if slow else "")


def oddities(done: Calibrated) -> list[str]:
    """Fitted numbers that physics does not allow, or that lie at the end of what was tried."""
    result = []
    for one in done.fitted.calibration.free:
        value = one.of(done.injector)
        if one.key == "flow_coefficient" and value > 1.0:
            result.append(
                f"{one.name} = {value:.3f} is above 1: an area of the file is too small, or A_L/(rho_L L_L) too large"
            )
        if value < 1.01 * one.lowest or value > 0.99 * one.highest:
            result.append(f"{one.name} = {value / one.si:.4g} {one.unit} is at the end of the range tried")
    return result
