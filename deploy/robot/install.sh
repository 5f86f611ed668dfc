#!/bin/sh
# Install this release of vm-embedded on the robot, without internet. If it does not become healthy, roll back to the
# release before.
set -eu
umask 022

HERE=$(cd "$(dirname "$0")" && pwd -P)
PREFIX=/opt/vm-embedded
SUPERVISOR=
DRY=
ALLOW_OLDER=
OWN_MIB=32 # size of a release that shares its packages with the one before
TOOLS="awk base64 cat chmod cmp cut df find flock getconf grep mv readlink sed sha256sum sort tar"

# shellcheck source=deploy/robot/releases.sh
. "$HERE/releases.sh"
# shellcheck source=deploy/robot/verify.sh
. "$HERE/verify.sh"

usage() {
    cat <<END
usage: install.sh [--prefix DIR] [--systemd | --no-systemd] [--allow-older] [--dry-run]

  --prefix DIR   folder of the releases; default $PREFIX
  --systemd      install it as a service; the default, unless the last installation used --no-systemd
  --no-systemd   install only the program; start it with vm-deploy run, and again after each change
  --allow-older  install it even if it is older than the release in use
  --dry-run      check everything, change nothing

Exit status: 0 the release is in use; 1 it failed, and the previous release stays in use; 2 wrong usage.
END
}

usage_error() {
    printf 'install.sh: %s\n' "$*" >&2
    usage >&2
    exit 2
}

while [ $# -gt 0 ]; do
    case $1 in
    --prefix)
        [ $# -gt 1 ] || usage_error "--prefix needs a folder"
        PREFIX=$2
        shift
        ;;
    --prefix=*) PREFIX=${1#*=} ;;
    --systemd) SUPERVISOR=systemd ;;
    --no-systemd) SUPERVISOR=none ;;
    --allow-older) ALLOW_OLDER=1 ;;
    --dry-run) DRY=1 ;;
    -h | --help)
        usage
        exit 0
        ;;
    *) usage_error "unknown option $1" ;;
    esac
    shift
done
while [ "${PREFIX%/}" != "$PREFIX" ]; do PREFIX=${PREFIX%/}; done
case $PREFIX in
"" | [!/]* | *[!A-Za-z0-9/._+-]*) usage_error "--prefix must be an absolute path of letters, digits and ._+-/, not '$PREFIX'" ;;
esac

manifest=$HERE/manifest.json

check_files() {
    say "checking hashes"
    for each in $TOOLS; do
        command -v "$each" >/dev/null || fail "$each is missing: install it (coreutils, util-linux, diffutils, tar)"
    done
    check_listing "$HERE"
    case $(field release "$manifest") in
    "" | .* | *[!A-Za-z0-9.+-]*) fail "manifest.json has no release of letters, digits and .+-" ;;
    esac
}

