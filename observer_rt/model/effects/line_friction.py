"""Feed line with deposits, or a clogged filter."""

from observer_rt.model.effect import Effect, Place, parameter, scaled

EFFECT = Effect(
    id="line_friction",
    place=Place.LINE_FLOW,
    parameters=(parameter("k", -0.95, 10.0, 0.005, (0.0, 2.0)),),
    apply=scaled("line", "loss_factor"),
    sentence=(
        "The feed line loses more pressure to its flow (deposits, a clogged filter), or less: xi (1 + k)."
    ),
    signature=(
        "The line pressure sags more as the flow through the line grows, and its ringing after the "
        "injection dies sooner."
    ),
)
