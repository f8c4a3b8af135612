"""Whether stored weights are those of a configuration: names, shapes, types, finite. Nothing is built."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from rudc.learning.config import EnsembleConfig, LearnerConfig, Problem
from rudc.learning.parameters import group, shapes, without_bias

Shape = tuple[int, ...]


def misfits(config: LearnerConfig, problem: Problem, arrays: Mapping[str, NDArray]) -> Iterator[str]:
    """What is wrong with weights named as in `Learner.weights`, a few words each."""
    for name, value in arrays.items():
        if value.dtype != np.float32:
            yield f"{name} is {value.dtype}, not float32"
        elif not np.all(np.isfinite(value)):
            yield f"{name} is not finite"
    ensemble = config if isinstance(config, EnsembleConfig) else None
    for name, (network, outputs) in config.observers(problem.actions).items():
        maps = shapes(problem.layout, network, 0, outputs)
        yield from _unlike(name, maps, 1, outputs, group(arrays, name))
    for name in ("critic", "cost"):
        found = group(arrays, name)
        if not found and not (ensemble and name == "critic") and name not in config.offers:
            continue
        maps = shapes(problem.layout, config.critic, problem.actions, 1)
        if ensemble and name == "critic":
            yield from _unlike(name, maps, ensemble.members, ensemble.quantiles, found)
        else:  # how many there are, and what they say, is their algorithm's own
            out = found.get("out.bias")
            members, outputs = (out.shape[0], out.shape[-1]) if out is not None and out.ndim == 3 else (1, 1)
            yield from _unlike(name, maps, members, outputs, found)
    normal = group(arrays, "normal")
    if normal and ensemble:
        wanted: dict[str, Shape] = {"rms": (ensemble.members, 1, 1)}
        yield from _compared("normal", wanted, normal)
        if "rms" in normal and not np.all(normal["rms"] > 0):
            yield "normal/rms is not positive"


def _unlike(
    name: str, maps: Mapping[str, tuple[int, int]], members: int, outputs: int, found: Mapping[str, NDArray]
) -> Iterator[str]:
    """How a stack of networks differs from what its configuration says."""
    wanted: dict[str, Shape] = {}
    for each, (inputs, width) in maps.items():
        width = outputs if each == "out" else width
        wanted[f"{each}.weight"] = members, inputs, width
        if not without_bias(each):
            wanted[f"{each}.bias"] = members, 1, width
    yield from _compared(name, wanted, found)


def _compared(name: str, wanted: Mapping[str, Shape], found: Mapping[str, NDArray]) -> Iterator[str]:
    for key, shape in wanted.items():
        if key not in found:
            yield f"{name}/{key} is missing"
        elif found[key].shape != shape:
            yield f"{name}/{key} has the shape {found[key].shape}, not {shape}"
    for key in found:
        if key not in wanted:
            yield f"{name}/{key} is not of this configuration"
