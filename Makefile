# Every target sets up what it needs: a virtual environment in .venv, with the versions of deploy/constraints.txt.
PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/pip install --disable-pip-version-check --quiet --constraint deploy/constraints.txt
DEMO := tests/fixtures/demo
OUT ?= data/train
COUNT ?= 8000
SEED ?= 1
SCENES ?= export/vm_synth/polyhaven.toml
NETWORKS := ball soccer
BUILD ?= build/networks
PICTURES ?= data/varied
CALIBRATION ?= data/calibration
CALIBRATE := $(BIN)/vm-evaluate calibrate --radius-of scene
CANARY := --canary vm_embedded/models/canary.jpg export/networks/canary.yaml
TEST ?= data/test
TARGET ?= linux_x86_64-cp311

.PHONY: help setup demo test fuzz soak lint matrix release bundle deb deploy logs lock bench bench-external bench-synth bench-train data networks test-data score choices look-choices peers fixtures docs site clean
.DELETE_ON_ERROR:

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup: .venv/dev ## install everything for development: runtime, torch, tests

demo: .venv/runtime ## find balls and field features in the twelve test pictures
	@$(BIN)/vm-detect --model soccer --camera $(DEMO) --no-json --save-overlay demo-out
	@echo "Annotated pictures: $(CURDIR)/demo-out/"

test: lint ## lint and tests (10 to 15 minutes); LONG=1 adds the long ones (40 to 70 minutes): camera faults, a booted robot
	$(BIN)/python deploy/bundle.py --download
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder $(if $(LONG),,-m 'not long')

SECONDS ?= 3600
fuzz: .venv/dev ## attack everything that reads outside inputs: make fuzz [TARGETS='lens web'] [SECONDS=3600 for each] [SEED=1]
	$(BIN)/python -m tests.fuzz.run $(TARGETS) --seconds $(SECONDS) --seed $(SEED)

soak: .venv/dev ## 12,000 camera faults, a million calls of detect, thousands of connections: make soak [SOAKS='calls connections'] (80 minutes)
	$(BIN)/python -m tests.soak.run $(SOAKS)

lint: .venv/dev ## style, spelling and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell
	$(BIN)/mypy

matrix: .venv/dev ## test the runtime with each Python from 3.10 to 3.14 that is here, the oldest and the newest numpy
	$(BIN)/python -m tests.matrix

release: need-VERSION .venv/dev ## make a release in dist/: make release VERSION=0.2.0 [URL=https://HOST/OWNER/NAME]
	$(BIN)/python deploy/release.py $(VERSION) $(if $(URL),--url '$(URL)')

bundle: .venv/bundle ## pack all that a robot needs in one file: make bundle [MODEL=model.onnx] [CONFIG=vm.toml] [TARGET=linux_x86_64-cp311] [KEY=id_ed25519]
	$(BIN)/python deploy/bundle.py --target $(TARGET) $(if $(MODEL),--model '$(MODEL)') $(if $(CONFIG),--config '$(CONFIG)') $(if $(KEY),--key '$(KEY)')

BUNDLE = dist/vm-embedded-robot-$(shell sed -n 's/^__version__ = "\(.*\)"/\1/p' vm_embedded/__init__.py)-$(TARGET).tar.gz

deb: bundle ## pack the bundle as a Debian package
	$(BIN)/python deploy/debian.py $(BUNDLE)

deploy: need-ROBOT ## bundle, copy, install, and show the detections: make deploy ROBOT=user@host [MODEL=] [CONFIG=] [TARGET=] [KEY=] [OPTIONS=--allow-older]
	@$(MAKE) bundle
	sh deploy/deploy.sh $(BUNDLE) $(ROBOT) $(OPTIONS)

logs: need-ROBOT ## follow the log of a robot: make logs ROBOT=user@host
	ssh $(ROBOT) 'if [ "$$(id -u)" = 0 ]; then s=; else s=sudo; fi; $$s journalctl --unit vm-detect --lines 50 --follow'

