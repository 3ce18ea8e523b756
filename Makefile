# Two commands: `make demo` and `make test`. `make` alone prints the targets.
# The only needs are make, a package index, Python 3.11 or newer with its venv module, and on Linux libatomic (Dr.Jit's).

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Holds the folder that the environment was made in, since scripts in it name that folder. It is taken away while pip
# is at work, so an interrupted set-up leaves none and the next run makes the environment anew.
COMPLETE := $(VENV)/complete
DEMO_OUT ?= out/demo

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test test-all test-any-cpu verify hard-cases results faults docs fuzz lint clean FORCE

help:
	@echo "make demo    set up $(VENV), render the still life from moonlight to daylight, write $(DEMO_OUT)/report.html"
	@echo "make test    set up $(VENV), lint, types, import contracts, and the tests of two minutes on two cores"
	@echo "make test-all  every test that is not slow: eleven minutes on two cores"
	@echo "make test-any-cpu  the same as other processors add up; CPU=NAME one of them, CPU=by-date today's"
	@echo "make verify  slow tests, hard cases, planted faults, damaged files, soak: hours; goes on where it was ended"
	@echo "             with SCENES=folder: all Mitsuba scenes of a folder beside stock Mitsuba; DEFINE=spp=16 its \$$parameters"
	@echo "             with FRAMES=folder: the frames of real cameras that others published, EMVA1288/datasets of GitHub"
	@echo "make hard-cases  a hundred hard cases with the margin by which each invariant is kept, as docs/hard_cases.md"
	@echo "make results  every figure and table that README and the pages quote: hours, goes on where it was ended; PART=NAME one"
	@echo "make faults  plant the faults of tests/faults one by one and show that a test notices each (resumable)"
	@echo "make docs    the documentation, with its figures made anew where the code has changed, as out/site"
	@echo "make lint    ruff, mypy and the import contracts alone"
	@echo "make fuzz    a minute of damaged files for every reader; counts go on in out/fuzz"
	@echo "make clean   remove all that these targets make: $(VENV), out, build and caches"
	@echo "Another Python: make PYTHON=python3.12 test"

demo: $(VENV)/installed
	@$(BIN)/rodcone demo -o "$(DEMO_OUT)"
	@echo "Report: $(abspath $(DEMO_OUT))/report.html (open it in a browser)"

# A worker a core, with one thread of BLAS and (tests/conftest.py) of Dr.Jit in each.
PARALLEL := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --maxprocesses 8 --dist worksteal

# Asserts as they stand save a tenth of the time; a failed test runs once more with what it compared.
QUICK := -m "not thorough and not slow"
test: lint
	@$(PARALLEL) $(QUICK) --assert=plain || { $(BIN)/python -m pytest $(QUICK) --last-failed --lfnf=none; exit 1; }

# In CI TESTS=thorough leaves out what `make test` has run.
TESTS := not slow
test-all: $(VENV)/installed-dev
	@$(PARALLEL) -m "$(TESTS)"

# As test-all; in CI TESTS="not thorough and not slow" has it run what `make test` does.
CPU := all
test-any-cpu: $(VENV)/installed-dev
	@$(BIN)/python tests/any_cpu/configurations.py --cpu "$(CPU)" -q -n auto --maxprocesses 8 --dist worksteal -m "$(TESTS)"

# A part that passed has a stamp of when it began, which newer code makes void; `make --keep-going verify` goes on after
# one that fails.
CODE = $(shell find rodcone render scenes sensor isp studies tests benchmarks -name "*.py")
SLOW = $(shell grep -rl --include="test_*.py" "pytest.mark.slow" tests)
ifdef SCENES
verify: $(VENV)/installed
	@$(BIN)/python benchmarks/stock_scenes.py "$(SCENES)" --out out/verify/scenes.csv $(DEFINE:%=--define %)
else ifdef FRAMES
verify: $(VENV)/installed-dev
	@FRAMES="$(abspath $(FRAMES))" $(BIN)/python -m pytest -q -m slow -n0 tests/crosscheck/test_public_frames.py
else
verify: $(addprefix out/verify/,$(SLOW) any-cpu faults fuzz soak)
endif
out/verify/any-cpu: PART = tests/any_cpu/configurations.py -q -n auto -m "not slow"
out/verify/faults: PART = tests/faults/plant_faults.py
out/verify/fuzz: PART = tests/fuzz/run.py --seconds 3600
out/verify/soak: PART = tests/soak/soak.py
out/verify/%: $(CODE) | $(VENV)/installed-dev
	@mkdir -p $(@D) && touch $@.begun && echo "$*"
	@$(BIN)/python $(or $(PART),-m pytest -q -m slow $*)
	@mv $@.begun $@

