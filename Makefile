# `make run` runs the main job, `make test` checks every equation; both make their own virtual environment first.
VENV ?= .venv
PYTHON ?= python3
BIN = $(VENV)/bin
EXTRAS ?= test,lint
STAMP = $(VENV)/.installed-$(subst $(comma),-,$(EXTRAS))
comma := ,

.PHONY: run test verify bench lint clean

run: $(STAMP)
	$(BIN)/sim run scenarios/pdms_lens.toml --force
	$(BIN)/sim plot outputs/pdms_lens.nc

test: $(STAMP)
	$(BIN)/python -m pytest -n 2
	$(BIN)/python -m pytest --doctest-modules sim --ignore=sim/__main__.py

verify:
	$(MAKE) EXTRAS=test,lint,verify .verify

.PHONY: .verify
.verify: $(STAMP)
	$(BIN)/python -m pytest -n 2 -m "verify or not verify" --timeout=3600

bench: $(STAMP)
	$(BIN)/python benchmarks/run.py

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

$(STAMP): pyproject.toml constraints.txt
	@command -v uv >/dev/null 2>&1 || command -v $(PYTHON) >/dev/null 2>&1 || \
	  { echo "make: needs uv or Python 3.11 or later ($(PYTHON) was not found; set PYTHON=...)"; exit 1; }
	@command -v uv >/dev/null 2>&1 || $(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "make: $(PYTHON) is older than Python 3.11; set PYTHON=python3.11 or install uv"; exit 1; }
	@if command -v uv >/dev/null 2>&1; then \
	  test -x $(BIN)/python || uv venv -q --python '>=3.11' $(VENV); \
	  uv pip install -q --python $(BIN)/python -c constraints.txt -e '.[$(EXTRAS)]'; \
	else \
	  test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || \
	    { echo "make: python venv is missing; install it (Debian: python3-venv) or uv"; exit 1; }; \
	  $(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[$(EXTRAS)]'; \
	fi
	@touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache
