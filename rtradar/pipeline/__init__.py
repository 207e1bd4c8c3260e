"""The whole chain, streamed: a recording in, maps and clouds out, by one echo model or several."""

from rtradar.pipeline.compare import compare, compare_folders, compare_recordings, plan_levels
from rtradar.pipeline.compared import Comparison
from rtradar.pipeline.experiment import Experiment, Sweep, sweep
from rtradar.pipeline.processing import MEMORY_LIMIT_BYTES
from rtradar.pipeline.recorded import process_samples
from rtradar.pipeline.result import Result
from rtradar.pipeline.run import Simulation, run, simulate

__all__ = [
    "MEMORY_LIMIT_BYTES",
    "Comparison",
    "Experiment",
    "Result",
    "Simulation",
    "Sweep",
    "compare",
    "compare_folders",
    "compare_recordings",
    "plan_levels",
    "process_samples",
    "run",
    "simulate",
    "sweep",
]
