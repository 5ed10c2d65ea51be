"""What there is one of in an observer, by owner: core/stream/state.pxd says who writes what, and what it is."""

from typing import Any

import numpy as np

from observer_rt.engine.stream.verdict import CARRIED
from observer_rt.model.network import ARGUMENTS, HIDDEN

_NUMBER, _VALUE, _FLAG, _CODE = np.int64, np.float64, np.bool_, np.int8


def _record(**fields: Any) -> np.dtype[np.void]:
    return np.dtype(list(fields.items()), align=True)


_DIFFERENCES = _record(count=_NUMBER, rail_squares=_VALUE, line_squares=_VALUE)

STANDSTILL = _record(rest_count=_NUMBER, offset_sum=_VALUE, differences=_DIFFERENCES)
"""What the closed needle has told so far."""

RESTING_LIFT = _record(
    zero=_VALUE, quick_squares=_VALUE, crosstalk=_VALUE, lift_count=_NUMBER, lift_variance=_VALUE
)
"""What the lift shows of a shut needle."""

MEMORY = _record(
    positions=_record(
        recorded=_NUMBER,
        given_on=_NUMBER,
        unbroken_since=_NUMBER,
        received=_NUMBER,
        interpolated=_NUMBER,
        inspected=_NUMBER,
        processed=_NUMBER,
        newest_break=_NUMBER,
        segment_start=_NUMBER,
    ),
    mode=_record(draining=_FLAG, waits_for_verdicts=_FLAG),
    prior=_record(hidden=(_VALUE, (HIDDEN, ARGUMENTS)), healthy_variance=_VALUE, stated_noise=(_VALUE, (3,))),
    in_force=CARRIED,
    innovation_noise=_record(sigma=_VALUE, weight=_VALUE),
    operating_point=_record(in_learned_range=_FLAG, sac_flow=_VALUE, line_flow=_VALUE),
    judgement=_record(
        reason=_CODE,
        untested=_NUMBER,
        events_judged=_NUMBER,
        doubtful_events=_NUMBER,
        events_taken=_NUMBER,
        waiting=_FLAG,
        halted_in=_NUMBER,
        phi_version=_NUMBER,
        offset_moves=_FLAG,
    ),
    pair=_record(offset=_VALUE, since_start=_NUMBER),
    monitor=_record(
        normalised_innovation_squared=_VALUE,
        contradicted=_FLAG,
        alarm_at_standstill=_FLAG,
        calm=_NUMBER,
        contradicted_in=_NUMBER,
        lowest_line=_VALUE,
        falls=_NUMBER,
    ),
    synchronisation=_record(
        synchronised=_FLAG,
        unsynchronised_by=_CODE,
        closed_since_start=_NUMBER,
        rested=_NUMBER,
        numerical_resets=_NUMBER,
    ),
    needle=_record(is_open=_FLAG, shut_since=_NUMBER, opening=_NUMBER),
    event=_record(in_event=_FLAG, number=_NUMBER, opening=_NUMBER, learnable=_FLAG, fault=_CODE),
    counts=_record(events_closed=_NUMBER, injections_begun=_NUMBER, injections_reported=_NUMBER),
    ramp=_record(foot=_NUMBER, foot_lift=_VALUE, rise=_VALUE, sinking_lift=_VALUE, fall=_VALUE),
    dead_band=_record(lift_on=_VALUE, lift_off=_VALUE),
    resting_lift=RESTING_LIFT,
    lift_zero=_record(
        lifted=_NUMBER,
        count=_NUMBER,
        mean=_VALUE,
        near=_VALUE,
        behind=_VALUE,
        moves=_VALUE,
        slope=_VALUE,
        followed=_NUMBER,
        spread=_VALUE,
        variance_lately=_VALUE,
    ),
    crosstalk=_record(
        line_mean=_VALUE,
        count=_NUMBER,
        swing_squares=_VALUE,
        swing_lifts=_VALUE,
        squares_lately=_VALUE,
        lifts_lately=_VALUE,
    ),
    stop=_record(level=_VALUE, level_count=_NUMBER, highest=_VALUE, lift=_VALUE, openings=_NUMBER),
    lift_step=_record(
        quick=_VALUE,
        quick_limit=_VALUE,
        quiet=_NUMBER,
        stepped=_NUMBER,
        before_step=_VALUE,
        summit=_VALUE,
    ),
    standstill=STANDSTILL,
    rest=_record(run=_NUMBER, highest_line=_VALUE, at_highest=_NUMBER, before=_DIFFERENCES),
    outliers=_record(accepted_innovation=_VALUE, leaping=_NUMBER, spikes=_NUMBER, bridged=_NUMBER),
    input_fault=_CODE,
)
