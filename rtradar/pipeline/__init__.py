"""The whole chain, streamed: a recording in, maps and clouds out, by one echo model or several."""

from rtradar.pipeline.compare import Comparison, compare
from rtradar.pipeline.result import Result
from rtradar.pipeline.run import clouds_of, run

__all__ = ["Comparison", "Result", "clouds_of", "compare", "run"]
