#!/usr/bin/env bash
# Everything that must hold: formatting, lints, tests, doc tests, the viewer's page in a browser, licences,
# each benchmark once.
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

# Runs node's tests and counts them; a file that does not even start counts as a failure.
page_tests() {
    local name=$1
    shift
    echo "== $name"
    node --test --test-reporter=tap "$@" 2>&1 | tee "$log" | grep -E '^(not )?ok |^ +error:|^# (tests|duration)'
    local ok bad left_out
    ok=$(sed -nE 's/^# pass ([0-9]+)$/\1/p' "$log")
    left_out=$(sed -nE 's/^# (skipped|todo) ([0-9]+)$/\2/p' "$log" | paste -sd+)
    bad=$(sed -nE 's/^# (fail|cancelled) ([0-9]+)$/\2/p' "$log" | paste -sd+)
    passed=$((passed + ${ok:-0}))
    failed=$((failed + ${bad:-1}))
    skipped=$((skipped + ${left_out:-0}))
}

# Looks for the browser (CHROMIUM, if it is set) and for what drives it, which goes into a folder outside the
# repository; `missing` tells what cannot be had.
prepare_browser() {
    export PLAYWRIGHT=${PLAYWRIGHT:-${XDG_CACHE_HOME:-${HOME:-/tmp}/.cache}/surfel-playwright}
    export CHROMIUM=${CHROMIUM:-chromium}
    if ! command -v "$CHROMIUM" >/dev/null && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        apt-get update >"$log" 2>&1 && apt-get install -y --no-install-recommends chromium >"$log" 2>&1
    fi
    missing="$CHROMIUM is not installed"
    CHROMIUM=$(command -v "$CHROMIUM") || return
    [ -d "$PLAYWRIGHT/node_modules/playwright-core" ] && return
    missing="playwright-core is not in $PLAYWRIGHT, and npm is not installed"
    command -v npm >/dev/null || return
    missing="npm cannot install playwright-core into $PLAYWRIGHT"
    npm install --silent --no-audit --no-fund --prefix "$PLAYWRIGHT" playwright-core >"$log" 2>&1
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
# `import.meta.dirname` came with 20.11.
if node -e 'const [a, b] = process.versions.node.split("."); process.exit(+a < 20 || (+a === 20 && +b < 11) ? 1 : 0)' 2>/dev/null; then
    page_tests "page" crates/surfel-web/page-tests/*.test.mjs
    if prepare_browser; then
        # With the program that the tests above have built.
        page_tests "browser" --test-concurrency=1 crates/surfel-web/browser-tests/*.test.mjs
    else
        skip "tests in a browser: $missing"
    fi
else
    skip "tests of the page and in a browser: node 20.11 or newer is not installed"
fi
if cargo deny --version >/dev/null 2>&1; then
    check "licences and sources" cargo deny check bans licenses sources
else
    skip "cargo deny is not installed (cargo install cargo-deny)"
fi
# Under cargo test, Criterion runs each benchmark once, untimed.
check "benchmarks, once" cargo test --workspace --bench '*'

echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
