# The front doors of Engram. Every target sets up what it needs and skips what is done.
# ROBOT=panda|talos|anymal|hector|pendulum|unicycle|bicopter and TASK=... choose what is shown, SEED=n another series of tasks, JOBS=n the number of parallel compilations, PYTHON=... the interpreter; ARGS="..." goes
# to the command behind the target.
SHELL := /bin/bash
SEED ?= 1
ROBOT ?= panda
export JOBS PYTHON

.PHONY: help demo test bench tables study clean setup
help:
	@echo "make demo    run the arm that remembers: video, report and summary in runs/<time>/   (SEED=n)"
	@echo "make demo ROBOT=talos|anymal|hector   the same of a humanoid, a quadruped, a quadrotor (TASK=...)"
	@echo "make demo ROBOT=pendulum|unicycle|bicopter   and of systems that are a formula"
	@echo "make test    build everything and run every test"
	@echo "make bench   time the controller beside its peers"
	@echo "make study   make a row of the thesis again beside ours: S=6.3, or S=6 for a chapter   (QUICK=1)"
	@echo "make tables  rebuild the generated tables from models/"
	@echo "make clean   remove everything that was built (runs/ and .venv/ stay)"

setup:
	@scripts/setup.sh

# The demo needs three programs and the binding; the tests can wait.
demo: export TARGETS = engram-controller engram-plant engram-render _engine
demo: setup
	@.venv/bin/engram demo --robot $(ROBOT) $(if $(TASK),--task $(TASK)) --seed $(SEED) $(ARGS)

test: setup
	@.venv/bin/python scripts/test.py $(ARGS)

bench: export TARGETS = engram_bench engram_bench_single query_bench count_heap _engine
bench: setup
	@scripts/setup.sh torch || echo "bench:     the rows beside PyTorch are left out"
	@.venv/bin/python bench/run.py $(ARGS)

tables: setup
	@scripts/tables.sh

study: export TARGETS = _engine $(if $(filter 7%,$(S)),engram-pole)
study: setup
	@$(if $(filter 6 6.6,$(S)),scripts/setup.sh torch || echo "study:     the columns of PyTorch are left out")
	@.venv/bin/engram study $(S) $(if $(QUICK),--quick) $(ARGS)

clean:
	@rm -rf build
	@echo "clean:     removed build/"
