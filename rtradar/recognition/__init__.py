"""Recognition of activities with weights that come with the package; NumPy alone runs them.

They have learnt from synthetic actors only. `rtradar.classify` trains others, and exports such
weights.
"""

from rtradar.recognition.predict import predict_run
from rtradar.recognition.recogniser import Recogniser

__all__ = ["Recogniser", "predict_run"]
