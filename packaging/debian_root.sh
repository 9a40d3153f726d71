#!/bin/bash
# The tests with Debian's own DOLFINx, PETSc and MPI, in a root of their own:
#
#     packaging/debian_root.sh make     make the root (once; about 3 GB)
#     packaging/debian_root.sh test     make it where it is absent, then run the tests on 1 and 3 ranks;
#                                       further arguments go to pytest
#     packaging/debian_root.sh shell    a shell in it
#     packaging/debian_root.sh remove
#
# Needs root and debootstrap. Nothing stays mounted: mounts live in a namespace of the command.
#
#     DEBIAN_SUITE    which Debian (default: unstable)
#     DEBIAN_MIRROR   where from (default: the first mirror in this machine's sources of apt)
#     DEBIAN_ROOT     where to (default: build/debian-SUITE)
set -euo pipefail
cd "$(dirname "$0")/.."

suite=${DEBIAN_SUITE:-unstable}
root=$(realpath -m "${DEBIAN_ROOT:-build/debian-$suite}")

# What DOLFINx and the stages before and after it need. Of the last line each is taken if Debian has it.
packages=(
    ca-certificates gcc g++ libc6-dev make openmpi-bin libgl1 libegl1
    libglu1-mesa libxrender1 libxcursor1 libxft2 libxinerama1
    python3-dev python3-venv python3-pip
    python3-dolfinx python3-petsc4py python3-mpi4py
)
# Not python3-gmsh: Debian builds gmsh without Netgen's optimiser, which `mufe mesh` needs.
wanted=(
    python3-numpy python3-scipy python3-numba python3-h5py python3-skimage python3-tifffile
    python3-simpleitk python3-pyvista python3-meshio python3-matplotlib python3-pandas python3-pint
    python3-typer python3-rich python3-pytest
)

say() { echo "debian_root: $*" >&2; }
fail() { say "$*"; exit 1; }

mirror() {
    if [ -n "${DEBIAN_MIRROR:-}" ]; then
        echo "$DEBIAN_MIRROR"
        return
    fi
    local found
    found=$(cat /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list.d/*.sources \
            /etc/apt/sources.list /etc/apt/sources.list.d/*.list 2>/dev/null |
        sed -nE 's/^URIs: +(\S+).*/\1/p; s/^deb +(\[[^]]*\] +)?(\S+).*/\2/p' | grep -m1 /debian) || true
    [ -n "$found" ] || fail "no mirror of Debian in /etc/apt, expected DEBIAN_MIRROR=URL"
    echo "$found"
}

# Run a command in the root, with /proc, /sys, /dev and this machine's resolver and certificates.
in_root() {
    unshare --mount --propagation private bash -euc '
        root=$1; shift
        mount -t proc proc "$root/proc"
        mount -t sysfs -o ro sys "$root/sys"
        mount --rbind /dev "$root/dev"
        mount -t tmpfs -o mode=1777 tmp "$root/dev/shm"
        for file in /etc/resolv.conf /etc/hosts; do
            [ -e "$file" ] && { touch "$root$file"; mount --bind "$(realpath "$file")" "$root$file"; }
        done
        exec chroot "$root" "$@"
    ' in_root "$root" "$@"
}

# Variables that pip and apt may need here, those of MPI, and nothing else. Open MPI refuses root and more ranks
# than cores unless it is told; each version has names of its own, and complains of those of others.
mpi_environment() {
    echo OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
    case "$(cat "$root/.openmpi" 2>/dev/null)" in
        4) echo OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_hwloc_base_binding_policy=none ;;
        5) echo PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe PRTE_MCA_hwloc_default_binding_policy=none ;;
        *) echo PRTE_MCA_mapby=:oversubscribe PRTE_MCA_bindto=none ;;
    esac
}

environment() {
    echo PATH=/opt/venv/bin:/usr/bin:/bin:/usr/sbin:/sbin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive
    mpi_environment
    echo OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PIP_CERT=/etc/ssl/certs/ca-certificates.crt
    env | grep -E '^(https?_proxy|no_proxy|HTTPS?_PROXY|NO_PROXY|PIP_INDEX_URL|PIP_DEFAULT_TIMEOUT)=' || true
}

run() {
    # shellcheck disable=SC2046
    in_root /usr/bin/env -i $(environment) "$@"
}

make_root() {
    [ "$(id -u)" = 0 ] || fail "user = $(id -un), expected root: a root needs mounts and owners"
    command -v debootstrap >/dev/null || fail "debootstrap is absent: apt install debootstrap"
    [ -e "$root/.complete" ] && return
    local from
    from=$(mirror)
    say "making $root from $from, $suite"
    if [ ! -e "$root/.bootstrapped" ]; then
        rm -rf --one-file-system "$root"
        mkdir -p "$root"
        debootstrap --variant=minbase "$suite" "$root" "$from"
        touch "$root/.bootstrapped"
    fi
    # What this machine says about how to reach mirrors holds in there too. A mirror may be some weeks old:
    # signatures count, dates do not.
    { apt-config dump | grep '^Acquire::https\?::' || true
      echo 'Acquire::Check-Valid-Until "false";'; } >"$root/etc/apt/apt.conf.d/90host"
    run apt-get update -qq
    local known=() name
    for name in "${wanted[@]}"; do
        if run apt-cache show "$name" >/dev/null 2>&1; then known+=("$name"); else say "Debian $suite has no $name"; fi
    done
    run apt-get install -qq --no-install-recommends "${packages[@]}" "${known[@]}" >"$root/install.log" ||
        fail "apt-get install failed, see $root/install.log"
    # Certificates of this machine, for registries behind a proxy of its own.
    if [ -e /etc/ssl/certs/ca-certificates.crt ]; then
        cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt"
    fi
    run mpirun --version | sed -nE 's/.*\(Open MPI\) v?([0-9]+).*/\1/p' >"$root/.openmpi"
    run python3 -m venv --system-site-packages /opt/venv
    touch "$root/.complete"
}

# The source tree as it is now, and what Debian lacks of its dependencies.
install_project() {
    rm -rf "$root/src"
    mkdir "$root/src"
    git ls-files -z --cached --others --exclude-standard | tar --null -T - -c | tar -x -C "$root/src"
    run bash -euc '
        cd /src
        # Libraries that Debian built against each other stay: pip may only add to them.
        pip list --format=freeze --path /usr/lib/python3/dist-packages 2>/dev/null |
            grep -iE "^(numpy|scipy|h5py|mpi4py|petsc4py|fenics-[a-z]*|numba|llvmlite|vtk|matplotlib)==" >/constraints.txt
        pip install --quiet --disable-pip-version-check -c /constraints.txt ".[test,demo]"
        pip uninstall --quiet --yes mufe-fenicsx  # the tests use the source tree
        pip install --quiet --disable-pip-version-check --no-deps -e .
    '
}

case "${1:-}" in
    make) make_root ;;
    test)
        shift
        make_root
        install_project
        run bash -euc 'cd /src && python -c "
import importlib.metadata, dolfinx, petsc4py, mpi4py.MPI, h5py, numba
print(\"dolfinx\", dolfinx.__version__, \"petsc4py\", petsc4py.__version__, \"h5py\", h5py.__version__, \"numba\", numba.__version__)
print(mpi4py.MPI.Get_library_version().splitlines()[0])" && exec python -m tests "$@"' tests "$@"
        ;;
    shell) make_root && run bash ;;
    remove) rm -rf --one-file-system "$root" ;;
    *) fail "argument = ${1:-}, expected make, test, shell or remove" ;;
esac