hard-cases: $(VENV)/installed-dev
	@PYTHONPATH=tests:docs/make $(BIN)/python -m hard.page

# docs/results/parts.toml lists the parts; PART="one two" makes these.
results: $(VENV)/installed-dev
	@$(BIN)/python docs/make/make_results.py $(PART)

faults: $(VENV)/installed-dev
	@$(BIN)/python tests/faults/plant_faults.py

# Pages open from the file, and their search works there too. Minutes are of two idle cores (docs/figures.mk).
FIGURES_DUE = $(MAKE) --no-print-directory -n -f docs/figures.mk BIN=$(BIN)
docs: $(VENV)/installed-docs
	@due="$$($(FIGURES_DUE) 2>/dev/null)"; pages=$$(echo "$$due" | grep -c run_page.py); \
	large=$$(echo "$$due" | grep -cE "rodcone (demo|paper) "); \
	echo "$$pages pages' examples and $$large reports are older than the code and are made anew: about" \
	"$$((1 + pages / 2 + 3 * large)) minutes on two idle cores; the pages themselves take one."
	@begun=$$(date +%s); $(MAKE) --no-print-directory -f docs/figures.mk BIN=$(BIN) \
	&& NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet \
	&& echo "Documentation, made in $$((($$(date +%s) - begun + 59) / 60)) min: $(abspath out/site)/index.html (open it in a browser)"

fuzz: $(VENV)/installed-dev
	@nice -n 10 $(BIN)/python tests/fuzz/run.py --seconds 60

lint: $(VENV)/installed-test
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

clean:
	rm -rf $(VENV) out build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# One line that says what is missing, empty where nothing is. It is expanded before a recipe's first command runs.
hint = install Python 3.11 or newer with its venv module (Debian: apt install python3-venv libatomic1), or name one: make PYTHON=python3.12
problem = $(if $(shell command -v "$(PYTHON)"),$(old_python),$(PYTHON) is not found; $(hint))
old_python = $(if $(shell "$(PYTHON)" -c 'import sys; sys.version_info >= (3, 11) and print("new")' 2>&1 | grep -x new),$(no_venv),$(PYTHON) is older than 3.11 or does not start; $(hint))
no_venv = $(if $(shell "$(PYTHON)" -c 'import ensurepip, venv; print("there")' 2>/dev/null),$(no_atomic),$(PYTHON) has no venv or ensurepip module; $(hint))
no_atomic = $(if $(shell "$(PYTHON)" -c '$(load_atomic)' 2>/dev/null),,libatomic.so.1 is absent and Dr.Jit can not start without it; install it (Debian: apt install libatomic1))
load_atomic = import ctypes, platform; platform.system() == "Linux" and ctypes.CDLL("libatomic.so.1"); print("there")

# $(call set-up,what pip installs,stamps to touch)
define set-up
$(if $(problem),$(error $(problem)))
@if [ "$$(cat $(COMPLETE) 2>/dev/null)" != "$$(pwd -P)" ] || ! $(BIN)/python -c "" 2>/dev/null; then \
	echo "Making $(VENV) with $$("$(PYTHON)" --version)" && rm -rf $(VENV) && "$(PYTHON)" -m venv $(VENV); fi
@rm -f $(COMPLETE)
@echo "Installing rodcone and its libraries into $(VENV): once, minutes at most, 210 MB or more to download"
@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable "$(1)"
@pwd -P > $(COMPLETE) && touch $(2)
@echo "Installed."
endef

# Made anew also where the folder was moved or the Python behind the environment is gone.
ifneq ($(shell $(BIN)/python -c "" 2>/dev/null && cat $(COMPLETE) 2>/dev/null),$(shell pwd -P))
UNUSABLE := FORCE
endif

$(VENV)/installed: pyproject.toml Makefile $(UNUSABLE)
	$(call set-up,.,$@)

$(VENV)/installed-test: pyproject.toml Makefile $(UNUSABLE)
	$(call set-up,.[test],$@ $(VENV)/installed)

$(VENV)/installed-dev: pyproject.toml Makefile $(UNUSABLE)
	$(call set-up,.[dev],$@ $(VENV)/installed $(VENV)/installed-test $(VENV)/installed-docs)

$(VENV)/installed-docs: pyproject.toml Makefile $(UNUSABLE)
	$(call set-up,.[docs],$@ $(VENV)/installed)

FORCE:
