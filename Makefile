# Two commands do everything on a fresh Debian with Python 3.11: `make demo` and `make test`.
# Both run again in seconds when nothing is missing.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
BROWSER := $(VENV)/.browser
SYSTEM := $(VENV)/.system
JOBS   ?= 2

APT_PACKAGES := libreoffice-writer-nogui fonts-crosextra-carlito fonts-crosextra-caladea fonts-liberation2 poppler-utils

.PHONY: demo test check golden house pages docs bench benchmarks recordings crash coverage fuzz campaigns proof setup lock clean

setup: $(STAMP) $(SYSTEM)

demo: setup
	$(BIN)/toolkit demo --out demo-out

# The checks run beside the tests: without a cache the types take a minute, on one core. Both are told, and either fails.
test: setup $(BROWSER)
	@$(MAKE) --no-print-directory check >$(VENV)/check.log 2>&1 & checks=$$!; \
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal; tests=$$?; \
	wait $$checks; checked=$$?; cat $(VENV)/check.log; exit $$((tests ? tests : checked))

check: $(STAMP)
	$(BIN)/ruff format --check --quiet
	$(BIN)/ruff check --quiet
	$(BIN)/mypy --no-error-summary
	$(BIN)/lint-imports --config pyproject.toml

# Every frozen answer (records, reduced tests, tires, audits, diagnoses, documents) against the code of today.
golden: setup
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.golden check

# The house in figures: sizes, names, commands, effects named outside their file, imports up, pages.
house: $(STAMP)
	$(BIN)/python -m tests.house

# The pages of docs/ that are printed from declarations: formats, effects, characteristics, rules, tags.
pages: $(STAMP)
	$(BIN)/python -m tests.house.pages

# The site of all pages, offline: `toolkit docs` opens it; a wheel carries it.
docs: $(STAMP)
	$(BIN)/python docs/build_site.py

bench: setup
	$(BIN)/python -m tests.benchmarks

# Every writing command, killed and failed at its calls: what is lost, what is mixed, what the next run mends.
POINTS ?= 8
crash: setup
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.crash --most $(POINTS)

# Public sets beside published figures and peers of the same run: DATA is the folder of the publishers' files
# (docs/benchmarks.md). The peers run where the extra `benchmarks` is installed; else their rows say so.
benchmarks: setup
	@test -n "$(DATA)" || { echo "make benchmarks DATA=DIR: the folder of the publishers' files, see docs/benchmarks.md" >&2; exit 2; }
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks $(DATA)

# The diagnosis on real recordings, failures first: DATA is the folder of the publishers' files (docs/recordings.md).
recordings: setup
	@test -n "$(DATA)" || { echo "make recordings DATA=DIR: the folder of the publishers' files, see docs/recordings.md" >&2; exit 2; }
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.recordings $(DATA)

# How often printed intervals hold the truth: tables with exact binomial intervals, some minutes.
REPETITIONS ?= 60
coverage: setup
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.coverage --workers $(JOBS) \
	  --repetitions $(REPETITIONS)

# Every input format, mutated by its structure, through the command that reads it. The seed is printed.
COUNT   ?= 500
SECONDS ?= 600
fuzz: setup
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.fuzz --count $(COUNT) --seconds $(SECONDS)

# The tests that stand apart from `make test`: further cases of promises that it holds by one case each. Every test says by
# its marker, `@pytest.mark.campaign("why")`, why it stands apart.
campaigns: setup $(BROWSER)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal -m campaign

# A new sealed batch of concealed effects, the tool once on every case, then the answers opened; and every effect of the
# virtual machine, there and back. Resumable.
CASES ?= 400
proof: setup
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m proof all --out build/proof \
	  --cases $(CASES) --workers $(JOBS) --proof docs/proof --log proof/batches.jsonl
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal -m "" \
	  tests/simulation/test_case_effects_are_named.py

# The virtual environment from the lock file: exact versions, each with its hash. pip would compile the packages one
# after another, half a minute of one core; a file of theirs that does not compile is none that anything imports.
$(STAMP): requirements.lock pyproject.toml
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) 2>/dev/null || sh .ci/as-root apt-get-install python3-venv
	@test -x $(BIN)/pip || { rm -rf $(VENV); $(PYTHON) -m venv $(VENV); }
	$(BIN)/pip install --quiet --disable-pip-version-check --no-compile --require-hashes -r requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m compileall -q toolkit
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m compileall -qq -j $(JOBS) $(VENV)/lib || true
	@touch $@

# LibreOffice, its fonts and poppler from the system's packages. Without root and without sudo nothing is
# installed: `toolkit doctor` prints the one command to run.
$(SYSTEM): $(STAMP)
	@$(BIN)/toolkit doctor --quiet || sh .ci/as-root apt-get-install $(APT_PACKAGES) || { $(BIN)/toolkit doctor; exit 1; }
	@touch $@

# What tests alone need: the browser in which they look at the workbench, and independent checks of seals and signatures.
TEST_PACKAGES := chromium xmlsec1 openssh-client
$(BROWSER): $(STAMP)
	@(for program in chromium xmlsec1 ssh-keygen; do test -x /usr/bin/$$program || exit 1; done) || sh .ci/as-root apt-get-install $(TEST_PACKAGES)
	@touch $@

# After a change of the dependencies: resolve again and pin every version with its hashes.
lock:
	$(PYTHON) -m venv build/lock && build/lock/bin/pip install --quiet "pip<26" pip-tools
	build/lock/bin/pip-compile --quiet --generate-hashes --extra dev --strip-extras --allow-unsafe --no-header \
	  --no-annotate --no-emit-index-url --no-emit-find-links --no-emit-trusted-host -o requirements.lock pyproject.toml

clean:
	rm -rf $(VENV) build dist demo-out bench-out .mypy_cache .ruff_cache .pytest_cache .hypothesis
