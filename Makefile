# make demo   sets everything up and designs the lens of examples/pearl.toml
# make test   sets everything up and runs the tests
# make lint   ruff
# Another interpreter: make PYTHON=/path/to/python3.12 demo

PYTHON ?=
export PYTHON

.PHONY: demo test lint setup clean

demo:
	@echo "This sets up Python packages in .venv, then shapes a lens that casts 'Girl with a Pearl Earring' and writes it to exports/pearl/."
	@$(MAKE) --no-print-directory setup
	@.venv/bin/thbcad design examples/pearl.toml --out exports/pearl
	@echo "Done. Look at exports/pearl/report.html (pictures and checks) and exports/pearl/lens.step (the solid)."

test: setup
	@.venv/bin/python -m pytest

lint: setup
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .

setup:
	@scripts/setup

clean:
	rm -rf .venv build *.egg-info
