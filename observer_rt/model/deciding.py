"""Measurements that tell effects apart which recordings of rail pressure, lift and line pressure may not."""

BOTH_CHANNELS = (
    "one signal fed to both pressure channels: a skew shifts it, a lag rounds it; or a higher sample rate"
)
FUEL_OR_DRAWING = (
    "a fuel sample (bulk modulus), or the volume of the line by its drawing: no signal tells them apart"
)
FUEL_DENSITY = "the density of a fuel sample, or the injected mass on a balance"
LIFT_GAUGE = "the lift sensor against a gauge, at the stop and just off the seat"
LIFT_GAUGE_OR_RATE = f"{LIFT_GAUGE}; or the injection rate measured"
LIFT_STEP = "the lift channel's answer to a step at its amplifier's input"
BALLISTIC_RATE = "the injection rate measured, with ballistic injections among them"
BALLISTIC = "more injections too short for the needle to reach its stop, of several durations"
PRESSURE_GAUGE = (
    "standstill at several rail pressures, and both sensors vented (0 MPa) or against a reference gauge"
)
WITH_A_MEASURED_RATE = {LIFT_GAUGE_OR_RATE: LIFT_GAUGE, BALLISTIC_RATE: BALLISTIC}
"""What is left to measure of these where the injection rate was measured."""
