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
    from rtradar.classify.baselines import judge_baselines
    from rtradar.classify.pointnet import PointNet
    from rtradar.classify.prepare import stack_clouds
    from rtradar.classify.recipes import LEAN, PAPER, Recipe
    from rtradar.classify.splits import Split, make_splits
    from rtradar.classify.store import Outcome
    from rtradar.classify.study import Study, load_network, load_study, train_study
    from rtradar.classify.training import Examples, predict, train_network

_HOME = {
    "LEAN": "recipes",
    "PAPER": "recipes",
    "Examples": "training",
    "Outcome": "store",
    "PointNet": "pointnet",
    "Recipe": "recipes",
    "Split": "splits",
    "Study": "study",
    "judge_baselines": "baselines",
    "load_network": "study",
    "load_study": "study",
    "make_splits": "splits",
    "predict": "training",
    "stack_clouds": "prepare",
    "train_network": "training",
    "train_study": "study",
}

__all__ = [
    "LEAN",
    "PAPER",
    "Examples",
    "Outcome",
    "PointNet",
    "Recipe",
    "Split",
    "Study",
    "judge_baselines",
    "load_network",
    "load_study",
    "make_splits",
    "predict",
    "stack_clouds",
    "train_network",
    "train_study",
]


def __getattr__(name: str) -> Any:
    """Load only what is used: recipes and splits do not need torch."""
    if name in _HOME:
        return getattr(import_module(f"rtradar.classify.{_HOME[name]}"), name)
    raise AttributeError(f"module 'rtradar.classify' has no attribute '{name}'")
