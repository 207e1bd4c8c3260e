#!/bin/sh
# The built wheel in an empty environment, outside the checkout: it runs, and carries scenes, meshes and validation scripts along.
#
#     sh validation/wheel.sh [PYTHON]
#
# PYTHON has the packages that rtradar needs; the environment sees those, but not the checkout.
set -eu
checkout=$(cd "$(dirname "$0")/.." && pwd)
python=${1:-$checkout/.venv/bin/python}
python=$(command -v "$python")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT INT TERM
cp -r "$checkout" "$work/source"   # building leaves files beside the sources
"$python" -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$work" "$work/source"
rm -rf "$work/source"
"$python" -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps "$work"/rtradar-*.whl
"$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))' > "$work/path"
cp "$work/path" "$("$work/venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/shared.pth"
cd "$work"
unset PYTHONPATH || true
"$work/venv/bin/python" - <<'PROBE'
import rtradar
from rtradar.scene import Scene
from rtradar.scene.mesh_files import mesh_names, meshes_folder
from rtradar.validate import claims, validation_folder

assert "/venv/" in rtradar.__file__, rtradar.__file__
assert len(Scene.load("living-room").furniture) > 0
print(f"{len(mesh_names())} meshes in {meshes_folder().name}/, {len(claims(validation_folder()))} claims, scenes found")
PROBE
"$work/venv/bin/rtradar" run synthetic:walk --duration 0.3 --out "$work/out"
"$work/venv/bin/rtradar" run synthetic:walk --duration 0.2 --scene bedroom --fidelity analytic --out "$work/room"
test -s "$work/out/report.html" && test -s "$work/room/maps.h5" && echo "the wheel works"
