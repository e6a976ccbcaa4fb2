PYTHON ?= python3
BIN := .venv/bin
# `make demo EXPERIMENT=smoke` goes through the same steps on four tasks and two iterations, in about a minute.
EXPERIMENT ?= thesis
ifeq ($(EXPERIMENT),smoke)
DATASETS := smoke
TRAIN := schedule.iterations=2
else
DATASETS := train finetune test family
endif

.PHONY: setup demo report test lint bench gallery figures clean
setup: .venv/installed

.venv/installed: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet torch==2.13.0
	$(BIN)/pip install --quiet --editable '.[dev]'
	$(BIN)/pip install --quiet --no-deps gym-pusht==0.1.8
	touch $@

demo: setup
	for name in $(DATASETS); do $(BIN)/python -m datasets.generate dataset=$$name || exit $$?; done
	$(BIN)/python train.py stage=all experiment=$(EXPERIMENT) $(TRAIN)
	$(BIN)/python evaluate.py experiment=$(EXPERIMENT)

# With the tables and curves that `tests.benchmarks.ablations` and `data_size` left in build/extras (--extras), if any.
report: setup
	$(BIN)/python evaluate.py experiment=$(EXPERIMENT) $(if $(wildcard build/extras/*.json),extras=[build/extras])

test: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile

lint: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell expert datasets dlm certmanip examples tests docs configs README.md CHANGELOG.md train.py evaluate.py

bench: setup
	@status=0; for file in tests/benchmarks/[a-z]*.py; do \
		name=$$(basename $$file .py); echo "== $$name"; \
		$(BIN)/python -m tests.benchmarks.$$name $(BENCH) || status=1; done; exit $$status

# Pictures of docs/gallery.md: solve, check and draw every contact-trajectory problem that has a plan.
gallery: setup
	@mkdir -p build docs/gallery
	@for file in configs/problem/contact_trajectory/*.yaml; do \
		name=$$(basename $$file .yaml); echo "== $$name"; \
		$(BIN)/python -m expert solve $$file -o build/$$name.json || continue; \
		$(BIN)/python -m expert verify build/$$name.json -o build/$$name.certificate.json || exit 1; \
		for ending in png gif; do $(BIN)/python -m expert draw build/$$name.json -o docs/gallery/$$name.$$ending; done; \
	done

# Pictures of cages and grasps in docs/gallery.md (Fig. 5-14 to 5-17, 5-28 to 5-31): solve, verify and draw.
CAGES := random_03 random_05 random_09 t_wall hourglass_wall t_grippers m_grippers hourglass_grippers \
	hooks_3 hooks_4 hourglass_min hourglass_max m_min m_tripod t_tripod
figures: setup
	@mkdir -p build docs/gallery
	@for name in $(CAGES); do echo "== $$name"; \
		$(BIN)/python -m expert solve configs/problem/cage/$$name.yaml -o build/$$name.json || exit 1; \
		$(BIN)/python -m expert verify build/$$name.json || exit 1; \
		$(BIN)/python -m expert draw build/$$name.json -o docs/gallery/cage_$$name.png || exit 1; \
	done
	@for name in t hourglass random_06_3; do echo "== grasp $$name"; \
		$(BIN)/python -m expert solve configs/problem/certified_grasp/$$name.yaml -o build/$$name.json || exit 1; \
		$(BIN)/python -m expert verify build/$$name.json || exit 1; \
		for ending in png gif; do $(BIN)/python -m expert draw build/$$name.json -o docs/gallery/grasp_$$name.$$ending || exit 1; done; \
	done
	@for name in 28_random 29_overlays 30_attraction; do echo "== figure 5-$$name"; \
		$(BIN)/python examples/grasp_figures.py 5-$${name%%_*} -o docs/gallery/grasp_$${name#*_}.png || exit 1; \
	done
	$(BIN)/python examples/against_force_closure.py -o docs/gallery/grasp_force_closure.png

clean:
	find expert datasets dlm certmanip tests -name __pycache__ -prune -exec rm -rf {} +
	rm -rf .venv .mypy_cache .pytest_cache .ruff_cache .import_linter_cache *.egg-info