lock: ## choose the robot's packages, and write their hashes to deploy/robot.txt
	$(PYTHON) -m venv build/lock
	build/lock/bin/pip install --disable-pip-version-check --quiet 'pip-tools>=7.4,<8'
	cd deploy && echo installer | CUSTOM_COMPILE_COMMAND='make lock' ../build/lock/bin/pip-compile --quiet --generate-hashes \
		--strip-extras --no-emit-index-url --no-emit-find-links --no-emit-trusted-host --no-annotate \
		--constraint constraints.txt --output-file robot.txt ../pyproject.toml -

bench: .venv/bench ## measure the speed, also of other detectors; write docs/performance.md (10 minutes)
	$(BIN)/python -m benchmarks.run
	$(BIN)/python -m benchmarks.instruction_sets
	$(BIN)/python -m benchmarks.report

bench-external: need-PEER .venv/runtime ## compare with another program, see benchmarks/external.py: make bench-external PEER='./engine' [MODEL=ball]
	$(BIN)/python -m benchmarks.external '$(PEER)' $(if $(MODEL),--model '$(MODEL)')

data: need-HDRI .venv/synth ## render a training set: make data HDRI=folder-of-maps [OUT=data/train] [COUNT=8000] [SEED=1] [SCENES=a.toml]
	$(BIN)/vm-synth $(OUT) --count $(COUNT) --hdri $(HDRI) --seed $(SEED) --config $(SCENES)

networks: need-HDRI .venv/dev ## train the networks of the package from their seeds: make networks HDRI=folder-of-maps (hours)
	$(MAKE) data OUT=$(PICTURES) COUNT=16000 SEED=1 SCENES=export/vm_synth/varied.toml
	$(BIN)/python -m benchmarks.calibration_data $(HDRI) $(CALIBRATION)
	$(MAKE) $(NETWORKS:%=vm_embedded/models/%.onnx)
	$(BIN)/python -c "from pathlib import Path; from vm_train.tuning.rendered_patches import RENDERED; \
		from vm_train.tuning.run import write_sample; write_sample(RENDERED, Path('$(BUILD)/look'))"

# Train in the folder of the target, with the first prerequisite as configuration, or go on with that training.
train = if test -e $(@D)/run.json; then $(BIN)/vm-train resume $(@D); else $(BIN)/vm-train $(1) -o $(@D) --config $<; fi

.PRECIOUS: $(BUILD)/%/model.pt $(BUILD)/look/look.pt
$(BUILD)/ball/model.pt $(BUILD)/soccer/model.pt: $(BUILD)/%/model.pt: export/networks/%.toml
	$(call train,$(PICTURES) --unpacked $(BUILD)/unpacked)

$(BUILD)/look/look.pt: export/networks/look.toml $(BUILD)/soccer/model.pt
	$(call train,look $(PICTURES) --from $(BUILD)/soccer/model.pt)

$(BUILD)/%.onnx: $(BUILD)/%/model.pt $(BUILD)/look/look.pt
	$(BIN)/vm-export $< --look $(BUILD)/look/look.pt $(CANARY) -o $@

