"""The whole chain: a recording in, maps and clouds out, streamed."""

from rtradar.pipeline.chain import Result, run

__all__ = ["Result", "run"]
