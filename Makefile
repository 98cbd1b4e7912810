# `make demo` and `make test` set up everything they need in .venv; `make help` lists the rest.

PYTHON ?= python3
EXTRAS ?= test
BIN    := .venv/bin
WORKERS = --numprocesses auto --maxprocesses 8 --dist worksteal

.DEFAULT_GOAL := help
.PHONY: help demo test test-all lowest vectors fuzz lint format figures bench experiments adapters kaitai site gpu clean

help:            ## list the commands
	@grep -hE '^[a-z-]+: .*##|^[a-z-]+:  *##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 12

# One stamp for each set of extras: a second `make` starts at once.
.venv/.ready-%: pyproject.toml conformance/pyproject.toml
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$*]' --editable ./conformance
	@touch $@

demo: .venv/.ready-progress            ## encode, decode and compare the built-in clip; writes demo/report.html
	$(BIN)/gsvc demo

test: .venv/.ready-$(EXTRAS)            ## run the tests, in 4 minutes on two cores (EXTRAS=test,peers also compares with PyTorch)
	$(BIN)/python -m pytest $(WORKERS) -m 'not exhaustive'

test-all: .venv/.ready-$(EXTRAS)            ## run all tests, also those that take long
	$(BIN)/python -m pytest $(WORKERS)

.venv-lowest/.ready-%: pyproject.toml conformance/pyproject.toml tests/supply_chain/lowest.txt
	@test -x .venv-lowest/bin/python || $(PYTHON) -m venv .venv-lowest
	.venv-lowest/bin/python -m pip install --quiet --disable-pip-version-check \
		--constraint tests/supply_chain/lowest.txt --editable '.[$*]' --editable ./conformance
	@touch $@

lowest: .venv-lowest/.ready-$(EXTRAS)            ## judge vectors and run tests of kernels with the lowest version of each package, in .venv-lowest
	.venv-lowest/bin/gsvc-conformance run --reference --quiet --show 3
	.venv-lowest/bin/python -m pytest $(WORKERS) -m 'not exhaustive' --versions

vectors: .venv/.ready-all            ## write vectors/ again from the kit's cases (about 25 minutes of processor time, shared among the cores)
	$(BIN)/gsvc-conformance generate
	$(BIN)/gsvc-conformance list --markdown conformance/protocol.md
	$(BIN)/gsvc-conformance verify

fuzz: .venv/.ready-test            ## fuzz the parser and the commands for some minutes, by a seed
	$(BIN)/python -m tests.hostile.fuzz parser --runs 100000 --jobs 2
	for entry in dump info cut concat export decode salvage listing import scene log; do \
		$(BIN)/python -m tests.hostile.fuzz $$entry --runs 2000 --jobs 2 || exit 1; done

lint: .venv/.ready-lint            ## check style and types
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy

format: .venv/.ready-lint            ## put the code into the house style
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

figures: .venv/.ready-all,clips            ## measure the tables of docs/encode-and-look.md (about 15 minutes)
	$(BIN)/python -m gsvc_lab.benchmarks.clips
	$(BIN)/python -m gsvc_lab.benchmarks.clips --preset paper --frames 2

bench: .venv/.ready-peers,all,clips            ## measure speed, memory and cold start (about 8 minutes; LIMIT=FOLDER: the C++ limit too)
	$(BIN)/python -m gsvc_lab.benchmarks $(if $(LIMIT),--limit $(LIMIT))

experiments: .venv/.ready-experiments            ## the paper's experiments, small versions (FULL=1: large; UVG=FOLDER: on UVG instead)
	$(BIN)/python -m gsvc_lab.experiments $(if $(FULL),--full) $(if $(UVG),--uvg $(UVG))

adapters: .venv/.ready-test,adapters,peers            ## judge and measure the adapters that run here; writes docs/reports/
	-$(BIN)/gsvc-conformance run --reference $(call report,gsvc_ref)
	-$(BIN)/gsvc-conformance run --serve "$(BIN)/python -m gsvc_conformance.adapters.c --serve" $(call report,c)
	-$(BIN)/gsvc-conformance run --module gsvc_conformance.adapters.opencl $(call report,opencl)
	-GSVC_CUDA=fibers $(BIN)/gsvc-conformance run --module gsvc_conformance.adapters.cuda $(call report,cuda-fibers)
	-$(BIN)/gsvc-conformance run --module gsvc_conformance.adapters.pytorch $(call report,pytorch)
	-$(BIN)/gsvc-conformance run --module gsvc_conformance.adapters.webgpu $(call report,webgpu)
	-GSVC_WEB_RENDERER=webgl2 $(BIN)/gsvc-conformance run --module gsvc_conformance.adapters.web $(call report,web-webgl2)
	-GSVC_WEB_RENDERER=webgpu $(BIN)/gsvc-conformance run --module gsvc_conformance.adapters.web $(call report,web-webgpu)
	-$(BIN)/gsvc-conformance run --module gsvc_conformance.adapters.gsplat_cuda $(call report,gsplat_cuda) \
		--waivers conformance/gsvc_conformance/adapters/gsplat_cuda/expected_failures.toml
	-PYTHONPATH=tests/adapters $(BIN)/gsvc-conformance run --module gsplat_predicted $(call report,gsplat_cuda-predicted)
	$(BIN)/python -m gsvc_lab.benchmarks.adapters --json docs/reports/speeds.json
	$(compare)

gpu: .venv/.ready-test,adapters,peers,cuda            ## judge and measure what runs on this machine's GPU; writes docs/reports/ (ONLY: these parts)
	$(BIN)/python -m tests.gpu $(ONLY:%=--only %); status=$$?; [ $$status = 2 ] || $(compare); exit $$status

kaitai: .venv/.ready-test,kaitai            ## compile docs/gsvc.ksy, parse all vectors with it and draw docs/gsvc.svg (npm, node and graphviz)
	npm install --silent --no-fund --no-audit --prefix .venv/kaitai kaitai-struct-compiler@0.11.0 js-yaml@5.5.0
	$(BIN)/python -m pytest tests/kaitai
	$(BIN)/python -m tests.kaitai.diagram

site: .venv/.ready-site            ## write the documents as a static site into site/, which opens from a disk
	$(BIN)/python -m gsvc_lab.site

compare = $(BIN)/gsvc-conformance compare $$(LC_ALL=C ls docs/reports/*.json | grep -v /speeds) \
	$$(LC_ALL=C ls docs/reports/speeds*.json | sed 's/^/--speeds /') --markdown docs/reports/README.md
report = --quiet --show 3 --json docs/reports/$(1).json --html docs/reports/$(1).html

clean:            ## remove what the other commands made
	rm -rf .venv .venv-lowest demo gsvc_lab/benchmarks/cache experiments site .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage dist
	find . -name __pycache__ -prune -exec rm -rf {} +
