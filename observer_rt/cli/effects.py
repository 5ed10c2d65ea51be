"""The command `effects`."""

from observer_rt.cli.options import EffectsOption


def effects(effects: EffectsOption = None) -> None:
    """List the effects a model can have, their parameters and bounds; check those of your own."""
    from observer_rt.model.effects import VOCABULARY

    for effect in VOCABULARY.values():
        print(f"{effect.id}: {effect.sentence}")
        for p in effect.parameters:
            print(f"    {p.name} = {p.lowest / p.si:g} to {p.highest / p.si:g} {p.unit}")
