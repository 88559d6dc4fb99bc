# Every target sets up what it needs and does nothing twice.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
PY := .venv/bin/python
SYSTEM_LIBRARIES := libusb-1.0-0 libgl1 libegl1 libx11-6 libgomp1
TEST_PACKAGES := postgresql chromium
HOST ?= 127.0.0.1
PORT ?= 8000
FUZZ_SECONDS ?= 300
SOAK_SECONDS ?= 3600

.PHONY: help setup page site run demo cluster test coverage chaos soak attack check format openapi lock bench paper peers fuzz clean
.DEFAULT_GOAL := help

help:  ## list the targets
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup:  ## make .venv, install everything from the lock file, build page and site
	@$(MAKE) --no-print-directory --jobs=2 .venv/.kernels .venv/.bytecode page site

web/node_modules/.package-lock.json: .venv/.installed web/package-lock.json
	$(PY) -m tools.build_page --packages

page: service/api/static/page/index.html  ## build the page of the service from web/

service/api/static/page/index.html: web/node_modules/.package-lock.json tools/build_page.py tools/node.py $(filter-out web/node_modules,$(wildcard web/* web/src/*))
	$(PY) -m tools.build_page
	@touch $@

site: service/api/static/docs/index.html  ## build the site of the documents, warnings as errors

service/api/static/docs/index.html: web/node_modules/.package-lock.json $(addprefix tools/,build_site.py diagrams.py node.py) web/diagrams.mjs zensical.toml $(wildcard *.md docs/*.md docs/*/*) mpe_client/README.md
	$(PY) -m tools.build_site
	@touch $@

# the lock file is complete; without --no-deps old releases of pip take later versions of what has extras
PIP_INSTALL := $(PY) -m pip install --quiet --no-compile --no-deps

# what the service runs on comes first: the kernels compile while pip unpacks the rest
.venv/.core: requirements.lock Makefile
	@tools/install_system_packages $(SYSTEM_LIBRARIES)
	@test -x $(PY) || python3 -m venv .venv
	$(PIP_INSTALL) --require-hashes -r $<
	@touch $@

.venv/.installed: .venv/.core requirements-dev.lock pyproject.toml
	$(PIP_INSTALL) --require-hashes -r requirements-dev.lock
	$(PIP_INSTALL) --no-build-isolation --editable .
	@touch $@

# pip would do it before anything else can begin; some packages hold files that are no Python 3;
# where PYTHONDONTWRITEBYTECODE is set, every process would compile the project again
.venv/.bytecode: .venv/.installed
	@$(PY) -m compileall -qq .venv/lib mpe_client mpe_core service || true
	@touch $@

# numba's cache does not see that a kernel of another file, compiled into this one, has changed
.venv/.kernels: .venv/.core $(wildcard mpe_core/kernels/*.py)
	@rm -f mpe_core/kernels/__pycache__/*.nb[ic]
	$(PY) -c 'from mpe_core import register; from mpe_core.kernels import decimal_rows'  # compiles the kernels into the cache
	@touch $@

run: setup  ## serve on HOST:PORT (127.0.0.1:8000)
	.venv/bin/mpe serve --host $(HOST) --port $(PORT)

demo: setup  ## align two generated scans of a turbine blade, or SOURCE=a.ply TARGET=b.ply
	$(PY) -m benchmarks.demo $(if $(SOURCE),--source "$(SOURCE)") $(if $(TARGET),--target "$(TARGET)")

cluster: setup  ## PostgreSQL, an S3 store, 2 services for the API, 2 workers on one machine; the demo; PORT
	@tools/install_system_packages postgresql
	$(PY) -m benchmarks.cluster_demo --port $(PORT)

test: setup  ## all tests
	@tools/install_system_packages $(TEST_PACKAGES)
	$(PY) -m pytest $(IN_PARALLEL)

coverage: setup  ## all tests, with the coverage of both packages
	@tools/install_system_packages $(TEST_PACKAGES)
	$(PY) -m pytest --cov $(IN_PARALLEL)

# one process more than cores, because many tests wait; slow files first, small unit tests fill the end
IN_PARALLEL = --numprocesses $$(($$(nproc) + 1)) --dist loadfile --no-loadscope-reorder

chaos: setup  ## 300 jobs while the server is killed, suspended and its clock set, 25 times; 500 in a cluster
	@tools/install_system_packages postgresql
	$(PY) -m tests.e2e.chaos
	$(PY) -m tests.e2e.cluster_chaos

soak: setup  ## an hour of 64 clients, some hostile, kills, suspensions, full disks (SOAK_SECONDS)
	$(PY) -m tests.e2e.soak --seconds $(SOAK_SECONDS)

attack: setup  ## how fast /livez answers under each attack, and under all together
	$(PY) -m tests.e2e.attacks

check: setup  ## formatting, lint, types, import rules, licences, known vulnerabilities
	.venv/bin/ruff format --check .
	.venv/bin/ruff check .
	.venv/bin/mypy
	.venv/bin/lint-imports
	$(PY) -m tools.structure
	$(PY) -m tools.check_supply

format: setup  ## put the formatting right
	.venv/bin/ruff format .
	.venv/bin/ruff check --fix .

openapi: setup  ## write openapi.yaml and docs/reference from the code
	$(PY) -m tools.print_openapi > .openapi.yaml && mv .openapi.yaml openapi.yaml
	$(PY) -m tools.reference_pages

lock: setup  ## resolve the lock files again from pyproject.toml
	.venv/bin/uv pip compile pyproject.toml --extra service --extra postgres --extra s3 $(LOCK_OPTIONS) -o requirements.lock
	.venv/bin/uv pip compile pyproject.toml --all-extras $(LOCK_OPTIONS) -o requirements-dev.lock
LOCK_OPTIONS := --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate --no-emit-index-url --no-emit-find-links

bench: setup  ## speed and accuracy beside the peers, what is not there yet (20 minutes)
	@$(WITH_PEERS)
	$(PY) -m benchmarks

paper: setup  ## the paper's experiments beside ours, what is not there yet (30 minutes)
	@$(WITH_PEERS)
	$(PY) -m benchmarks.paper

WITH_PEERS := $(MAKE) --no-print-directory peers || echo "!!! NOT EVERY PEER IS INSTALLED: its rows will say so" >&2

peers: setup build/peers/.installed build/pcl/pcl_driver  ## PCL's driver and probreg, for the benchmarks alone

build/peers/.installed: benchmarks/requirements-peers.txt
	@tools/install_system_packages g++
	$(PY) -m pip install --quiet --no-deps --require-hashes --upgrade --target $(@D) -r $<
	@touch $@

build/pcl/pcl_driver: benchmarks/pcl/driver.cpp
	@tools/install_system_packages g++ libpcl-dev
	@mkdir -p $(@D)
	g++ -O3 -fopenmp -std=c++17 $(addprefix -isystem ,$(wildcard /usr/include/pcl-* /usr/include/eigen3)) $< -o $@ $(PCL_LIBRARIES)
PCL_LIBRARIES := $(addprefix -lpcl_,surface registration features filters search kdtree sample_consensus common) -lflann_cpp -llz4

fuzz: setup  ## fuzz every reader of files and the API, FUZZ_SECONDS (300) each
	$(PY) -m tests.fuzz $(FUZZ_SECONDS)

clean:  ## remove what the other targets made
	rm -rf .venv web/node_modules service/api/static .mypy_cache .ruff_cache .pytest_cache .import_linter_cache build