check_machine() {
    say "checking the machine"
    machine=$(field machine "$manifest")
    [ "$(uname -m)" = "$machine" ] || fail "this bundle is for $machine, but this machine is $(uname -m): run make bundle" \
        "TARGET=linux_$(uname -m)-$(field python "$manifest")"
    libc=$(getconf GNU_LIBC_VERSION 2>/dev/null || :)
    wanted=$(field glibc "$manifest")
    [ "$(printf '%s\n%s\n' "$wanted" "${libc#* }" | sort -V | head -n 1)" = "$wanted" ] ||
        fail "this bundle needs glibc $wanted or newer, but this machine has ${libc:-none}: run make bundle with a TARGET" \
            "like manylinux_2_17_$machine-$(field python "$manifest"); see README.md"
    if [ "$machine" = x86_64 ]; then
        grep -q -w sse4_2 /proc/cpuinfo || fail "this processor has no SSE 4.2, which numpy needs (x86-64-v2)"
        grep -q -w avx2 /proc/cpuinfo || say "note: this processor has no AVX2; the network will be several times slower"
    fi
}

find_python() { # print the path of the interpreter that the bundle needs
    wanted=$(field python "$manifest")
    for each in "/usr/bin/python3.${wanted#cp3}" "python3.${wanted#cp3}" python3; do
        seen=$("$each" -c 'import sys, venv; print("cp%d%d %s" % (*sys.version_info[:2], sys.executable))' 2>/dev/null) ||
            continue
        case "$SUPERVISOR $seen" in
        "none $wanted "* | "systemd $wanted /usr/"* | "systemd $wanted /opt/"*) # a service can't read home folders
            say "${seen#* }"
            return
            ;;
        esac
    done
    fail "this bundle needs Python 3.${wanted#cp3} with venv, but this machine has" \
        "$(python3 --version 2>&1 || echo none) (a service can't use one in a home folder): run make bundle" \
        "TARGET=linux_$(field machine "$manifest")-cp3XX"
}

check_folder() {
    folder=$PREFIX
    while [ ! -d "$folder" ]; do folder=$(dirname "$folder"); done
    [ -w "$folder" ] || fail "can't write $folder: run as root or choose another --prefix"
    if [ -f "$PREFIX/supervisor" ]; then
        uses_systemd || : # fails if another program wrote this file
    else
        for each in $OURS; do
            if [ "$each" = left ] && [ -d "$PREFIX/left/bundle/etc" ]; then continue; fi # from uninstall.sh
            if [ -e "$PREFIX/$each" ] || [ -L "$PREFIX/$each" ]; then
                fail "$PREFIX/$each belongs to another program: choose another --prefix"
            fi
        done
    fi
    free=$(df -Pk "$folder" | awk 'NR == 2 { print int($4 / 1024) }')
    needed=$(field disk_mib "$manifest")
    if same_packages; then needed=$OWN_MIB; fi
    [ "$free" -ge "$needed" ] || fail "$folder has $free MiB left, but this release needs $needed MiB"
}

choose_supervisor() {
    [ -n "$SUPERVISOR" ] || SUPERVISOR=$(cat "$PREFIX/supervisor" 2>/dev/null || echo systemd)
    [ "$SUPERVISOR" = systemd ] || return 0
    systemctl --version >/dev/null 2>&1 || fail "systemd is missing: use --no-systemd"
    [ "$(id -u)" = 0 ] || fail "run as root or use --no-systemd"
}

keep_changes() { # FOLDER FILE: keep a file that was changed on the robot; see "Changes on the robot" in README.md
    if cmp -s "$1/bundle/etc/$2" "$HERE/etc/$2" || [ ! -e "$HERE/etc/$2" ]; then
        cp "$1/etc/$2" "$target/etc/$2"
    elif ! cmp -s "$1/etc/$2" "$1/bundle/etc/$2" && ! cmp -s "$1/etc/$2" "$HERE/etc/$2"; then
        cp "$1/etc/$2" "$target/etc/$2.of-$release"
        say "note: the bundle has a new $2; the one from this robot is saved as $PREFIX/current/etc/$2.of-$release"
    fi
}

copy_files() {
    say "copying"
    rm -rf "$target"
    mkdir -p "$target/bundle" "$target/etc"
    sed 's/^[0-9a-f]*  //; /^wheels\//d' "$HERE/SHA256SUMS" | while read -r each; do
        mkdir -p "$target/bundle/$(dirname "$each")"
        cp -P "$HERE/$each" "$target/bundle/$each"
    done
    cp -P "$HERE"/SHA256SUMS* "$target/bundle/"
    cp -P "$target/bundle/etc/"* "$target/etc/"
    used=$PREFIX/current
    [ -d "$used/etc" ] || used=$PREFIX/left
    for each in "$used"/etc/*; do
        if [ -f "$each" ]; then keep_changes "$used" "${each##*/}"; fi
    done
    # Independent of the umask of the unpacking: everybody may read the files, only the installing user may change them.
    chmod -R u=rwX,go=rX "$target"
    if [ "$(id -u)" = 0 ]; then chown -R 0:0 "$target"; fi
}

