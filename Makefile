# Each command does everything on a fresh machine: `make first`, `make demo`, `make test`.

PYTHON := $(shell for p in python3.12 python3.13 python3 $$HOME/.pyenv/versions/3.1[23]*/bin/python3 $$PYENV_ROOT/versions/3.1[23]*/bin/python3; do \
	command -v $$p >/dev/null 2>&1 && $$p -c 'import sys; sys.exit(not (3, 12) <= sys.version_info[:2] < (3, 14))' >/dev/null 2>&1 && { echo $$p; break; }; done)
VENV := .venv
BIN := $(VENV)/bin
# What is installed, each beside what stands before it: the program, the demonstration's scan, the tools of tests.
RUNS := $(VENV)/.installed
DEMO := $(VENV)/.installed-demo
TEST := $(VENV)/.installed-test
DOCS := $(VENV)/.installed-docs

.PHONY: first demo tools test test-debian verify bench gallery notebooks docs lint clean

first: $(RUNS)
	$(BIN)/mufe run demos/first.toml --overwrite
	@echo "report: $(CURDIR)/runs/first/report.html"

demo: $(DEMO)
	$(BIN)/mufe demo --output demo-output --overwrite

# What `make test` installs, without the tests.
tools: $(TEST)

test: $(TEST)
	$(BIN)/python -m tests

# Everything in a folder with Debian's own packages instead of the wheel; needs root and debootstrap.
test-debian:
	packaging/debian_root.sh test

verify: $(TEST)
	$(BIN)/python -m pytest -m slow
	$(BIN)/mufe verify
	$(BIN)/mpirun -n 3 $(BIN)/mufe verify

bench: $(RUNS)
	$(BIN)/mufe bench

# The pictures of docs/gallery.md, and what they are drawn from in build/gallery.
gallery: $(DEMO)
	$(BIN)/python demos/gallery.py -o docs/gallery

# The notebooks of the documentation with what their cells give.
notebooks: $(TEST)
	$(BIN)/python -m tests.notebooks

# The documentation, in build/docs; a warning is an error.
docs: $(DOCS)
	$(BIN)/sphinx-build -W --keep-going --quiet -b html -d build/doctrees -c docs . build/docs
	@echo "documentation: $(CURDIR)/build/docs/index.html"

lint: $(TEST)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/clang-format --dry-run --Werror mufe_fenicsx/kernels/*/*.c mufe_fenicsx/kernels/*/*.h
	$(BIN)/mypy

# uv takes a quarter of pip's time. Its settings are others than pip's: where it finds no packages, pip installs.
UV := $(shell command -v uv || echo $(BIN)/uv)
define install
	@echo "installing mufe_fenicsx[$(1)] in $(VENV)"
	@$(UV) pip install --python $(BIN)/python -e '.[$(1)]' || $(BIN)/python -m pip install -e '.[$(1)]'
endef
, := ,

$(RUNS): pyproject.toml
	@test -n "$(PYTHON)" || { echo "Python 3.12 or 3.13 is needed and none was found on PATH or under ~/.pyenv/versions: install one, or call make PYTHON=/path/to/python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@command -v uv >/dev/null || $(BIN)/python -m pip install --quiet --disable-pip-version-check uv || true
	$(call install,dolfinx)
# What runs and reports load is kept as bytecode, also where Python is told not to.
	@env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -c "import mufe_fenicsx.run.run, mufe_fenicsx.report.write, mufe_fenicsx.report.ahead"
	@touch $@

$(DEMO): $(RUNS)
	$(call install,dolfinx$(,)demo)
	@touch $@

$(TEST): $(DEMO)
	$(call install,dolfinx$(,)demo$(,)test)
	@touch $@

$(DOCS): $(RUNS)
	$(call install,dolfinx$(,)docs)
	@touch $@

clean:
	rm -rf $(VENV) demo-output
