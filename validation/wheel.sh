#!/bin/sh
# Source distribution and wheel, built and tried as a stranger would: in an empty environment, outside the checkout.
#
#     sh validation/wheel.sh [PYTHON ...]       # of each Python (default: python3)
#
# The wheel is built from the source distribution, so that both are tried. The versions of all packages are the pinned
# ones. For each Python it says how many megabytes were installed, by package and who imports it, and
# leaves that in out/installed.json.
set -eu
checkout=$(cd "$(dirname "$0")/.." && pwd)
[ $# -gt 0 ] || set -- python3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT INT TERM
pip() { "$1/bin/python" -m pip --quiet --disable-pip-version-check "$2" "$3" "$4" "$5"; }
git -C "$checkout" archive --prefix source/ HEAD | tar -x -C "$work"   # building leaves files beside the sources
"$1" -m venv "$work/builder"
pip "$work/builder" install --constraint "$checkout/constraints.txt" build
"$work/builder/bin/python" -m build --outdir "$work/dist" "$work/source" >/dev/null
rm -rf "$work/source" "$work/builder"
cd "$work"
unset PYTHONPATH || true
for python; do
  "$python" -m venv venv
  pip venv install --constraint "$checkout/constraints.txt" "$(ls dist/*.whl)"
  venv/bin/python - <<'PROBE'
import rtradar
from rtradar.scene import Scene
from rtradar.scene.mesh_files import mesh_names
from rtradar.system.files import shipped_folder
from rtradar.validate import claims, validation_folder

assert "/venv/" in rtradar.__file__, rtradar.__file__
assert len(Scene.load("living-room").furniture) > 0
print(f"{len(mesh_names())} meshes in {shipped_folder('meshes').name}/, {len(claims(validation_folder()))} claims, scenes found")
PROBE
  venv/bin/rtradar run synthetic:walk --duration 0.3 --out out --overwrite
  venv/bin/rtradar run synthetic:walk --duration 0.2 --scene bedroom --fidelity analytic --out room --overwrite
  venv/bin/rtradar compare synthetic:kick --fidelities analytic,specular --duration 0.2 --out levels
  test -s out/report.html
  test -s room/maps.h5
  test -s levels/compare.html
  mkdir -p "$checkout/out"
  venv/bin/python "$checkout/validation/cost/installed.py" --json "$checkout/out/installed.json"
  echo "$("$python" --version): the wheel works"
  rm -rf venv out room levels
done
