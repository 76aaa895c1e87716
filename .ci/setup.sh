# Sourced by ./run and ./test: makes .venv and checks OpenGL, once per state of pyproject.toml.
#
#   prepare EXTRAS    EXTRAS is "" or "[test]"; afterwards $venv_python runs the program
#
# A second run costs one comparison, a few milliseconds. The caller has set $root, the checkout.
# shellcheck shell=bash disable=SC2154

venv="$root/.venv"
venv_python="$venv/bin/python"
opengl_stamp="$venv/.spectrasplat-opengl"
gl_packages="libegl1 libgl1 libgl1-mesa-dri"

say() { printf '%s\n' "spectrasplat: $*" >&2; }

fail() {
    say "$*"
    exit 2
}

# Install as root or not at all: sudo could stop and ask for a password.
apt_install() {
    [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1 || return 1
    say "installing $*"
    { apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq -y install "$@"; } \
        >"$setup_log" 2>&1
}

find_python() {
    local candidate
    for candidate in python3 python3.13 python3.12 python3.11 python3.14 python; do
        if command -v "$candidate" >/dev/null 2>&1 &&
            "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then
            command -v "$candidate"
            return 0
        fi
    done
    return 1
}

make_venv() {
    local python version
    python="$(find_python)" ||
        fail "Python 3.11 or newer is needed: run 'sudo apt-get install python3 python3-venv' or see https://www.python.org"
    version="$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')"
    if ! "$python" -c 'import venv, ensurepip' >/dev/null 2>&1; then
        apt_install "python$version-venv" || apt_install python3-venv || true
        "$python" -c 'import venv, ensurepip' >/dev/null 2>&1 ||
            fail "Python's venv module is missing: run 'sudo apt-get install python$version-venv' and try again"
    fi
    say "making a Python $version environment in .venv"
    "$python" -m venv --clear "$venv" >"$setup_log" 2>&1 ||
        fail "cannot make $venv: $(tail -n 1 "$setup_log")"
}

install_packages() {
    say "installing the packages; the first time takes some minutes"
    "$venv_python" -m pip install --disable-pip-version-check --quiet --editable "$root$1" >"$setup_log" 2>&1 || {
        tail -n 15 "$setup_log" >&2
        fail "the packages could not be installed; check the network, then run the same command again"
    }
}

# Without OpenGL the program still starts, tells what is missing, and can search glasses.
check_opengl() {
    local try='from spectrasplat.gpu.context import create_context; create_context().release()'
    # Word splitting of the package list is meant.
    # shellcheck disable=SC2086
    if "$venv_python" -P -c "$try" >/dev/null 2>&1 ||
        { apt_install $gl_packages && "$venv_python" -P -c "$try" >/dev/null 2>&1; }; then
        : >"$opengl_stamp"
    fi
}

require_opengl() {
    [ -f "$opengl_stamp" ] ||
        fail "OpenGL 4.3 is missing: run 'sudo apt-get install $gl_packages' and try again ('./run doctor' tells more)"
}

# One test draws through OSMesa and is skipped without it; newer distributions have dropped it.
offer_osmesa() {
    "$venv_python" -c 'import ctypes; ctypes.CDLL("libOSMesa.so.8")' >/dev/null 2>&1 ||
        apt_install libosmesa6 || true
}

# The viewer's window is tested on a virtual screen.
offer_xvfb() {
    { command -v xvfb-run && command -v Xvfb && command -v xauth; } >/dev/null 2>&1 || apt_install xvfb xauth || true
}

# Compile the program's modules, as pip does for a wheel (where PYTHONDONTWRITEBYTECODE is set they would be compiled
# at every start), the tree builder and the search for beams, so that the first picture does not wait for them.
warm_caches() {
    "$venv_python" -m compileall -q "$root/app" >/dev/null 2>&1 || true
    "$venv_python" -P -m spectrasplat.model.geometry.bvh --warm >/dev/null 2>&1 &
    "$venv_python" -P -m spectrasplat.beams.compile >/dev/null 2>&1 || true
    wait
}

is_installed() {
    [ -x "$venv_python" ] && [ -f "$1" ] && [ "$(<"$1")" = "$key" ]
}

is_ready() {
    { is_installed "$stamp" || is_installed "$venv/.spectrasplat-test"; } && [ -f "$opengl_stamp" ]
}

prepare() {
    local extras="$1" key stamp setup_log
    # Cheap on purpose: no program is started. The path counts because a moved .venv is broken.
    key="$root"$'\n'"$(<"$root/pyproject.toml")"
    stamp="$venv/.spectrasplat${extras:+-test}"
    is_ready && return 0

    # Two first runs at once: the second waits, then finds the work done.
    if command -v flock >/dev/null 2>&1; then
        { exec 9>"$root/.setup.lock"; } 2>/dev/null ||
            fail "cannot write in $root: make the folder writable or copy the project elsewhere"
        flock 9
    fi
    is_ready || set_up
    { exec 9>&-; } 2>/dev/null
}

set_up() {
    setup_log="$(mktemp "${TMPDIR:-/tmp}/spectrasplat-setup.XXXXXX")" || exit 2
    # shellcheck disable=SC2064
    trap "rm -f '$setup_log'" EXIT
    if ! is_installed "$stamp"; then
        if ! "$venv_python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 ||
            ! grep -qsF "$venv" "$venv/bin/activate"; then
            make_venv
        fi
        install_packages "$extras"
        [ -z "$extras" ] || { offer_osmesa; offer_xvfb; }
        warm_caches
        printf '%s' "$key" >"$stamp"
    fi
    check_opengl
    rm -f "$setup_log"
    trap - EXIT
}
