SHELL := bash
CONFIG ?= config/a4_position_joint.yaml
PYTEST_ARGS ?=
VIEW_ARGS ?=
# One more than cores: tests wait for processes now and then.
WORKERS ?= $(shell echo $$(($$(nproc) + 1)))
COURSE_ARGS ?=

.PHONY: help setup demo view course test lint bench faults figures docs docs-commands clean

help:
	@echo 'make setup   install everything into this folder and build the packages'
	@echo 'make demo    simulator and controller follow goals; report and recording in out/demo (CONFIG=$(CONFIG))'
	@echo 'make view    simulator, controller and a page in the browser (CONFIG=$(CONFIG))'
	@echo 'make course  the notebooks of the course in JupyterLab, without ROS'
	@echo 'make test    all tests (PYTEST_ARGS="-k name" selects)'
	@echo 'make lint    ruff, mypy and the checks of the ROS packages'
	@echo 'make bench   the benchmarks'
	@echo 'make faults  faults around the running controller, each one judged; table in docs/faults.md'
	@echo 'make figures pictures of all experiments, and docs/gallery.md with them'
	@echo 'make docs    the docs site, in out/site'
	@echo 'make docs-commands  commands of the pages that take long, in short forms; table in docs/commands.md'
	@echo 'make clean   remove everything that the other targets made'

setup:
	@tools/setup.sh

demo: setup
	@source ./setup.bash && install/tp_sim/lib/tp_sim/demo --config $(CONFIG) --out out/demo

view: setup
	@source ./setup.bash && install/tp_sim/lib/tp_sim/live --config $(CONFIG) $(VIEW_ARGS)

course: setup
	@course/start.sh $(COURSE_ARGS)

test: setup
	@source ./setup.bash && python -m pytest -n $(WORKERS) --dist loadfile $(PYTEST_ARGS)

lint: setup
	@source ./setup.bash && ruff check && ruff format --check && mypy && python tools/check_packages.py

bench: setup
	@source ./setup.bash && python benchmarks/run.py

faults: setup
	@source ./setup.bash && install/tp_sim/lib/tp_sim/faults --page docs/faults.md

figures: setup
	@source ./setup.bash && python examples/gallery/gallery.py

docs: setup
	@source ./setup.bash && NO_MKDOCS_2_WARNING=1 mkdocs build --strict --quiet -d out/site
	@echo 'docs: $(CURDIR)/out/site/index.html'
	@echo 'for the search: python3 -m http.server -d out/site, then http://localhost:8000'

docs-commands: setup
	@source ./setup.bash && python tools/docs_commands.py

clean:
	rm -rf .venv .venv-* build install log out .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
