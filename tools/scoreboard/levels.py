"""Protection levels: how often the error is larger than the level that goes with the estimate, while a sensor lies."""

from __future__ import annotations

import numpy as np

from tools.scoreboard.bands import mean_share
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.judging import places
from tools.scoreboard.plants import VELOCITY, plant_of, sensed
from tools.scoreboard.watching import Listener, assembled, readings_of

NOISE, STEPS, ONSET = 0.1, 20_050, 50
PROMISED = 1e-3
SIZES = (0.0, 1.0, 2.0, 4.0, 8.0)
"""Of one sensor's bias, in deviations of its noise; nothing is excluded, so that the level alone has to hold."""


def levels_part(effort: Effort) -> Result:
    """Share of samples whose error exceeds the level, by the size of the lie; the worst is the row."""
    protect = {"protect": ["position"], "protect_outside": PROMISED}
    config = sensed(VELOCITY, {f"y{k}": NOISE for k in (1, 2, 3)}, 36_000.0, **protect)
    assembly, plant = assembled(config), plant_of(config)
    engine, rng, result = assembly.engine(), np.random.default_rng(9000), Result()
    runs = effort.runs(100, 2)
    engine._judge = Listener()  # type: ignore[assignment]
    bands = []
    for size in SIZES:
        shares = []
        for _ in range(runs):
            z, states = plant.run(rng, 1, STEPS)
            z[:, ONSET:, 1] += size * NOISE
            engine.reset()
            steps, _ = places(assembly, engine.process(readings_of(assembly, z)[0]))
            error = np.abs(steps["x"][:, 0] - states[0, :, 0])
            outside = error > steps["protection"].reshape(len(error), -1)[:, 0]
            shares.append(float(np.mean(outside[ONSET:])))
        bands.append(mean_share(shares))
    samples = runs * (STEPS - ONSET)
    worst = max(bands, key=lambda band: band.value)
    told = f"error outside the protection level, promised {PROMISED}, worst of biases "
    told += f"{', '.join(f'{size:.0f}' for size in SIZES)} sigma that are never excluded; {worst.value:.2e} "
    told += (
        f"({worst.low:.2e} to {worst.high:.2e}) of {samples:,} samples each, {samples * len(SIZES):,} in all"
    )
    ratio = worst.value / PROMISED
    result.rows.append(
        Row("9.level", told, worst.value, "of samples", "the promise", ratio, "<= 1", worst.low <= PROMISED)
    )
    result.curves["levels"] = {"size": list(SIZES), "outside": [band.value for band in bands]}
    return result
