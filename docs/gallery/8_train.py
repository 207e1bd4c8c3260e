"""
Train
=====

A PointNet learns walks and punches from the clouds of the page before, and is asked about people
whom it never saw. On a command line: ``rtradar train out/gallery/small --out out/trained --split
subject``.
"""

import os
import runpy
import shutil
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from rtradar.classify import LEAN, train_study
from rtradar.clouds import Collection

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
if not (OUT / "small").exists():
    runpy.run_path(str(Path(sys.argv[0]).with_name("7_build_a_data_set.py")))

# %%
# A recipe is all that decides what comes of a training; fewer points and epochs than its own are
# enough here.
shutil.rmtree(OUT / "trained", ignore_errors=True)  # else it would go on where it was
recipe = LEAN.changed(points=256, epochs=20)
study = train_study(Collection(OUT / "small"), OUT / "trained", recipe, split="subject", folds=2)
right = np.mean([outcome.accuracy for outcome in study.outcomes])
print(f"{100 * right:.0f} % of the clouds of unseen people are recognised")

# %%
# Loss over the epochs of each training. Eight clouds show how it is done, not how well it can be
# done.
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for outcome in study.outcomes:
    axes.plot([row["train_loss"] for row in outcome.history], label=outcome.name)
axes.set(
    xlabel="Epoch",
    ylabel="Loss of the training clouds",
    title=f"{100 * right:.0f} % right of people never seen",
)
axes.legend()
figure.savefig(OUT / "8_train.png")
