/* The injector alone, from sample to sample. */
#include "injector.h"

#include "sensor.h"

void inj_injector_init(Injector *injector, real_t rail_pressure)
{
    const real_t rail = (rail_pressure - CHAMBER_PRESSURE) / PRESSURE_SCALE;
    for (uint32_t i = 0U; i < STATES; ++i) {
        injector->x[i] = R(0.0);
    }
    inj_line_at_rest(injector->x, rail);
    injector->indicated = rail;
    for (uint32_t i = 0U; i <= RECORDED_LATE; ++i) {
        injector->shown_before[i] = rail;
    }
    injector->steps = 0U;
    injector->before.rail = rail;
    injector->before.area = R(0.0);
    inj_forcing_init(&injector->forcing);
}

void inj_injector_step(Injector *injector, real_t rail_pressure, real_t needle_lift, InjectorOutput *output)
{
    const real_t before = injector->x[P_LINE];
    const real_t indicated_before = injector->indicated;
    Interval interval;
    Forced forced;
    interval.start = injector->before;
    interval.end.rail = (rail_pressure - CHAMBER_PRESSURE) / PRESSURE_SCALE;
    interval.end.area = inj_seat_opened(needle_lift);
    injector->before = interval.end;
    inj_under_laws(injector->x, &interval, &injector->forcing, &forced);
    inj_advance(injector->x, &forced.interval, &forced.model);
    injector->indicated = indicated_after(indicated_before, before, injector->x[P_LINE]);
    injector->shown_before[injector->steps] =
        inj_shown_under_laws(recorded_of(indicated_before, injector->indicated), &injector->forcing);
    injector->steps = (injector->steps + 1U) % (RECORDED_LATE + 1U); /* from here on that of the oldest */
    forced.interval.end.area = r_max(forced.interval.end.area, R(0.0));
    output->injection_rate = inj_injection_rate(injector->x, forced.interval.end, &forced.model);
    output->line_pressure = injector->x[P_LINE] * PRESSURE_SCALE + CHAMBER_PRESSURE;
    output->line_flow = injector->x[Q_LINE] * FLOW_SCALE;
    output->sac_pressure = injector->x[P_SAC] * PRESSURE_SCALE + CHAMBER_PRESSURE;
    output->recorded_line_pressure =
        (injector->shown_before[injector->steps] + SENSOR_OFFSET) * PRESSURE_SCALE + CHAMBER_PRESSURE;
}
