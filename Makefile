# `make run` runs the main job, `make test` checks every equation; both make their own virtual environment first.
VENV ?= .venv
PYTHON ?= python3
BIN = $(VENV)/bin
EXTRAS ?= test,lint
STAMP = $(VENV)/.installed-$(subst $(comma),-,$(EXTRAS))
comma := ,
# `make run` needs no extra, and is content with any environment.
ANY = $(firstword $(wildcard $(VENV)/.installed-*) $(VENV)/.installed-run)
EXTRAS_OF = $(if $(filter run,$*),,[$(subst -,$(comma),$*)])

# Commands and tests start many processes, which would compile each source anew without its bytecode.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run test verify page windows bench gallery docs lint lines clean

run: $(ANY)
	$(BIN)/sim run scenarios/pdms_lens.toml --force
	$(BIN)/sim plot outputs/pdms_lens.nc --force

# Kernels that are not compiled yet are so once, not by each of the processes that test.
test: $(STAMP)
	-$(BIN)/sim warm
	$(BIN)/python -m pytest $(PARALLEL) --doctest-modules --ignore=sim/__main__.py sim tests

PARALLEL = -n 2 --dist worksteal

# `make verify` runs all groups with their long checks, `make verify GROUP=parts` one of them.
GROUP ?= laws parts runs lowest
laws = --doctest-modules --ignore=sim/__main__.py sim tests/laws tests/numerics tests/spectrum tests/units
parts = tests/parts
folders = $(filter-out tests/helpers tests/windows tests/__pycache__, $(patsubst %/,%,$(wildcard tests/*/)))
runs = $(filter-out $(laws) $(parts), $(folders)) $(wildcard tests/test_*.py)

verify: page
	$(MAKE) EXTRAS=test,lint,verify $(GROUP:%=.verify-%)

# `make page` tests the JavaScript of `sim explore`, and checks its types and its format. It needs Node.js 20 or later.
page:
	@if ! command -v node >/dev/null 2>&1; then \
	  echo "make: Node.js is missing: the JavaScript of the page is not checked; install Node.js 20 or later"; \
	else \
	  node --test tests/explorer/js/*.test.js && \
	  if test -d node_modules || npm install --silent --no-audit --no-fund --no-package-lock; then npm run --silent check; \
	  else echo "make: npm installed nothing: types and form of the JavaScript are not checked"; fi; \
	fi

.PHONY: .verify-laws .verify-parts .verify-runs .verify-lowest
.verify-laws .verify-parts .verify-runs: .verify-%: $(STAMP)
	$(BIN)/python -m pytest $(PARALLEL) -m "verify or not verify" --timeout=3600 $($*)

# Packages that results are compared with, such as Adhesion by one file. None of their dependencies is installed beside those named here, because the
# comparisons need no others.
PEERS = 'Adhesion>=0.93' 'tamaas>=2.9' 'gstools>=1.7' gstools-cython hankel emcee pyevtk meshio 'stochastic-arrow>=1.1' six \
  'ContactMechanics>=1.8' 'SurfaceTopography>=1.27' NuMPI muGrid muTimer numpyencoder DiscoverVersion array-api-compat defusedxml igor2 olefile \
  openpyxl xmltodict
.verify-laws .verify-runs: $(VENV)/.peers
$(VENV)/.peers: $(STAMP) Makefile
	PATH="$$PATH:$(BIN)" uv pip install -q --python $(BIN)/python --no-deps $(PEERS) || \
	  $(BIN)/python -m pip install -q --disable-pip-version-check --no-deps $(PEERS)
	@touch $@

# `make validation` runs the comparisons of docs/validation.md and writes its table and figure.
validation:
	$(MAKE) EXTRAS=test,lint,verify .validation

.PHONY: validation .validation
.validation: $(VENV)/.peers
	$(BIN)/python docs/make_validation.py

# The tests of `make test` with the lowest versions of all libraries that pyproject.toml allows. The lowest matplotlib
# calls names that pyparsing 3.3 declares obsolete, and the tests turn each warning into an error.
LOWEST = .venv-lowest
.verify-lowest: $(STAMP)
	test -x $(LOWEST)/bin/python || $(BIN)/python -m venv $(LOWEST)
	$(LOWEST)/bin/python -m pip install -q --disable-pip-version-check $$($(BIN)/python -c 'import tomllib; \
	  p = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
	  print(*(r.replace(">=", "==") for r in p["dependencies"] + p["optional-dependencies"]["test"]))') 'pyparsing<3.3'
	$(LOWEST)/bin/python -m pip install -q --disable-pip-version-check --no-deps -e .
	-$(LOWEST)/bin/sim warm
	$(LOWEST)/bin/python -m pytest $(PARALLEL) tests

# `make windows` makes a Windows Python under Wine, goes the way of a user in it, and runs tests in it. It takes about an
# hour, and 1.6 GB in $(WINDOWS). Missing programs are installed with apt if the user is root. CI does not run it.
WINDOWS = .windows
PYTHON311 = python3.11
windows:
	$(PYTHON311) tests/windows/wine.py all $(WINDOWS)

# `make bench` measures all rows of docs/speed_rows.md, `make bench ROWS="modal disc"` those of some groups.
bench: $(STAMP)
	$(BIN)/python -m benchmarks.run $(ROWS)

# `make gallery` runs and draws all questions of docs/gallery, `make gallery NAMES="masking"` some.
gallery: $(STAMP)
	$(BIN)/python docs/make_gallery.py $(NAMES)

# `make docs` builds the site of docs/ into docs/_build/html, with warnings as errors.
docs:
	$(MAKE) EXTRAS=docs .site

.PHONY: .site
.site: $(STAMP)
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html

lines:
	$(PYTHON) benchmarks/lines.py

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff check --preview --select PLW1514 sim
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python docs/readability.py

# uv installs in a tenth of pip's time. Without uv, pip installs it into the environment first. If uv fails, such as
# behind a mirror that pip alone knows, pip installs all.
$(VENV)/.installed-%: pyproject.toml constraints.txt
	@command -v uv >/dev/null 2>&1 || command -v $(PYTHON) >/dev/null 2>&1 || \
	  { echo "make: needs uv or Python 3.11 or later ($(PYTHON) was not found; set PYTHON=...)"; exit 1; }
	@command -v uv >/dev/null 2>&1 || $(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "make: $(PYTHON) is older than Python 3.11; set PYTHON=python3.11 or install uv"; exit 1; }
	@if command -v uv >/dev/null 2>&1; then \
	  test -x $(BIN)/python || uv venv -q --python '>=3.11' $(VENV); \
	else \
	  test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || \
	    { echo "make: python venv is missing; install it (Debian: python3-venv) or uv"; exit 1; }; \
	  test -x $(BIN)/uv || $(BIN)/python -m pip install -q --disable-pip-version-check uv || true; \
	fi
	@PATH="$$PATH:$(BIN)" uv pip install -q --python $(BIN)/python -c constraints.txt -e '.$(EXTRAS_OF)' || \
	  $(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.$(EXTRAS_OF)'
	@touch $@

clean:
	rm -rf node_modules $(VENV) $(LOWEST) $(WINDOWS) docs/_build docs/_api build dist *.egg-info .mypy_cache .ruff_cache
