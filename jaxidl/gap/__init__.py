"""Find what a simulation is missing: ``jaxidl.gap.diagnose(log, model) -> Diagnosis``."""

from jaxidl.gap.fit.refine import Refinement
from jaxidl.gap.inputs import read_inputs
from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.gap.workflow import diagnose
from jaxidl.logs.log import Log, from_arrays, read
from jaxidl.systems.mjcf import Model, read_model

__all__ = [
    "Diagnosis",
    "Log",
    "Model",
    "Refinement",
    "diagnose",
    "from_arrays",
    "read",
    "read_inputs",
    "read_model",
]
