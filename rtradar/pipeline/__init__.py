"""The whole chain: a recording in, maps and clouds out, streamed; and several echo models side by side."""

from rtradar.pipeline.chain import Result, run
from rtradar.pipeline.clouds_alone import clouds_of
from rtradar.pipeline.compare import Comparison, compare

__all__ = ["Comparison", "Result", "clouds_of", "compare", "run"]
