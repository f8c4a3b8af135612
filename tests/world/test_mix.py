"""Traffic keeps its mix, also where the roads are crowded and long vehicles find little room."""

import numpy as np
import pytest

from rudc.world.scene import Kind
from tests.plans import PlanSource, event


def test_those_who_enter_have_the_shares_of_the_mix(world):
    """Cars took the room that was too short for a truck, so that of those who entered later 4 of 10 were
    trucks instead of 7.5.
    """
    source = PlanSource(
        density=10.0, mix={"truck": 0.75, "car": 0.25}, origin="west", turn="straight",
        events=(event("density_surge", density=45.0),),
    )  # fmt: skip
    kinds: dict[tuple[int, str], int] = {}
    for seed in range(4):
        scene = world.reset(source.plan(seed), ego_driver="sumo")
        first = set(scene.ids)
        for _ in range(250):
            world.advance(np.zeros(2))
            scene = world.scene()
            kinds |= {
                (seed, name): int(kind) for name, kind in zip(scene.ids, scene.kind, strict=True)
                if name not in first
            }  # fmt: skip
    trucks = np.mean([kind == Kind.TRUCK for kind in kinds.values()])
    assert len(kinds) > 40
    assert trucks == pytest.approx(0.75, abs=0.12)
