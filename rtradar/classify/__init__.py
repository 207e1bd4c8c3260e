"""Classification of activities from point clouds: PointNet, its training and evaluation, baselines.

The package needs the extra ``learn`` (torch, scikit-learn), and says so if that is missing.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from rtradar.errors import InputError

if missing := [
    name
    for package, name in (("torch", "torch"), ("sklearn", "scikit-learn"))
    if find_spec(package) is None
]:
    raise InputError(
        f"the classifier needs {' and '.join(missing)}; "
        "install the extra 'learn' of rtradar, in a checkout: pip install -e '.[learn]'"
    )

if TYPE_CHECKING:
    from rtradar.classify.baselines import evaluate_baselines
    from rtradar.classify.outcomes import Outcome
    from rtradar.classify.pointnet import PointNet
    from rtradar.classify.prepare import stack_clouds, stack_spectrograms
    from rtradar.classify.recipes import LEAN, PAPER, Recipe
    from rtradar.classify.splits import Split, make_splits
    from rtradar.classify.study import Study, load_network, load_study, train_study
    from rtradar.classify.training import Examples, predict, train_network

__all__ = [
    "LEAN",
    "PAPER",
    "Examples",
    "Outcome",
    "PointNet",
    "Recipe",
    "Split",
    "Study",
    "evaluate_baselines",
    "load_network",
    "load_study",
    "make_splits",
    "predict",
    "stack_clouds",
    "stack_spectrograms",
    "train_network",
    "train_study",
]
_MODULES = "recipes splits outcomes prepare pointnet training study baselines"


def __getattr__(name: str) -> Any:
    """Load the modules in turn until one defines the name, as recipes and splits need no torch."""
    for module in _MODULES.split() if name in __all__ else ():
        if hasattr(found := import_module(f"rtradar.classify.{module}"), name):
            return getattr(found, name)
    raise AttributeError(f"module 'rtradar.classify' has no attribute '{name}'")
