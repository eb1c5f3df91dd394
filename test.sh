#!/usr/bin/env bash
# Runs every check: formatting, lints, tests, doc tests, tests of the viewer's page and in a browser, those of the Python
# package, licences, and each benchmark once, in short form. Prints the time of each step and ends with a line "N passed, N failed, N skipped"; the exit
# status is 0 if nothing failed.
set -uo pipefail
cd "$(dirname "$0")" || exit 1

# What is built once is built faster without what a second build could use.
export CARGO_INCREMENTAL=0

passed=0
failed=0
skipped=0
failures=()
log=$(mktemp)
trap 'rm -f "$log"' EXIT

# Prints the name of a step, and the time that the step before took.
begin() {
    [ -z "${step:-}" ] || echo "-- $step: $((SECONDS - step_start)) s"
    step=$1
    step_start=$SECONDS
    [ -z "$step" ] || echo "== $step"
}

# Runs a command that counts as one check.
check() {
    begin "$1"
    shift
    if "$@"; then
        passed=$((passed + 1))
    else
        fail
    fi
}

# Counts the present step, or the failure that is named, as failed.
fail() {
    echo "FAILED: ${1:-$step}"
    failed=$((failed + 1))
    failures+=("${1:-$step}")
}

# Keeps the names of failed tests, which are the matches of a pattern's group in the log, for the list at the end.
keep_failures() {
    local names
    mapfile -t names < <(sed -nE "s/$1/$step: \1/p" "$log")
    failures+=("${names[@]}")
}

# Runs cargo test and counts its tests. A build that fails counts as one failure.
tests() {
    begin "$1"
    shift
    if ! "$@" 2>&1 | tee "$log"; then
        grep -q '^test result: FAILED' "$log" || fail "$step: the build"
    fi
    keep_failures '^test (.*) \.\.\. FAILED$'
    while read -r ok bad; do
        passed=$((passed + ok))
        failed=$((failed + bad))
    done < <(sed -nE 's/^test result: [a-zA-Z]+\. ([0-9]+) passed; ([0-9]+) failed;.*/\1 \2/p' "$log")
    # A test whose data or program is absent prints "skipped: " and passes; it counts as skipped.
    local absent
    absent=$(grep -c '^skipped: ' "$log")
    passed=$((passed - absent))
    skipped=$((skipped + absent))
}

# Runs tests of Node.js and counts them. A file that fails to start counts as one failure.
page_tests() {
    begin "$1"
    shift
    node --test --test-reporter=tap "$@" 2>&1 | tee "$log" |
        awk '/^(not )?ok |^# (tests|duration)/ { is_failure = /^not/; print; next } is_failure && /^ /'
    local ok bad left_out
    ok=$(sed -nE 's/^# pass ([0-9]+)$/\1/p' "$log")
    left_out=$(sed -nE 's/^# (skipped|todo) ([0-9]+)$/\2/p' "$log" | paste -sd+)
    bad=$(sed -nE 's/^# (fail|cancelled) ([0-9]+)$/\2/p' "$log" | paste -sd+)
    passed=$((passed + ${ok:-0}))
    [ -n "$bad" ] || fail
    failed=$((failed + bad))
    keep_failures '^not ok [0-9]+ - (.*)'
    skipped=$((skipped + ${left_out:-0}))
}

