# Sourced by the tools: makes sure that .venv of this repository exists and holds the package as pyproject.toml asks.
# shellcheck shell=bash

repository=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
venv=$repository/.venv
resolution=newest # or lowest: the oldest versions that pyproject.toml allows, for an environment of their own
needed_python='import sys; sys.exit(sys.version_info < (3, 11))'
unset PYTHONDONTWRITEBYTECODE # as images set it: each process would compile all that it imports anew, for seconds

# Mends a bare Debian or Ubuntu in one go; tools/vcan needs iproute2.
bare_system="sudo apt-get update && sudo apt-get install -y python3-venv python3-dev gcc iproute2"

say() { printf '%s\n' "$*" >&2; }

fail() { # problem, the one command that mends it
    say "cannot set up $venv: $1"
    say "  this would mend it: $2"
    exit 1
}

as_root() { # run a command with root's rights; fails without them
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}

may_install() {
    command -v apt-get >/dev/null && as_root true 2>/dev/null
}

install_packages() { # Debian packages; shows apt's output only when it fails
    local log code=0
    log=$(mktemp)
    say "installing Debian packages: $*"
    as_root apt-get -qq update >"$log" 2>&1 || true # the lists at hand may do
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends "$@" \
        </dev/null >>"$log" 2>&1 || code=$?
    [ $code = 0 ] || cat "$log" >&2
    rm -f "$log"
    return $code
}

find_python() { # prints the newest suitable interpreter
    local name
    for name in python3 python3.14 python3.13 python3.12 python3.11; do
        if "$name" -c "$needed_python" 2>/dev/null; then
            command -v "$name"
            return
        fi
    done
    return 1
}

obtain_python() {
    find_python && return
    if may_install; then
        install_packages python3 python3-venv && find_python && return
        fail "Python 3.11 or newer is needed, and this system's packages have none" "uv python install 3.12"
    fi
    fail "Python 3.11 or newer is missing" "$bare_system"
}

make_venv() { # with the interpreter $1: an environment that has pip
    local python=$1
    rm -rf "$venv"
    if ! "$python" -c 'import venv, ensurepip' 2>/dev/null && may_install; then
        # Debian and Ubuntu split this part of Python off; it belongs to the system's interpreter.
        install_packages python3-venv || true
    fi
    if "$python" -c 'import venv, ensurepip' 2>/dev/null; then
        "$python" -m venv "$venv" >&2
    elif "$python" -m virtualenv --version >/dev/null 2>&1; then
        "$python" -m virtualenv -q "$venv" >&2
    elif "$python" -m pip --version >/dev/null 2>&1 && "$python" -c 'import venv' 2>/dev/null; then
        # pip installs itself into an environment without one; the system's own packages stay as they are.
        "$python" -m venv --without-pip "$venv" >&2
        "$python" -m pip --python "$venv/bin/python" install -q pip >&2
    else
        fail "$python lacks ensurepip" "$bare_system"
    fi
}

has_headers() { # of Python, for the compiled core
    "$venv/bin/python" -c 'import sys, sysconfig; from pathlib import Path
sys.exit(not (Path(sysconfig.get_path("include")) / "Python.h").is_file())'
}

