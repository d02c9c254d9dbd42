# Two commands do everything: `make run` and `make test`. Each sets up its own virtual environment first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
JOBS ?= 2

# An environment that was left half made, as where Debian's python3-venv is missing, or made by an older Python would stay
# in the way for good: it is made anew.
FITS := 'import sys; sys.exit(sys.version_info < (3, 11))'
ENVIRONMENT = { $(BIN)/python -c $(FITS) && $(BIN)/python -c 'import pip'; } 2>/dev/null || { \
	$(PYTHON) -c $(FITS) 2>/dev/null || \
	{ echo "$(PYTHON) is not there or older than Python 3.11; name a newer one: make PYTHON=python3.12" >&2; exit 2; }; \
	$(PYTHON) -m venv --clear $(VENV); }

.PHONY: run test suite test-browser coverage lint validate accuracy docs fmus clean

$(VENV)/.run: pyproject.toml
	@$(ENVIRONMENT)
	$(BIN)/pip install --quiet --editable .
	touch $@

$(VENV)/.test: pyproject.toml
	@$(ENVIRONMENT)
	$(BIN)/pip install --quiet --editable '.[test]'
	touch $@ $(VENV)/.run

run: $(VENV)/.run
	$(BIN)/python -m warp_mpm run scenarios/set_iib.json --out runs/set_iib --force

lint: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# Both at the same time: types are checked on one core.
test: $(VENV)/.test
	$(MAKE) --no-print-directory --jobs=2 lint suite

# A file to one process: two would compile the same kernels at the same time, and make the runs of a module twice. The
# longest first, as tests/conftest.py has them, which by itself would be the files of the most tests.
suite: $(VENV)/.test
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder

# Functions that Warp compiles are left out: Python does not run them.
coverage: $(VENV)/.test
	mkdir -p build && rm -f build/coverage*
	$(BIN)/python -m coverage run -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder
	$(BIN)/python -m coverage combine --quiet
	$(BIN)/python -m coverage report --skip-covered --sort=cover

validate: $(VENV)/.test
	$(BIN)/python -m pytest -n $(JOBS) -m slow

# What docs/accuracy.md shows and `run --accuracy` knows. Interrupted, the same command goes on where it stopped.
accuracy: $(VENV)/.run
	$(BIN)/python -m warp_mpm accuracy scenarios/set_*.json scenarios/case_1.json --quick \
		--data warp_mpm/accuracy/paper_scenes.json --page docs/accuracy.md
	$(BIN)/python -m warp_mpm accuracy scenarios/case_1.json --quick --page docs/accuracy.md
	$(BIN)/python -m warp_mpm accuracy scenarios/set_iib.json --quick --page docs/accuracy.md
	$(BIN)/python -m warp_mpm accuracy scenarios/case_1.json --check --until 4 --page docs/accuracy.md

# Every unit for every platform, the system of them, and SHA256SUMS; the same bytes wherever and whenever.
fmus: $(VENV)/.test
	$(BIN)/python -m fmu release --out dist

docs: $(VENV)/.test
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict -f docs/site/mkdocs.yml   # pages in build/site

test-browser: $(VENV)/.test   # needs Chromium: Debian's, or CHROMIUM=path
	$(BIN)/pip install --quiet --editable '.[browser]'
	$(BIN)/python -m pytest tests/warp_mpm/browser_report.py

clean: # what was built; runs stay
	rm -rf build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache
