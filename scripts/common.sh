# Shared by the scripts: system packages, Python environment, builds. Sourced, not run.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
target="${CARGO_TARGET_DIR:-$root/target}"
venv="$root/.venv"
python="$venv/bin/python"

build_packages=(build-essential pkg-config libopenmpi-dev openmpi-bin libclang-dev libhdf5-dev)
picture_packages=(python3-venv libgl1 libegl1 libxrender1)

say() { printf '\033[1m%s\033[0m\n' "$*"; }
fail() { printf 'error: %s\n' "$*" >&2; exit 1; }

installed() { dpkg -s "$1" 2>/dev/null | grep -q '^Status: install ok installed'; }

# Installs what is missing of the named packages; fails without the rights to do so.
install_packages() {
    command -v dpkg >/dev/null || return 1
    local missing=()
    for package in "$@"; do
        installed "$package" || missing+=("$package")
    done
    [ ${#missing[@]} -eq 0 ] && return 0
    local as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        sudo -n true 2>/dev/null || { echo "missing and not allowed to install: ${missing[*]}"; return 1; }
        as_root=(sudo -n)
    fi
    say "installing ${missing[*]}"
    "${as_root[@]}" apt-get update -qq &&
        DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

# Sets `embedded` to 1 where MPI and HDF5 of the system are not to be had.
prepare_system() {
    embedded=0
    if ! install_packages "${build_packages[@]}"; then
        if command -v mpirun mpicc >/dev/null && pkg-config --exists hdf5 2>/dev/null; then
            return 0
        fi
        echo "building without MPI and with HDF5 from source"
        embedded=1
    fi
}

# A Python environment with the given requirement files; needs no network when it is up to date.
prepare_python() {
    local wanted stamp="$venv/requirements.stamp"
    wanted=$(cat "$@")
    [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ] && return 0
    install_packages "${picture_packages[@]}" || true
    [ -x "$python" ] || python3 -m venv "$venv" || return 1
    say "installing Python packages into .venv"
    local arguments=()
    for file in "$@"; do arguments+=(-r "$file"); done
    "$python" -m pip install -q --disable-pip-version-check "${arguments[@]}" || return 1
    printf '%s\n' "$wanted" >"$stamp"
}

python_requirements() {
    requirements=("$root/scripts/requirements.txt")
    if [ "$embedded" = 1 ]; then requirements+=("$root/scripts/requirements-embedded.txt"); fi
}

# Cargo arguments of the build that this machine allows.
cargo_features() {
    features=()
    if [ "$embedded" = 1 ]; then
        features=(--no-default-features --features hdf5-static)
        export PATH="$venv/bin:$PATH"
    fi
}

# Release build, for the processor of this machine (.cargo/config.toml).
build_release() {
    cargo_features
    (cd "$root" && cargo build --release --locked -p fibreflow "${features[@]}")
}

# Release build of an example: build_example NAME -p PACKAGE. No feature is needed: examples run on one rank.
build_example() {
    local name=$1
    shift
    (cd "$root" && cargo build --release --locked -q "$@" --example "$name")
}

# Ranks for a case file where so many are there: linked fibres run on one, with threads.
ranks_for() {
    if grep -q 'kinematics = "linked"' "$1"; then echo 1; else echo "$2"; fi
}

# Runs a program on so many ranks, one thread each; on one rank, and without MPI, with all threads.
on_ranks() {
    local ranks=$1
    shift
    if [ "$embedded" = 1 ]; then
        RAYON_NUM_THREADS=$ranks "$@"
        return
    fi
    if [ "$ranks" = 1 ]; then
        RAYON_NUM_THREADS=$(nproc) "$@"
        return
    fi
    # Time for a last checkpoint when the job is told to stop.
    OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 \
        OMPI_MCA_btl_vader_eager_limit=65536 OMPI_MCA_mpi_yield_when_idle=1 \
        OMPI_MCA_odls_base_sigkill_timeout=60 \
        RAYON_NUM_THREADS=1 mpirun --oversubscribe -n "$ranks" "$@"
}

# What a bench needs: packages, Python environment, release build, STREAM.
prepare_bench() {
    prepare_system
    python_requirements
    prepare_python "${requirements[@]}" || fail "the benches draw with Python packages that could not be installed"
    export FIBREFLOW_EMBEDDED=$embedded
    say "building"
    build_release
    build_example stream -p fibreflow-parallel
}
