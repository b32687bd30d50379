# The developer's front door. `make demo` and `make test` set up what they need.
DODO := .venv/bin/dodo

.PHONY: help demo test lint bench firmware format goldens schema clean

help:
	@echo "make demo     set up, then run the shipped tests with the example application"
	@echo "make test     set up, then every check: format, lint, types, imports, tests"
	@echo "make bench    measure, beside a peer in the same run"
	@echo "make firmware build the gantry's firmware and its emulated rig, into build/firmware"
	@echo "make format   format the sources"
	@echo "make goldens  write the expected output of the compiler's tests again"
	@echo "make schema   put what manifests say into the schema that editors read"
	@echo "make clean    remove what was built"

demo:
	@scripts/setup
	$(DODO) compile
	$(DODO) run --level sil --level dil --level hil $(shell scripts/have-rig || echo "'sil-*' 'dil-*' 'hil-camera*'")

lint:
	@scripts/setup dev
	.venv/bin/ruff format --check .
	.venv/bin/ruff check .
	.venv/bin/mypy
	PYTHONPATH=. .venv/bin/lint-imports

test: lint
	@scripts/install-compose
	@scripts/install-gitlab-ci-local
	@scripts/start-engine
	@scripts/install-firmware-tools
	.venv/bin/pytest

bench:
	@scripts/setup dev
	@for script in benchmarks/bench_*.py; do .venv/bin/python $$script || exit 1; done

firmware:
	@scripts/install-firmware-tools
	@$(MAKE) -s -C firmware

format:
	@scripts/setup dev
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

goldens:
	@scripts/setup dev
	.venv/bin/pytest -q tests/compiler --update-goldens

schema:
	@scripts/setup dev
	@scripts/make-schema

clean:
	rm -rf .venv build dist generated dodo-report .pytest_cache .mypy_cache .ruff_cache .hypothesis
