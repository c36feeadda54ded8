"""The part that both sides of the step benchmark share: timed blocks on request."""

import gc
import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

WARM_UP = 500
"""Steps before the first timed one."""


def load_scenario() -> dict[str, Any]:
    """Read the scenario whose path is the only argument; the numbers as arrays."""
    scenario = json.loads(Path(sys.argv[1]).read_text(encoding='utf-8'))
    return {
        key: np.array(value) if key in ('path', 'goal', 'posture') else value
        for key, value in scenario.items()
    }


def serve(variants: Mapping[str, Callable[[Any], object]], path: Any) -> None:
    """Answer every line ``variant start stop`` with the durations [ns] of those steps.

    Parameters
    ----------
    variants
        By name, what one step does with a configuration (n,).
    path
        Configurations (m, n).
    """
    gc.disable()
    for step in variants.values():
        for q in path[:WARM_UP]:
            step(q)
    print('ready', flush=True)
    for line in sys.stdin:
        variant, start, stop = line.rsplit(maxsplit=2)
        step = variants[variant]
        durations = []
        for q in path[int(start) : int(stop)]:
            before = time.perf_counter_ns()
            step(q)
            durations.append(time.perf_counter_ns() - before)
        gc.collect()
        print(json.dumps(durations), flush=True)