# Installs GDAL, by which tests read plans; without it they are skipped.
prepare_gdal() {
    command -v gdalinfo >/dev/null || [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null && return
    apt-get update >"$log" 2>&1 && apt-get install -y --no-install-recommends gdal-bin >"$log" 2>&1
}

# Installs ffmpeg, which writes videos; without it their tests are skipped.
prepare_ffmpeg() {
    command -v ffmpeg >/dev/null || [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null && return
    apt-get update >"$log" 2>&1 && apt-get install -y --no-install-recommends ffmpeg >"$log" 2>&1
}

# Installs a Vulkan driver that runs on the processor, on which the tests of the GPU run; without any they are skipped.
prepare_vulkan() {
    # wgpu warns about a missing folder for sockets, which no test uses.
    export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null && return
    [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null && return
    apt-get update >"$log" 2>&1 && apt-get install -y --no-install-recommends libvulkan1 mesa-vulkan-drivers >"$log" 2>&1
}

# Finds the browser (CHROMIUM if it is set), playwright-core, which drives it, and axe-core, which checks that pages are
# accessible; both are installed outside of the repository. Fails with a reason in `missing` if one is unavailable.
prepare_browser() {
    export PLAYWRIGHT=${PLAYWRIGHT:-${XDG_CACHE_HOME:-${HOME:-/tmp}/.cache}/surfel-playwright}
    export CHROMIUM=${CHROMIUM:-chromium}
    if ! command -v "$CHROMIUM" >/dev/null && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        apt-get update >"$log" 2>&1 && apt-get install -y --no-install-recommends chromium >"$log" 2>&1
    fi
    missing="$CHROMIUM is not installed"
    CHROMIUM=$(command -v "$CHROMIUM") || return
    [ -d "$PLAYWRIGHT/node_modules/playwright-core" ] && [ -d "$PLAYWRIGHT/node_modules/axe-core" ] && return
    missing="playwright-core and axe-core are not in $PLAYWRIGHT, and npm is not installed"
    command -v npm >/dev/null || return
    missing="npm cannot install playwright-core and axe-core into $PLAYWRIGHT"
    # Another run may look for the folder at the same time, so it appears as a whole.
    local fresh="$PLAYWRIGHT.$$"
    npm install --silent --no-audit --no-fund --prefix "$fresh" playwright-core axe-core >"$log" 2>&1 || return
    mv -T "$fresh" "$PLAYWRIGHT" 2>/dev/null || { rm -rf "$PLAYWRIGHT" && mv "$fresh" "$PLAYWRIGHT"; }
}

# Prints the interpreters that the package works with, the newest first: of each version one that runs. Those of pyenv are
# asked themselves, since its commands fail for versions that are not chosen.
python_interpreters() {
    local python
    for python in python3 python3.{10..19} "${PYENV_ROOT:-${HOME:-/tmp}/.pyenv}"/versions/*/bin/python3; do
        "$python" - 2>/dev/null <<'END'
import sys
import sysconfig

is_ready = sys.version_info.releaselevel == "final" and not sysconfig.get_config_var("Py_GIL_DISABLED")
if is_ready and sys.version_info >= (3, 10):
    print("%d.%d" % sys.version_info[:2], sys.executable)
END
    done | sort -V -r -k 1,1 -s | awk '!seen[$1]++' | cut -d ' ' -f 2-
}

# Builds the wheel, installs it into a fresh environment of the newest Python and into one of the oldest, and runs
# pytest there. Prints why and counts one skipped check where there is no Python, or no package registry.
python_tests() {
    begin "Python"
    local found=() environment wheel oldest=3.10
    mapfile -t found < <(python_interpreters)
    [ ${#found[@]} -gt 0 ] || { skip "tests of the Python package: Python 3.10 or newer is not installed"; return; }
    environment=$(mktemp -d)
    if ! "${found[0]}" -m venv "$environment/build" || ! "$environment/build/bin/pip" install -q maturin >"$log" 2>&1; then
        skip "tests of the Python package: pip cannot install maturin"
    elif ! (cd crates/surfel-python && "$environment/build/bin/maturin" build --profile dev -q --out "$environment"); then
        fail "the wheel cannot be built"
    else
        wheel=$(echo "$environment"/*.whl)
        # What surfel works with but does not need; tests that need one that is missing are skipped. Notebooks run once.
        # Open3D takes a gigabyte and needs system libraries, so its tests are run by hand.
        local others=(laspy pandas trimesh pyproj xarray pyvista "dask distributed")
        pytest_in "$environment/newest" "${found[0]}" "$wheel" "${others[@]}" mypy "jupyterlab ipykernel nbclient nbformat anywidget"
        [ "${found[0]}" = "${found[-1]}" ] || pytest_in "$environment/oldest" "${found[-1]}" "$wheel" "${others[@]}"
        "${found[-1]}" -c "import sys; sys.exit('%d.%d' % sys.version_info[:2] != '$oldest')" ||
            skip "tests of the Python package on Python $oldest, the oldest that it works with: it is not installed"
    fi
    rm -rf "$environment"
}

# Runs pytest with a wheel in a fresh environment, with other packages where pip can install them, and counts its tests.
pytest_in() {
    local pip="$1/bin/pip" wheel=$3 environment=$1 word count
    if ! "$2" -m venv "$1" || ! "$pip" install -q pytest numpy >"$log" 2>&1; then
        skip "tests of the Python package: pip cannot install pytest and numpy for $2"
        return
    fi
    shift 3
    for word; do "$pip" install -q $word >"$log" 2>&1; done
    "$pip" install -q --no-index --no-deps "$wheel" && (cd crates/surfel-python && "$environment/bin/python" -m pytest -q -rfEs tests) 2>&1 | tee "$log"
    grep -qE '^[0-9].* in [0-9.]+s' "$log" || fail
    keep_failures '^(FAILED .*|ERROR .*)'
    while read -r count word; do
        case $word in
            passed) passed=$((passed + count)) ;;
            failed | error | errors) failed=$((failed + count)) ;;
            skipped) skipped=$((skipped + count)) ;;
        esac
    done < <(grep -E '^[0-9].* in [0-9.]+s' "$log" | tail -1 | grep -oE '[0-9]+ [a-z]+')
}

# Counts a check that cannot run, and prints why.
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
check "formatting of the fuzz targets" cargo fmt --manifest-path fuzz/Cargo.toml --check
check "locked versions of the fuzz targets" cargo tree --quiet --locked --manifest-path fuzz/Cargo.toml --depth 0
check "lints" cargo clippy --workspace --all-targets -- -D warnings
prepare_gdal
prepare_ffmpeg
prepare_vulkan
tests "tests" cargo test --workspace --tests --no-fail-fast -- --show-output
tests "doc tests" cargo test --workspace --doc --no-fail-fast
# The page's tests use `import.meta.dirname`, which Node.js has since 20.11.
if node -e 'const [a, b] = process.versions.node.split("."); process.exit(+a < 20 || (+a === 20 && +b < 11) ? 1 : 0)' 2>/dev/null; then
    page_tests "page" crates/surfel-web/page-tests/*.test.mjs
    if prepare_browser; then
        # The browser tests use the program that the Rust tests have built.
        page_tests "browser" --test-concurrency=1 crates/surfel-web/browser-tests/*.test.mjs
    else
        skip "tests in a browser: $missing"
    fi
else
    skip "tests of the page and in a browser: node 20.11 or newer is not installed"
fi
python_tests
if cargo deny --version >/dev/null 2>&1; then
    check "licences and sources" cargo deny check bans licenses sources
else
    skip "cargo deny is not installed (cargo install cargo-deny)"
fi
# In test mode Criterion runs each benchmark once without timing it; 100,000 points are enough for that.
check "benchmarks, once" env POINTS=100000 cargo test --workspace --bench '*'
begin ""

[ ${#failures[@]} -eq 0 ] || printf 'failed: %s\n' "${failures[@]}"
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
