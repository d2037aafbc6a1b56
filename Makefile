.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup run drive watch test test-long lint bench bench-sweep bench-loop bench-restarts soak compare docs colcon test-jazzy-versions clean

PYTHON = python3
VARIANT = symmetric_ode
LOSS_LAW = passive
DURATION = 10
RATE = 200
OUT = run
PYTEST_ARGS =
# a worker that has nothing left takes over half of what another still has
PARALLEL = -n auto --dist worksteal
PORT = 8350
WATCH_ARGS =
BENCH_ARGS =
COMPARE_ARGS =
EXTRAS = ros,bag,test

# The interpreter beneath any virtual environment, and where rclpy comes from:
# `ros`, a sourced ROS 2 in which it imports, or `pypi`, the wheels.
BASE := $(shell $(PYTHON) -c 'import sys; print(sys._base_executable)')
ROS := $(shell $(BASE) -c 'import rclpy' 2>/dev/null && echo ros || echo pypi)

PACKAGING := Makefile package.xml setup.cfg setup.py $(wildcard core/*.c core/*.h)
# pip writes console scripts to bin/ whatever setup.cfg says, if it builds by PEP 517.
PIP_INSTALL := bin/pip install --quiet --use-pep517

# What takes long says so; what cannot work says so at once.
OLD_PYTHON = import sys; sys.version_info < (3, 11) and sys.exit( \
  "make: dm_ros needs Python 3.11 or newer, $(BASE) is %d.%d: make PYTHON=..." % sys.version_info[:2])
define begin_venv
@$(BASE) -c '$(OLD_PYTHON)'
@echo "making $(@D), once: packages are fetched, which takes about a minute"
rm -rf $(@D)
endef

# What .venv-lint, .venv-bench, .venv-docs and .venv-jazzy hold, and what colcon adds to .venv.
lint := ruff==0.17.6
bench := --editable . mujoco==4.0.0 control==0.10.2
docs := rosdoc2==0.2.1 'gymnasium>=1.1'
colcon := colcon-common-extensions ros-jazzy-ament-package 'setuptools<80' wheel
jazzy := --editable '.[test,physics]' numpy==1.26.4 scipy==1.11.4

help:  ## print this
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile | expand -t 22

setup: .venv/$(ROS)  ## make .venv, with a sourced ROS 2 or else with its wheels from PyPI

# The last command makes the stamp: a .venv without it is made anew.
.venv/pypi: $(PACKAGING)
	$(begin_venv)
	$(BASE) -m venv .venv
	.venv/$(PIP_INSTALL) --editable '.[$(EXTRAS)]'
	touch $@

# Needs no network when rosdep has installed the dependencies; numpy stays the one of ROS.
.venv/ros: $(PACKAGING)
	$(begin_venv)
	$(BASE) -m venv --system-site-packages .venv
	.venv/$(PIP_INSTALL) setuptools wheel
	.venv/$(PIP_INSTALL) --no-build-isolation --editable '.[test]' \
	  "numpy==$$(.venv/bin/python -c 'import numpy; print(numpy.__version__)')"
	touch $@

.venv-%/done: $(PACKAGING)
	$(begin_venv)
	$(BASE) -m venv $(@D)
	env -u PYTHONPATH $(@D)/$(PIP_INSTALL) $($*)
	touch $@

run: setup  ## run the demo: VARIANT, LOSS_LAW, DURATION in s, RATE in Hz, OUT a folder
	@echo "running the demo: $(DURATION) s and some"
	.venv/bin/demo --variant $(VARIANT) --loss-law $(LOSS_LAW) --duration $(DURATION) --rate $(RATE) --out $(OUT)

drive: setup  ## run the demo of a driveline: a start on ice, a picture and bags in OUT
	@echo "driving twice: some seconds"
	ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST MPLBACKEND=Agg \
	  .venv/bin/python examples/driveline_controllers.py --drive --out $(OUT)

watch: setup  ## serve a page that shows a running node: PORT, WATCH_ARGS such as --control
	ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST .venv/bin/watch --port $(PORT) $(WATCH_ARGS)

test: setup  ## run the tests: PYTEST_ARGS
	@echo "running the tests: some minutes on two cores"
	ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_PYTHON_CHECK_FIELDS=1 MPLBACKEND=Agg \
	  .venv/bin/python -m pytest $(PARALLEL) $(PYTEST_ARGS)

compare: setup  ## compare all variants as the paper does, on a page in comparison/: COMPARE_ARGS
	.venv/bin/compare_variants $(COMPARE_ARGS)

test-long: setup  ## run the long tests: random parameters by the 100,000, a day of simulated time
	ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_PYTHON_CHECK_FIELDS=1 MPLBACKEND=Agg \
	  .venv/bin/python -m pytest -s test/long $(PYTEST_ARGS)

bench: .venv-bench/done  ## measure what a step costs, beside other tools, and how exact it is: BENCH_ARGS
	env -u PYTHONPATH .venv-bench/bin/python bench/step.py $(BENCH_ARGS)
	env -u PYTHONPATH .venv-bench/bin/python bench/half_shafts.py $(BENCH_ARGS)
	env -u PYTHONPATH .venv-bench/bin/python bench/ensemble.py $(BENCH_ARGS)
	env -u PYTHONPATH .venv-bench/bin/python bench/driveline.py $(BENCH_ARGS)

bench-sweep: setup  ## measure how time and memory of sweeps grow with the sets: BENCH_ARGS
	.venv/bin/python bench/sweep.py $(BENCH_ARGS)

bench-loop: setup  ## measure how the node holds its rate, beside a loop in C: BENCH_ARGS
	.venv/bin/python bench/loop.py $(BENCH_ARGS)

bench-restarts: setup  ## measure what subscribers that are killed cost the node, by transport: BENCH_ARGS
	.venv/bin/python bench/restarts.py $(BENCH_ARGS)

soak: setup  ## run the node for an hour, or DURATION s, and look at memory and rate
	.venv/bin/python bench/soak.py $(if $(filter command line,$(origin DURATION)),--duration $(DURATION))

lint: .venv-lint/done  ## check the style
	.venv-lint/bin/ruff check

docs: .venv-docs/done  ## make web pages of doc/ and of the library in docs_output/, by rosdoc2
	rm -rf docs_build docs_output cross_reference
	mkdir docs_build
	env -u PYTHONPATH PATH="$(CURDIR)/.venv-docs/bin:$$PATH" rosdoc2 build --package-path . \
	  >docs_build/log 2>&1 || { cat docs_build/log; false; }
	! grep -E '(WARNING|ERROR|CRITICAL):' docs_build/log

.venv/colcon: .venv/$(ROS)
	test $(ROS) = ros || .venv/$(PIP_INSTALL) $(colcon)
	touch $@

colcon: .venv/colcon  ## build the package with colcon, check what it installs, start its node
	rm -rf build install log
	PATH="$(CURDIR)/.venv/bin:$$PATH" colcon build
	test -f install/dm_ros/share/dm_ros/package.xml
	test -f install/dm_ros/share/dm_ros/config/presets/locker.yaml
	test -f install/dm_ros/share/dm_ros/config/ros2_control/lsd_controllers.yaml
	test -f install/dm_ros/share/dm_ros/config/layouts/plotjuggler_lsd.xml
	test -f install/dm_ros/share/dm_ros/launch/differential.launch.py
	test -f install/dm_ros/lib/python*/site-packages/dm_ros/watch/web/uplot/uPlot.iife.min.js
	test -f install/dm_ros/lib/python*/site-packages/dm_ros/sources/fmi/fmu.c
	ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST timeout --preserve-status -s INT 5 \
	  install/dm_ros/lib/dm_ros/differential --ros-args -p variant:=lsd_ode -p rate:=500.0 \
	  --params-file install/dm_ros/share/dm_ros/config/lsd.yaml

test-jazzy-versions: .venv-jazzy/done  ## run the tests without ROS on Jazzy's numpy and scipy, all steps in Python
	env -u PYTHONPATH MPLBACKEND=Agg DM_ROS_CORE=python .venv-jazzy/bin/python -m pytest $(PARALLEL) \
	  --ignore=test/ros $(PYTEST_ARGS)

clean:  ## remove all that the other targets make
	rm -rf .venv .venv-* build install log run comparison docs_build docs_output cross_reference \
	  dm_ros/_core.abi3.so *.egg-info .hypothesis .pytest_cache .ruff_cache
