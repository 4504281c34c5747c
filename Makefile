PYTHON ?= python3
BIN := .venv/bin
BENCH := .venv-bench/bin
PIP := -m pip --quiet --disable-pip-version-check
LAKE ?= lake
DIST ?= dist
SITE ?= site
# The folders of the repository under the names they are imported by, for tools that read the files.
LINKS = rm -rf .venv/src && mkdir -p .venv/src/motionlake && \
	ln -s $(CURDIR)/pipeline/* $(CURDIR)/jobs $(CURDIR)/sql .venv/src/motionlake/
STAGES := frames words embed motifs signatures mirrored postures symbols moves descriptors submotions windows graph shortlist
# What `make demo` takes in: by default the DeepMimic motions, fetched first.
DATA ?= demo/deepmimic
DEMO_LAKE = demo/$(notdir $(abspath $(DATA)))-lake
# New motion: a walk, a run, a dance, and a walk that becomes a run and a walk again, of the labelled clips.
MADE = $(BIN)/motionlake synthesize --seed 1 --lake "$(DEMO_LAKE)" --class
DEMO_SYNTHESIS = $(if $(filter demo/deepmimic,$(DATA)),$(BIN)/motionlake run synth --lake "$(DEMO_LAKE)" && \
	$(MADE) walk && $(MADE) run && $(MADE) dance && $(MADE) walk --class run --class walk --seconds 9 && \
	{ $(BIN)/motionlake run all --lake "$(DEMO_LAKE)" || test $$? = 1; } && \
	$(BIN)/motionlake view synthetic/walk+run+walk-s1-0001 --beside synthetic/walk-s1-0001 --beside synthetic/run-s1-0001 \
		--beside synthetic/dance-s1-0001 --out demo/made.html --lake "$(DEMO_LAKE)")
DEMO_QUERIES = $(if $(filter demo/deepmimic,$(DATA)),humanoid3d_walk humanoid3d_kick humanoid3d_dance_a,--sample 3)

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-browser web lint docs ingest all $(STAGES) neighbours transitions synth quality map status wheel bench-ingest bench-dtw bench-moves bench-emd bench-generalise bench-retrieval bench-scale bench-methods bench-service bench-browser bench-stages bench-nights bench-whole bench-workers bench-windows bench-representation bench-word-network bench-motif-weights bench-words bench-find bench-motion-graph bench-neighbours bench-segmentation bench-signatures bench-sorting bench-align bench-strings bench-pesta bench-quality bench-rigs bench-descriptor-search bench-deephums bench-glogen bench-synthesis bench-matching bench-made bench-blind bench-keyframes bench-style bench-text bench-kills bench-many bench-comparators bench-mutation bench-smoke fuzz records

help: ## Show this help
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 24

setup: .venv/.ready ## Make .venv with the pinned packages

# Every file by its hash but torch, of which each machine has its own build: no hash fits all.
.venv/.ready: requirements.lock requirements-torch.lock pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python $(PIP) install --no-deps -r requirements.lock
	$(BIN)/python $(PIP) install -r requirements-torch.lock
	$(BIN)/python $(PIP) install --no-deps --no-build-isolation --editable .
	touch $@

demo: setup $(if $(filter demo/deepmimic,$(DATA)),demo/deepmimic/labels.csv) ## Real clips through every stage to answered queries (DATA=folder: your own)
	$(BIN)/motionlake ingest "$(DATA)" --lake "$(DEMO_LAKE)" || test $$? = 1
	$(BIN)/motionlake run all --lake "$(DEMO_LAKE)" || test $$? = 1
	$(BIN)/motionlake status --lake "$(DEMO_LAKE)"
	$(BIN)/motionlake search $(DEMO_QUERIES) -k 3 --lake "$(DEMO_LAKE)"
	$(BIN)/motionlake sql "SELECT clip, rig, frames, round(seconds, 1) AS seconds FROM clips ORDER BY frames DESC LIMIT 5" \
		--lake "$(DEMO_LAKE)"
	$(DEMO_SYNTHESIS)
	@echo "look at it: $(BIN)/motionlake browse --lake \"$(DEMO_LAKE)\""

# What the motions show; none of them says so itself.
demo/deepmimic/labels.csv: docs/demo/labels.csv demo/deepmimic/.ready
	cp $< $@

demo/deepmimic/.ready: | setup
	rm -rf demo/wheel demo/deepmimic && mkdir -p demo/wheel
	$(BIN)/python $(PIP) download --no-deps --only-binary=:all: --python-version 3.11 \
		--platform manylinux2014_x86_64 --dest demo/wheel pybullet==3.2.7
	$(BIN)/python -m zipfile -e demo/wheel/pybullet-*.whl demo/wheel
	mv demo/wheel/pybullet_data/data/motions demo/deepmimic && rm -rf demo/wheel
	touch $@

# The checks run beside the tests, which wait now and then; either may fail.
test: setup ## Run the checks and all tests (MOTIONLAKE_DATA: folder of real recordings)
	@$(MAKE) --no-print-directory lint & lint=$$!; \
	$(BIN)/python -m pytest -n logical --maxprocesses 4 --dist loadfile --no-loadscope-reorder --ignore tests/browser; tests=$$?; \
	wait $$lint && exit $$tests

test-browser: setup ## Test the browser application in a headless Chromium (apt-get install chromium), and rebuild its bundle
	$(BIN)/python -m pytest tests/browser

web: ## Build the browser application anew (needs Node 20 and npm)
	cd pipeline/service/web && npm ci --no-audit --no-fund && npm run build

lint: setup ## Run ruff, mypy and the import contracts
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(LINKS)
	$(BIN)/mypy
	$(BIN)/mypy .ci/sbom.py
	$(BIN)/python -m bench.check_records
	$(BIN)/python -m bench.check_figures
	@said=$$(PYTHONPATH=.venv/src $(BIN)/lint-imports --no-cache 2>&1) || { echo "$$said"; exit 1; }

docs: setup ## Build the documentation into SITE=folder (site), every link checked
	$(LINKS)
	$(BIN)/mkdocs build --quiet --strict --site-dir "$(abspath $(SITE))"

ingest: setup ## Take the clips of SRC=folder into LAKE=folder
	$(BIN)/motionlake ingest "$(SRC)" --lake "$(LAKE)"

all: setup ## Bring every stage of LAKE=folder up to date
	$(BIN)/motionlake run all --lake "$(LAKE)"

frames: setup ## Stage: source files to canonical frames in Parquet
words: setup ## Stage: frames to the features and ranges of motion words
embed: setup ## Stage: train the word network if there is none, embed every word
motifs: setup ## Stage: cluster the words if there are no motifs, assign every word
signatures: setup ## Stage: tf-idf signatures of clips, ready for search
mirrored: setup ## Stage: the signature of every clip mirrored left to right
postures: setup ## Stage: train the posture dictionary if there is none, code every frame
symbols: setup ## Stage: coded frames to the symbol string of every clip
moves: setup ## Stage: joints at 12 frames a second, by whose moves clips are aligned
descriptors: setup ## Stage: train the descriptor network if there is none, one vector a clip
submotions: setup ## Stage: train the sub-motion encoder if there is none, vectors of the windows of clips
graph: setup ## Stage: the clips nearest to each clip, along which search goes
shortlist: setup ## Stage: short vectors by which a search chooses the clips that it compares
windows: setup ## Stage: codes of the windows of clips, by which pieces are looked for in a large lake
neighbours: setup ## Stage of its own: the nearest words of every word in other clips
	$(BIN)/motionlake run neighbours --lake "$(LAKE)"
transitions: setup ## Stage of its own: where clips of DATASET=name (all datasets) can be joined into motion graphs
	$(BIN)/motionlake run transitions $(if $(DATASET),--dataset "$(DATASET)") --lake "$(LAKE)"
synth: setup ## Stage of its own: a generator of motion, made of labelled clips or pretrained (then motionlake synthesize)
	$(BIN)/motionlake run synth --lake "$(LAKE)"
quality: setup ## Stage of its own: what of every clip no body did, by range, with a verdict
	$(BIN)/motionlake run quality --lake "$(LAKE)"
map: setup ## Stage of its own: where every clip lies on a map of all, near those that move like it
	$(BIN)/motionlake run map --lake "$(LAKE)"

$(STAGES):
	$(BIN)/motionlake run $@ --lake "$(LAKE)"

status: setup ## Show what LAKE=folder holds and lacks
	$(BIN)/motionlake status --lake "$(LAKE)"

wheel: setup ## Build the wheel into DIST=folder (dist), with its software bill of materials
	rm -rf build
	$(BIN)/python -m build --wheel --no-isolation --outdir $(DIST)
	$(BIN)/python .ci/sbom.py $(DIST)/motionlake-*.whl

.venv-bench/.ready: requirements-bench.lock requirements-torch.lock pyproject.toml
	test -x $(BENCH)/python || $(PYTHON) -m venv .venv-bench
	$(BENCH)/python $(PIP) install --no-deps -r requirements-bench.lock
	$(BENCH)/python $(PIP) install -r requirements-torch.lock
	$(BENCH)/python $(PIP) install --no-deps --no-build-isolation --editable .
	touch $@

bench-ingest: .venv-bench/.ready setup ## Measure reading against peers, then whole ingests: speed, memory, bytes a frame
	$(BENCH)/python -m bench.ingest peers
	$(BIN)/python -m bench.ingest_formats
	$(BIN)/python -m bench.lake ingest

bench-dtw: .venv-bench/.ready ## Measure word DTW against peers
	$(BENCH)/python -m bench.dtw

bench-scale: setup ## Measure the default search of 150,000 clips (twenty minutes to make them, FOLDER=folder keeps them)
	$(BIN)/python -m bench.scale_search $(if $(FOLDER),--folder "$(FOLDER)")

bench-methods: setup ## Measure every way to search the lake that bench-whole or bench-scale left in FOLDER=folder
	$(BIN)/python -m bench.scale_methods "$(FOLDER)"

bench-service: setup ## Measure searches of a service of 150,000 clips by twenty people at once (FOLDER=folder keeps the clips)
	$(BIN)/python -m bench.service_load $(if $(FOLDER),--folder "$(FOLDER)")

bench-browser: setup ## Measure the grid of the browser application in a lake of 150,000 clips: first paint, frames while scrolling
	$(BIN)/python -m bench.browser_scroll

bench-stages: setup ## Measure what every stage costs a frame, by lakes of more and more clips as long as BONES-SEED's
	$(BIN)/python -m bench.stages_cost

bench-whole: setup ## Measure a repository of CLIPS=n (142,220) clips indexed whole in FOLDER=folder (hours; it goes on there; AGAIN=n asks that lake again)
	$(BIN)/python -m bench.whole_lake "$(FOLDER)" $(if $(CLIPS),--clips $(CLIPS)) $(if $(AGAIN),--again $(AGAIN))

bench-workers: setup ## Measure how stages scale over one and two workers, and simulate up to 64
	$(BIN)/python -m bench.worker_scaling

bench-nights: setup ## Measure NIGHTS=n (30) runs of 50 new clips into one lake: time, files, catalog, what grows (FOLDER=folder keeps it)
	$(BIN)/python -m bench.nights $(if $(NIGHTS),--nights $(NIGHTS)) $(if $(FOLDER),--folder "$(FOLDER)")

bench-windows: setup ## Measure the search of pieces in a large lake by codes beside a scan of all vectors: recall, time
	$(BIN)/python -m bench.window_search

bench-quality: setup ## Measure how many faults planted in recordings are found
	$(BIN)/python -m bench.quality
	$(BIN)/python -m bench.quality_evidence

bench-moves: .venv-bench/.ready ## Measure the alignment of moves against a peer
	$(BENCH)/python -m bench.moves

bench-emd: setup ## Measure the search for nearest signatures against scanning with POT
	$(BIN)/python -m bench.emd

bench-generalise: setup ## Choose the constants of search with one set of recordings left out in turn
	$(BIN)/python -m bench.generalise

bench-retrieval: setup ## Measure retrieval on hdm05 beside its floors, and across rigs
	$(BIN)/python -m bench.retrieval hdm05
	$(BIN)/python -m bench.retrieval cross-rig

bench-representation: setup ## Measure words by raw numbers, DTW and networks, their length, K and the rest (minutes)
	$(BIN)/python -m bench.representation

bench-word-network: setup ## Measure the paper's word network beside closed forms, principal components and raw words (an hour)
	$(BIN)/python -m bench.word_network

bench-motif-weights: setup ## Measure signatures by quantity and density of motifs, with idf and without (minutes)
	$(BIN)/python -m bench.motif_weights

bench-words: setup ## Measure assigning words by DTW and by embedding, words embedded a second, a query from cold
	$(BIN)/python -m bench.words_speed

bench-motion-graph: setup ## Measure motion graphs with and without the constraint by signatures
	$(BIN)/python -m bench.motion_graph

bench-neighbours: setup ## Measure the 5 nearest of 1,000,000 words against brute force (WORDS=n: fewer)
	$(BIN)/python -m bench.neighbours $(if $(WORDS),--words $(WORDS))

bench-find: setup ## Measure query by example beside sub-sequence DTW, and copies found among all recordings
	$(BIN)/python -m bench.query_by_example --words 5
	$(BIN)/python -m bench.query_by_example --words 11
	$(BIN)/python -m bench.duplicates

bench-segmentation: setup ## Measure segmentation: exercises by the other takes, 86_01 by other sets
	$(BIN)/python -m bench.segmentation

bench-signatures: setup ## Measure retrieval, classification and clustering on four sets, twice each
	$(BIN)/python -m bench.signatures

bench-comparators: setup ## Measure the methods that Deep Motifs compares itself with (minutes)
	$(BIN)/python -m bench.comparators

bench-rigs: setup ## Measure how many joints and limbs of hidden rig maps are found again
	$(BIN)/python -m bench.rigs

bench-sorting: setup ## Measure clusters and classes of whole clips beside DTW
	$(BIN)/python -m bench.sorting

bench-align: .venv-bench/.ready ## Measure strided alignment against librosa
	$(BENCH)/python -m bench.align

bench-strings: setup ## Measure sub-queries of a long query against fresh scans, tandem repeats against a suffix array
	$(BIN)/python -m bench.strings

bench-pesta: setup ## Measure PESTA as the paper does: tables 3 to 6, figure 8, ablations (hours; PARTS="whole ...": some)
	$(BIN)/python -m bench.pesta $(PARTS)

bench-descriptor-search: setup ## Measure the search for nearest descriptors against numpy, scikit-learn and DuckDB
	$(BIN)/python -m bench.descriptor_search

bench-deephums: setup ## Measure descriptors as the thesis does, with baselines, robustness, choices, pieces (hours; PARTS="retrieval ...": some)
	$(BIN)/python -m bench.deephums $(PARTS)

bench-synthesis: setup ## Measure how fast motion is made: 1, 100 and 1,000 clips in a lake, the networks beside acLSTM
	$(BIN)/python -m bench.synthesis_speed

bench-matching: setup ## Measure motion matching: changes of class, a figure of eight, speed
	$(BIN)/python -m bench.matching

bench-made: setup ## Measure made motion beside real: classes, likeness, copies, errors (hours; KEEP=folder goes on from there)
	$(BIN)/python -m bench.made table $(if $(KEEP),--keep "$(KEEP)")
	$(BIN)/python -m bench.made errors $(if $(KEEP),--keep "$(KEEP)")

bench-blind: setup ## Draw a page of pairs, real and made, into FOLDER=folder; the guesses are judged by python -m bench.made judge
	$(BIN)/python -m bench.made blind "$(FOLDER)"

bench-keyframes: setup ## Measure motion through keyframes of clips left out, beside interpolated poses
	$(BIN)/python -m bench.keyframes

bench-style: setup ## Measure whether motion made in the manner of a clip is nearer to it
	$(BIN)/python -m bench.style

bench-glogen: setup ## Measure synthesis beside its baselines: sparse poses, real time, ablations (hours; PARTS="sparse ...": some)
	$(BIN)/python -m bench.glogen $(PARTS)

bench-text: setup ## Measure the search in words, its speed among 150,000 clips, and suggested labels (minutes)
	$(BIN)/python -m bench.text_search queries speed labels

bench-kills: setup ## Kill drivers, workers and schedulers at random moments, compare all tables (KILLS=100)
	$(BIN)/python -m bench.kills --kills $(or $(KILLS),100)

bench-many: setup ## Four writers and eight readers on one lake at once (SECONDS=600)
	$(BIN)/python -m bench.many_at_once --seconds $(or $(SECONDS),600)

bench-mutation: setup ## Plant faults in alignment, symbols, EMD, DTW, losses and keys, count those that tests find (an hour; SAMPLE=n SEED=n KEEP=folder)
	$(BIN)/python -m bench.mutation --sample $(or $(SAMPLE),40) $(if $(SEED),--seed $(SEED)) --processes 2 $(if $(KEEP),--keep "$(KEEP)")

fuzz: setup ## Damage 10,000 files and take them in; then readers, configuration, labels, SQL by hypothesis (FILES=n EXAMPLES=n SEED=n)
	$(BIN)/python -m bench.fuzz --files $(or $(FILES),10000) --examples $(or $(EXAMPLES),2000) --seed $(or $(SEED),0)

records: setup ## Check that every record that docs name is there and was made from a clean tree
	$(BIN)/python -m bench.check_records --history

bench-smoke: setup ## Run every bench once on few and short recordings, to see that it works (2 minutes)
	$(BIN)/python -m bench.smoke --processes 2