dependencies() { grep ' wheels/' "$1/SHA256SUMS" | grep -v ' wheels/vm_embedded-'; } # FOLDER: print wheels with hashes

same_packages() { # whether the current release has the same dependencies
    is_complete "$(linked current)" && [ "$(dependencies "$HERE")" = "$(dependencies "$PREFIX/current/bundle")" ]
}

install_packages() {
    say "installing packages"
    "$python" -m venv --without-pip "$target/venv"
    if same_packages && (cd "$PREFIX/current/venv" && cp -al --parents lib/python*/site-packages "$target/venv/"); then
        rm -rf "$target"/venv/lib/python*/site-packages/vm_* # the rest are hard links to the dependencies
        set -- "$HERE"/wheels/vm_embedded-*.whl
    else
        rm -rf "$target"/venv/lib/python*/site-packages/* # what an incomplete cp has left
        for each in "$HERE"/wheels/*.whl; do
            case ${each##*/} in installer-*) ;; *) set -- "$@" "$each" ;; esac
        done
    fi
    problem=$(PYTHONPATH=$(echo "$HERE"/wheels/installer-*.whl) \
        "$target/venv/bin/python" -m installer --compile-bytecode 0 "$@" 2>&1) ||
        fail "can't unpack the packages: $(say "$problem" | sed -n '$p')"
}

test_release() {
    say "testing the model"
    RUNTIME_DIRECTORY=/run/vm-detect # where the sockets will be
    if [ "$SUPERVISOR" = none ]; then
        RUNTIME_DIRECTORY=$PREFIX/run
        mkdir -p "$RUNTIME_DIRECTORY"
    fi
    export RUNTIME_DIRECTORY
    "$target/venv/bin/vm-detect" --config "$target/etc/vm.toml" --check-config
    "$target/venv/bin/vm-doctor" --config "$target/etc/vm.toml" || say "note: vm-doctor found the problems above"
}

abandon() { # the new release, before it was in use
    trap - EXIT
    rm -rf "$target"
    fail "nothing has changed"
}

check_files
check_machine
choose_supervisor
check_age "$HERE"
python=$(find_python)
check_folder
release=$(field release "$manifest")
if [ -n "$DRY" ]; then
    say "would install $release into $PREFIX/releases with $python (supervisor: $SUPERVISOR)"
    exit 0
fi

mkdir -p "$PREFIX" || fail "can't write $PREFIX"
# Root's service and its rollback work only with files of root.
if [ "$SUPERVISOR" = systemd ] && [ "$(stat -c %u "$PREFIX")" != 0 ]; then
    chown 0:0 "$PREFIX"
    for each in $OURS; do
        if [ -e "$PREFIX/$each" ]; then chown -R 0:0 "$PREFIX/$each"; fi
    done
fi
lock 0
[ -e "$PREFIX/supervisor" ] || write_file supervisor "$SUPERVISOR"
mkdir -p "$PREFIX/releases"
finish_trial
case $(linked current) in
"$release" | "$release"+*)
    if uses_systemd && systemd_runs; then systemctl is-active --quiet "$UNIT" || start_service || fail "$release does not start"; fi
    say "$release is already in use"
    exit 0
    ;;
esac
number=2
while is_complete "$release"; do # it is `previous`: keep it to roll back to, and install under another name
    release=$(field release "$manifest")+$number
    number=$((number + 1))
done
target=$PREFIX/releases/$release
trap abandon EXIT
trap 'exit 1' INT TERM HUP
copy_files
install_packages
test_release
touch "$target/complete"
sync
trap - EXIT

if uses_systemd && [ "$SUPERVISOR" = none ]; then remove_service; fi
write_file supervisor "$SUPERVISOR"
ln -sfn current/bundle/vm-deploy "$PREFIX/vm-deploy"
if ! activate "$release"; then
    rm -rf "$target"
    exit 1
fi
rm -rf "$PREFIX/left"
prune
say "$release is in use"
say_restart
