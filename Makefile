# Each command does everything on a fresh machine: `make first`, `make demo`, `make test`.

PYTHON := $(shell for p in python3.12 python3.13 python3 $$HOME/.pyenv/versions/3.1[23]*/bin/python3 $$PYENV_ROOT/versions/3.1[23]*/bin/python3; do \
	command -v $$p >/dev/null 2>&1 && $$p -c 'import sys; sys.exit(not (3, 12) <= sys.version_info[:2] < (3, 14))' >/dev/null 2>&1 && { echo $$p; break; }; done)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: first demo test test-debian verify bench gallery notebooks docs lint clean

first: $(STAMP)
	$(BIN)/mufe run demos/first.toml --overwrite
	@echo "report: $(CURDIR)/runs/first/report.html"

demo: $(STAMP)
	$(BIN)/mufe demo --output demo-output --overwrite

test: $(STAMP)
	$(BIN)/python -m tests

# Everything in a folder with Debian's own packages instead of the wheel; needs root and debootstrap.
test-debian:
	packaging/debian_root.sh test

verify: $(STAMP)
	$(BIN)/python -m pytest -m slow
	$(BIN)/mufe verify
	$(BIN)/mpirun -n 3 $(BIN)/mufe verify

bench: $(STAMP)
	$(BIN)/mufe bench

# The pictures of docs/gallery.md, and what they are drawn from in build/gallery.
gallery: $(STAMP)
	$(BIN)/python demos/gallery.py -o docs/gallery

# The notebooks of the documentation with what their cells give.
notebooks: $(STAMP)
	$(BIN)/python -m tests.notebooks

# The documentation, in build/docs; a warning is an error.
docs: $(VENV)/.docs-installed
	$(BIN)/sphinx-build -W --keep-going --quiet -b html -d build/doctrees -c docs . build/docs
	@echo "documentation: $(CURDIR)/build/docs/index.html"

$(VENV)/.docs-installed: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	@touch $@

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

$(STAMP): pyproject.toml
	@test -n "$(PYTHON)" || { echo "Python 3.12 or 3.13 is needed and none was found on PATH or under ~/.pyenv/versions: install one, or call make PYTHON=/path/to/python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dolfinx,test,demo]'
	@touch $(STAMP)

clean:
	rm -rf $(VENV) demo-output
