# Two commands do everything on a fresh machine: `make demo` and `make test`.

PYTHON := $(shell for p in python3.12 python3.13 python3 $$HOME/.pyenv/versions/3.1[23]*/bin/python3 $$PYENV_ROOT/versions/3.1[23]*/bin/python3; do \
	command -v $$p >/dev/null 2>&1 && $$p -c 'import sys; sys.exit(not (3, 12) <= sys.version_info[:2] < (3, 14))' >/dev/null 2>&1 && { echo $$p; break; }; done)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo test verify bench lint clean

demo: $(STAMP)
	$(BIN)/mufe demo --output demo-output --overwrite

test: $(STAMP)
	$(BIN)/python -m tests

verify: $(STAMP)
	$(BIN)/mufe verify
	$(BIN)/mpirun -n 3 $(BIN)/mufe verify

bench: $(STAMP)
	$(BIN)/mufe bench

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

$(STAMP): pyproject.toml
	@test -n "$(PYTHON)" || { echo "Python 3.12 or 3.13 is needed and none was found on PATH or under ~/.pyenv/versions: install one, or call make PYTHON=/path/to/python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dolfinx,test,demo]'
	@touch $(STAMP)

clean:
	rm -rf $(VENV) demo-output
