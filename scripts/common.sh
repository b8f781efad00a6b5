# Sourced by the scripts here and by studies/test: Debian packages and a virtual environment, each only if missing.

root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
venv=${EITSKIN_VENV:-$root/.venv}

unset PYTHONDONTWRITEBYTECODE # what pip does not compile, Python keeps once it has

say() { printf '%s\n' "== $*"; }

# want COMMAND-OR-FILE PACKAGE...: note the Debian packages unless the first word is there.
missing=
want() {
    command -v "$1" >/dev/null 2>&1 && return 0
    [ -e "$1" ] && return 0
    shift
    missing="$missing $*"
}

# install_wanted: the packages that were noted, together; as root by apt, which waits where it runs already, else say how.
install_wanted() {
    [ -n "$missing" ] || return 0
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
        say "installing$missing with apt-get"
        {
            apt-get -o DPkg::Lock::Timeout=600 update -qq &&
                DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=600 install -y -qq --no-install-recommends $missing
        } >/dev/null && missing= && return 0
        say "apt-get could not install$missing; install it and start again"
        exit 1
    fi
    say "Debian packages are missing. Run this, then start again:"
    printf '   sudo apt-get install -y%s\n' "$missing"
    exit 1
}

# debian COMMAND-OR-FILE PACKAGE...: install the packages unless the first word is there.
debian() {
    want "$@"
    install_wanted
}

# The first Python from 3.10 on, and its headers.
find_python() {
    debian python3 python3
    for python in python3 python3.14 python3.13 python3.12 python3.11 python3.10; do
        command -v "$python" >/dev/null 2>&1 || continue
        "$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' && break
        python=
    done
    if [ -z "$python" ]; then
        say "Python 3.10 or later is needed; install it and start again"
        exit 1
    fi
    debian cc gcc libc6-dev
    header=$("$python" -c 'import sysconfig; print(sysconfig.get_path("include") + "/Python.h")')
    debian "$header" python3-dev
    "$python" -c 'import ensurepip, venv' 2>/dev/null || debian "no-ensurepip" python3-venv
}

# changed_since STAMP FOLDER...: whether a source in one of the folders is newer; what an installation leaves behind does not count.
changed_since() {
    made=$1
    shift
    [ -e "$made" ] || return 0
    [ -n "$(find "$@" -type d \( -name __pycache__ -o -name build -o -name '*.egg-info' \) -prune \
        -o -newer "$made" -type f ! -name '*.pyc' ! -name '*.so' -print | head -n 1)" ]
}

# packages ARGUMENTS...: what pip's install takes, into the environment. By uv, which fetches and unpacks several at once and
# says what; by pip where there is no uv, or where uv fails: only pip reads pip's settings. Packages that are named in $again are
# built again although their version is installed; pip always does that.
again=
packages() {
    fresh=
    for name in $again; do
        fresh="$fresh --reinstall-package $name"
    done
    [ -x "$venv/bin/uv" ] || "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --only-binary uv uv 2>/dev/null || true
    {
        "$venv/bin/uv" pip install --no-progress --python "$venv/bin/python" $fresh "$@" && touch "$venv/packages-done"
    } 2>&1 | sed '/^ *[-+~] /d; /^ *Downloaded /d; s/^ */   /'
    rm "$venv/packages-done" 2>/dev/null && return 0
    say "uv could not install this; trying pip"
    "$venv/bin/python" -m pip install --progress-bar off --disable-pip-version-check "$@" && return 0
    say "pip could not install this; its message stands above"
    exit 1
}

make_environment() {
    [ -x "$venv/bin/python" ] && return 0
    find_python
    say "making a virtual environment in $venv"
    "$python" -m venv "$venv"
}

# install_package EXTRAS: the project with these extras in the virtual environment, unless nothing changed since; with it what only
# a checkout has: the emulated board, and for tests the instrument's circuit.
install_package() {
    stamp=$venv/installed-$(printf '%s' "$1" | tr ',' '-')
    make_environment
    if changed_since "$stamp" "$root/python" "$root/firmware" "$root/csrc" "$root/cmake" "$root/CMakeLists.txt" "$root/pyproject.toml" \
        "$root/hardware/eitskin_hardware" "$root/hardware/pyproject.toml"; then
        find_python
        say "installing eitskin[$1]: packages, and compiling the C core; half a minute on an idle computer, some minutes on a busy one"
        touch "$stamp.next"
        again="eitskin eitskin-emulator"
        case $1 in
        build) packages "$root[$1]" ;;
        test)
            again="$again eitskin-hardware"
            packages "$root[$1]" "$root/firmware/emulator" "$root/hardware"
            ;;
        *) packages "$root[$1]" "$root/firmware/emulator" ;;
        esac
        mv "$stamp.next" "$stamp"
    fi
}

# install_studies: beside the project with the extra test, the studies and what they compare with.
install_studies() {
    install_package test
    if changed_since "$venv/installed-studies" "$root/studies/eitskin_studies" "$root/studies/pyproject.toml"; then
        say "installing the studies, and the packages that they compare with"
        touch "$venv/installed-studies.next"
        again=eitskin-studies
        packages "$root/studies[test]"
        mv "$venv/installed-studies.next" "$venv/installed-studies"
    fi
}

# use_environment: its programs come first; processes run side by side, and threads of BLAS would only wait for each other.
use_environment() {
    PATH=$venv/bin:$PATH
    OPENBLAS_NUM_THREADS=1
    export PATH OPENBLAS_NUM_THREADS
}

# build_site NOTEBOOKS [ARGUMENT]...: the documentation in build/site, with notebooks that are run (cache: if they changed; force) or
# not (off); what Sphinx warns of, as a broken link or anchor, is an error.
build_site() {
    notebooks=$1
    shift
    python -m sphinx -W --keep-going --quiet -D nb_execution_mode="$notebooks" -c "$root/docs/site" "$@" "$root" "$root/build/site"
}