vm_embedded/models/%.onnx: $(BUILD)/%.onnx
	$(CALIBRATE) $< $(CALIBRATION)/* -o $@

test-data: need-HDRI .venv/synth ## render the test sets: make test-data HDRI=folder-of-maps (an hour)
	$(BIN)/python -m benchmarks.test_data $(HDRI) $(TEST)

score: .venv/dev ## evaluate the networks of the package; write docs/results.md: make score [TEST=data/test] (10 minutes)
	$(BIN)/python -m benchmarks.shipped $(TEST)
	$(BIN)/python -m benchmarks.field $(TEST)
	$(BIN)/python -m benchmarks.shipped_report

bench-synth: need-HDRI .venv/synth ## measure vm-synth: make bench-synth HDRI=folder-of-maps (8 minutes)
	$(BIN)/python -m benchmarks.synth $(HDRI)

bench-train: need-DATA .venv/dev ## measure vm-train: make bench-train DATA=folder-of-pictures (5 minutes)
	$(BIN)/python -m benchmarks.training $(DATA)

choices: .venv/dev ## measure what each choice of a training is worth: make choices [TEST=data/test], after networks and test-data (hours)
	$(BIN)/python -m benchmarks.choices $(PICTURES) $(TEST)/field build/choices
	$(BIN)/python -m benchmarks.choices_report

look-choices: .venv/dev ## measure what each choice of a close look is worth: make look-choices [TEST=data/test], after networks and test-data (hours)
	$(BIN)/python -m benchmarks.look_choices $(PICTURES) $(TEST)/field build/look-choices
	$(BIN)/python -m benchmarks.look_choices_report

peers: need-HDRI .venv/bench ## train other detectors, and compare their speed and accuracy: make peers HDRI=folder-of-maps [TEST=data/test] (hours)
	$(MAKE) data OUT=data/peers COUNT=2500 SEED=1 SCENES=export/vm_synth/soccer.toml
	$(BIN)/python -m benchmarks.peers.train data/peers build/peers
	$(BIN)/python -m benchmarks.peers.train data/peers build/peers --lens rectilinear
	$(MAKE) build/peers/ball.onnx BUILD=build/peers PICTURES=data/peers
	$(MAKE) build/peers/rectilinear/ball.onnx BUILD=build/peers/rectilinear PICTURES=build/peers/rectilinear/pictures
	$(BIN)/python -m benchmarks.peers.score $(TEST) build/peers $(if $(wildcard ../shared/real),--shared ../shared)
	$(BIN)/python -m benchmarks.peers.score $(TEST) build/peers --lens rectilinear
	$(BIN)/python -m benchmarks.peers.times
	$(BIN)/python -m benchmarks.peers.report

fixtures: .venv/dev ## draw the frames of the tests and train their network again (about 20 minutes)
	$(BIN)/python -m tests.fixtures.make_drawn

docs: .venv/dev demo ## write the schema of the messages and the demo's picture again
	$(BIN)/python docs/help_pages.py
	$(BIN)/python docs/demo_picture.py

site: .venv/docs ## build docs/ as a web site in build/site, with pages of all options and of the Python API
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet --config-file docs/site/mkdocs.yml
	@echo "Open $(CURDIR)/build/site/index.html, or with search: $(BIN)/python -m http.server --directory build/site"

need-%:
	@test -n "$($*)" || { echo '$* is missing; make help shows how to give it'; exit 1; }

clean: ## remove everything that make made
	rm -rf .venv demo-out build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis

.venv/made:
	@$(PYTHON) -c 'import sys; sys.exit("vm-embedded needs Python 3.10 or newer, $(PYTHON) is " + sys.version.split()[0] + "; run make PYTHON=python3.11" if sys.version_info < (3, 10) else 0)'
	$(PYTHON) -m venv .venv
	@touch $@

.venv/runtime: .venv/made pyproject.toml deploy/constraints.txt
	$(PIP) --editable .
	@touch $@

.venv/dev: .venv/made pyproject.toml deploy/constraints.txt
	$(PIP) --editable '.[dev]'
	@touch $@ .venv/runtime .venv/docs

.venv/docs: .venv/made pyproject.toml deploy/constraints.txt
	$(PIP) --editable '.[docs]'
	@touch $@ .venv/runtime

.venv/bundle: .venv/made pyproject.toml deploy/constraints.txt
	$(PIP) --editable '.[bundle]'
	@touch $@ .venv/runtime

.venv/bench: .venv/made pyproject.toml deploy/constraints.txt
	$(PIP) --editable '.[dev,bench]'
	@touch $@ .venv/dev .venv/runtime .venv/docs

.venv/synth: .venv/made pyproject.toml deploy/constraints.txt
	$(PIP) --editable '.[synth]'
	@touch $@ .venv/runtime
