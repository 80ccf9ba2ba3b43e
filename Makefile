# The front doors of Engram. Every target sets up what it needs and skips what is done.
# SEED=n selects another series of tasks, JOBS=n the number of parallel compilations, PYTHON=... the interpreter.
SHELL := /bin/bash
export JOBS PYTHON SEED

.PHONY: help demo test bench tables clean setup
help:
	@echo "make demo    run the arm that remembers: video, report and summary in runs/<time>/   (SEED=n)"
	@echo "make test    build everything and run every test"
	@echo "make bench   time the controller beside its peers"
	@echo "make tables  rebuild the generated tables from models/ and data"
	@echo "make clean   remove everything that was built (runs/ and .venv/ stay)"

setup:
	@scripts/setup.sh

demo: setup
	@scripts/demo.sh

test: setup
	@scripts/test.sh

bench: setup
	@.venv/bin/python bench/run.py $(ARGS)

tables: setup
	@scripts/tables.sh

clean:
	@rm -rf build
	@echo "clean:     removed build/"
