"""The gap finder on a log that is sampled much faster than its band: read at all samples, and at
those that the band needs, in turns on one core.
"""

import tempfile
from pathlib import Path
from unittest.mock import patch

from common import arguments, in_turns, machine, pin_to_one_core, report

pin_to_one_core()

import gap
import jax
import numpy as np

from jaxidl.gap import diagnose
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import Signals, prepare
from jaxidl.systems.mjcf import read_model

gap.DURATION, gap.DT = 20.0, 1e-3


def main() -> None:
    options = arguments(__doc__ or "", rounds=1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.xml"
        path.write_text(gap.arm())
        model = read_model(path)
        moved = gap.moved(gap.arm())
        log = from_arrays(moved["time"], moved["q"], moved["tau"])
        with jax.enable_x64(True):
            signals = prepare(log, model.plant.body)
        found = {}

        def thinned() -> None:
            found["thinned"] = diagnose(log, model, rollouts=False)

        def every_sample() -> None:
            with patch.object(Signals, "thinned", lambda self: self):
                found["every sample"] = diagnose(log, model, rollouts=False)

        seconds = in_turns({"every sample": every_sample, "thinned": thinned}, options.rounds)
    rows = [
        {
            "instants": name,
            "number": len(signals.q) // (signals.every if name == "thinned" else 1),
            "time [s]": float(np.median(seconds[name])),
            "ratio": float(np.median(seconds["every sample"] / seconds[name])),
            "named": sum(f.confidence >= 0.8 for f in found[name].findings),
        }
        for name in seconds
    ]
    title = f"seven joints, 20 s at 1 kHz, band {signals.band:.0f} Hz"
    report(title, rows, options.json, machine=machine())


if __name__ == "__main__":
    main()
