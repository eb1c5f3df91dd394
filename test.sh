#!/usr/bin/env bash
# Everything that must hold: formatting, lints, tests, doc tests, licences, each benchmark once.
# Ends with a line "N passed, N failed, N skipped"; fails if anything failed.
set -uo pipefail
cd "$(dirname "$0")" || exit 1

passed=0
failed=0
skipped=0
log=$(mktemp)
trap 'rm -f "$log"' EXIT

# Runs a command as one check.
check() {
    local name=$1
    shift
    echo "== $name"
    if "$@"; then
        passed=$((passed + 1))
    else
        echo "FAILED: $name"
        failed=$((failed + 1))
    fi
}

# Runs cargo test and counts its tests; one that does not even build counts as a failure.
tests() {
    local name=$1
    shift
    echo "== $name"
    if ! "$@" 2>&1 | tee "$log"; then
        grep -q '^test result: FAILED' "$log" || failed=$((failed + 1))
    fi
    while read -r ok bad; do
        passed=$((passed + ok))
        failed=$((failed + bad))
    done < <(sed -nE 's/^test result: [a-zA-Z]+\. ([0-9]+) passed; ([0-9]+) failed;.*/\1 \2/p' "$log")
    # Tests that lack what they need pass, and say so; they count as skipped instead.
    local silent
    silent=$(grep -c '^skipped: ' "$log")
    passed=$((passed - silent))
    skipped=$((skipped + silent))
}

skip() {
    echo "skipped: $1"
    skipped=$((skipped + 1))
}

if ! command -v cargo >/dev/null; then
    echo "cargo is missing: install Rust from https://rustup.rs"
    echo "0 passed, 1 failed, 0 skipped"
    exit 1
fi
for component in rustfmt clippy; do
    cargo "${component/rustfmt/fmt}" --version >/dev/null 2>&1 || rustup component add "$component"
done

check "formatting" cargo fmt --all --check
check "lints" cargo clippy --workspace --all-targets -- -D warnings
tests "tests" cargo test --workspace --lib --bins --tests --no-fail-fast -- --show-output
tests "doc tests" cargo test --workspace --doc --no-fail-fast
if cargo deny --version >/dev/null 2>&1; then
    check "licences and sources" cargo deny check bans licenses sources
else
    skip "cargo deny is not installed (cargo install cargo-deny)"
fi
# Criterion's --test runs each benchmark once, untimed.
for bench in crates/surfel-tests/benches/*.rs; do
    name=$(basename "$bench" .rs)
    check "benchmark $name, once" cargo bench -p surfel-tests --bench "$name" -- --test
done

echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
