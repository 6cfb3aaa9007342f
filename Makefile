# The commands of the repository. Each installs what it misses; none needs to be run first.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help run page test bench evaluate figure fmt lint deny

help: ## list the commands
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "make %-9s %s\n", $$1, $$2}'

run: ## start a server at http://127.0.0.1:7171 and play real logs into it as a small fleet
	@scripts/run.sh

page: ## build the operators' page into web/dist
	@scripts/page.sh

test: ## run every check: format, lints, Rust on SQLite and PostgreSQL, page, browser
	@scripts/test.sh

bench: ## run the speed benchmarks and rewrite their figures in BENCHMARKS.md
	@scripts/bench.sh

evaluate: ## replay every log there is through real servers and rewrite the tables in BENCHMARKS.md
	@scripts/evaluate.sh

figure: ## draw docs/hallway.svg from a committed log, through a real server
	@scripts/figure.sh

fmt: ## format the Rust code
	@cargo fmt --all

lint: ## clippy and rustdoc, warnings are errors
	@cargo clippy --workspace --all-targets --all-features -- -D warnings
	@RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --document-private-items

deny: ## licences, advisories, sources of dependencies (installs cargo-deny: minutes)
	@cargo deny --version >/dev/null 2>&1 || cargo install --locked cargo-deny
	@cargo deny check