ensure_headers() { # and a compiler; without root's rights the headers alone: the build brings a compiler of its own
    local version unpacked=$repository/build/python-headers
    if has_headers && command -v cc >/dev/null; then return; fi
    if may_install && install_packages gcc libc6-dev python3-dev && has_headers; then return; fi
    version=$("$venv/bin/python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    if has_headers || [ -f "$unpacked/usr/include/python$version/Python.h" ]; then return; fi
    mkdir -p "$unpacked"
    if command -v dpkg >/dev/null && (cd "$unpacked" && apt-get -qq download "libpython$version-dev" >/dev/null 2>&1) &&
        dpkg -x "$unpacked"/libpython*.deb "$unpacked"; then
        rm -f "$unpacked"/*.deb
    else
        fail "Python's headers are missing, which the compiled core is built with" "$bare_system"
    fi
}

installed_state() { # what the stamp says when nothing needs to be done
    sha256sum "$repository/pyproject.toml"
    echo "$venv"
}

show_progress() { # of what pip prints, a line for each package and each phase
    awk '/^ *Collecting / { print "  " $2; fflush() }
        /^ *Installing collected packages/ { print "  unpacking what was fetched"; fflush() }'
}

show_seconds() { # a sign of life while pip says nothing
    while sleep 15 >/dev/null 2>&1; do say "  ... $SECONDS s"; done
}

start_compiling() { # log: the core, by what pyproject.toml builds it with, while pip fetches the rest
    local builders
    mapfile -t builders < <("$venv/bin/python" -c 'import sys, tomllib
print(*tomllib.load(open(sys.argv[1], "rb"))["build-system"]["requires"], sep="\n")' "$repository/pyproject.toml")
    [ -n "${CC-}" ] || command -v cc gcc clang >/dev/null || builders+=(ziglang)
    "${installer[@]}" -q "${builders[@]}" >&2 || return 0 # pip says why when it needs them
    installer=(env OBSERVER_RT_BUILT_APART=yes "${installer[@]}")
    "$venv/bin/python" "$repository/tools/lib/build_core.py" 9<&- >>"$1" 2>&1 &
    compiling=$!
}

install_package() { # extras ("" or "[dev]")
    local log seconds compiling='' code=0 installer=("$venv/bin/python" -m pip install --disable-pip-version-check --no-input)
    log=$(mktemp)
    say "installing observer-rt$1 and what it needs into $venv, and compiling its core: half a minute plus the download"
    show_seconds 9<&- & # the lock is not its
    seconds=$!
    if [ "$resolution" = lowest ]; then # pip knows the newest versions only
        "${installer[@]}" -q uv
        installer=("$venv/bin/uv" pip install --python "$venv/bin/python" --resolution lowest-direct)
    else # what is imported is compiled then
        installer+=(--no-compile)
        start_compiling "$log"
    fi
    PYTHONUNBUFFERED=1 "${installer[@]}" -e "$repository$1" </dev/null 2>&1 | tee -a "$log" | show_progress >&2 || code=$?
    # What every start imports is compiled while the core still is.
    "$venv/bin/python" -c 'import cantools, matplotlib.figure, pandas, scipy.integrate, scipy.optimize' 2>/dev/null || true
    [ -z "$compiling" ] || wait "$compiling" || code=$?
    kill $seconds 2>/dev/null || true
    if [ $code = 0 ]; then
        rm -f "$log"
        say "  installed, and the core compiled, after $SECONDS s"
    else
        tail -n 20 "$log" >&2
        rm -f "$log"
        fail "pip could not install the package, see above" "$venv/bin/python -m pip install -e '$repository$1'"
    fi
}

is_built() { # the core, of its sources as they are: importing it builds it where it can be
    (cd "$repository" && "$venv/bin/python" -c 'import observer_rt.core') >/dev/null 2>&1
}

ensure_venv() { # extras ("[pictures]" or "[dev]"); several at once take turns
    local extras=$1 stamp=$venv/.installed$1 python
    exec 9<"$repository"
    flock 9
    if ! { [ -f "$stamp" ] && installed_state | cmp -s - "$stamp" && "$venv/bin/python" -c "$needed_python" && is_built; }; then
        if ! "$venv/bin/python" -c "$needed_python; import pip" 2>/dev/null; then
            python=$(obtain_python)
            say "making $venv with $python"
            make_venv "$python"
        fi
        ensure_headers
        install_package "$extras"
        installed_state >"$stamp"
        installed_state >"$venv/.installed[pictures]" # which every other choice includes
    fi
    exec 9<&-
    export PATH="$venv/bin:$PATH"
}

# For the tests that compile: where this machine has no `cc`, and no rights to install one, that of ziglang, under the same
# name in the environment.
ensure_compiler() {
    if command -v cc >/dev/null || { may_install && install_packages gcc libc6-dev; }; then return; fi
    say "no C compiler on this machine: fetching ziglang, which is one, into $venv"
    "$venv/bin/python" -m pip install --disable-pip-version-check --no-input -q ziglang >&2 ||
        fail "there is no C compiler, and pip could not install ziglang" "$bare_system"
    printf '#!/bin/sh\nexec "%s" -m ziglang cc "$@"\n' "$venv/bin/python" >"$venv/bin/cc"
    chmod +x "$venv/bin/cc"
}

# Works on Debian and Ubuntu, whose own `chromium` is a snap.
obtain_browser="$venv/bin/playwright install --with-deps chromium-headless-shell"

ensure_browser() { # for the tests of the live page, which fail without one and say the same
    local name
    for name in chromium chromium-browser google-chrome google-chrome-stable; do
        if "$name" --version >/dev/null 2>&1; then return; fi # Ubuntu's chromium-browser only asks for a snap
    done
    say "no Chromium on this machine, which the tests of the live page drive"
    if may_install && install_packages chromium; then return; fi
    say "none among this system's packages: fetching one"
    "$venv/bin/playwright" install chromium-headless-shell >&2 ||
        say "the tests of the live page will fail without a browser; this would mend it: $obtain_browser"
}
