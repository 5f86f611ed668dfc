#!/bin/sh
# Put this release of vm-embedded in the place of the one that runs, without internet; if it is not well, the old one
# goes on.
set -eu
umask 022

HERE=$(cd "$(dirname "$0")" && pwd -P)
PREFIX=/opt/vm-embedded
SUPERVISOR=
DRY=
OWN_MIB=32 # of a release that shares its packages with the one before
TOOLS="awk cat chmod cmp cut df find flock getconf grep mv readlink sed sha256sum sort"

# shellcheck source=deploy/robot/releases.sh
. "$HERE/releases.sh"

usage() {
    cat <<END
usage: install.sh [--prefix DIR] [--systemd | --no-systemd] [--dry-run]

  --prefix DIR   where releases go; default $PREFIX
  --systemd      as a service: the default, unless the last one was installed otherwise
  --no-systemd   install the program only; the one who starts it restarts it
  --dry-run      check everything, change nothing

Exit status: 0 the release is in use; 1 it is not, and the one before goes on; 2 wrong usage.
END
}

misused() {
    printf 'install.sh: %s\n' "$*" >&2
    usage >&2
    exit 2
}

while [ $# -gt 0 ]; do
    case $1 in
    --prefix)
        [ $# -gt 1 ] || misused "--prefix needs a folder"
        PREFIX=$2
        shift
        ;;
    --prefix=*) PREFIX=${1#*=} ;;
    --systemd) SUPERVISOR=systemd ;;
    --no-systemd) SUPERVISOR=none ;;
    --dry-run) DRY=1 ;;
    -h | --help)
        usage
        exit 0
        ;;
    *) misused "unknown option $1" ;;
    esac
    shift
done
while [ "${PREFIX%/}" != "$PREFIX" ]; do PREFIX=${PREFIX%/}; done
case $PREFIX in
"" | [!/]* | *[!A-Za-z0-9/._+-]*) misused "--prefix must be an absolute path of letters, digits and ._+-/, not '$PREFIX'" ;;
esac

manifest=$HERE/manifest.json

checked_files() {
    say "checking hashes"
    for each in $TOOLS; do
        command -v "$each" >/dev/null || fail "there is no $each: install it (coreutils, util-linux, diffutils)"
    done
    cd "$HERE"
    wrong=$(sha256sum -c SHA256SUMS 2>&1 | grep -v ': OK$' || :)
    [ -z "$wrong" ] || fail "the bundle is damaged, copy it again: $wrong"
    listed=$(sed 's/^[0-9a-f]*  //' SHA256SUMS | sort)
    found=$(find . -type f ! -path ./SHA256SUMS | sed 's|^\./||' | sort)
    [ "$listed" = "$found" ] || fail "the bundle's folder has files that are not of it: unpack it into an empty one"
    cd - >/dev/null
}

checked_machine() {
    say "checking the machine"
    machine=$(field machine "$manifest")
    [ "$(uname -m)" = "$machine" ] || fail "this bundle is for $machine, and this machine is $(uname -m): make bundle" \
        "TARGET=linux_$(uname -m)-$(field python "$manifest")"
    libc=$(getconf GNU_LIBC_VERSION 2>/dev/null || :)
    wanted=$(field glibc "$manifest")
    [ "$(printf '%s\n%s\n' "$wanted" "${libc#* }" | sort -V | head -n 1)" = "$wanted" ] ||
        fail "this bundle needs glibc $wanted or newer, and here is ${libc:-none}: make bundle with a TARGET" \
            "like manylinux_2_17_$machine-$(field python "$manifest"); see README.md"
    if [ "$machine" = x86_64 ]; then
        grep -q -w sse4_2 /proc/cpuinfo || fail "this processor has no SSE 4.2, which numpy needs (x86-64-v2)"
        grep -q -w avx2 /proc/cpuinfo || say "note: this processor has no AVX2; the network takes several times as long"
    fi
}

found_python() { # the interpreter that the bundle is for
    wanted=$(field python "$manifest")
    for each in "/usr/bin/python3.${wanted#cp3}" "python3.${wanted#cp3}" python3; do
        seen=$("$each" -c 'import sys, venv; print("cp%d%d %s" % (*sys.version_info[:2], sys.executable))' 2>/dev/null) ||
            continue
        case "$SUPERVISOR $seen" in
        "none $wanted "* | "systemd $wanted /usr/"* | "systemd $wanted /opt/"*) # a service can't read homes
            say "${seen#* }"
            return
            ;;
        esac
    done
    fail "this bundle is for Python 3.${wanted#cp3}, and here is $(python3 --version 2>&1 || echo none) (one in a" \
        "home does not count for a service): make bundle" \
        "TARGET=linux_$(field machine "$manifest")-cp3XX"
}

checked_folder() {
    folder=$PREFIX
    while [ ! -d "$folder" ]; do folder=$(dirname "$folder"); done
    [ -w "$folder" ] || fail "can't write $folder: be root, or give another --prefix"
    [ ! -e "$PREFIX/releases" ] || [ -e "$PREFIX/supervisor" ] || fail "$PREFIX has a folder releases that is not of this" \
        "program: give another --prefix"
    free=$(df -Pk "$folder" | awk 'NR == 2 { print int($4 / 1024) }')
    needed=$(field disk_mib "$manifest")
    if alike; then needed=$OWN_MIB; fi
    [ "$free" -ge "$needed" ] || fail "$folder has $free MiB left, and this release takes $needed"
}

chosen_supervisor() {
    [ -n "$SUPERVISOR" ] || SUPERVISOR=$(cat "$PREFIX/supervisor" 2>/dev/null || echo systemd)
    [ "$SUPERVISOR" = systemd ] || return 0
    systemctl --version >/dev/null 2>&1 || fail "there is no systemd: use --no-systemd"
    [ "$(id -u)" = 0 ] || fail "be root, or use --no-systemd"
}

kept() { # FOLDER FILE: of the configuration in use, if the bundles have the same; see deploy/README.md
    if cmp -s "$1/bundle/etc/$2" "$HERE/etc/$2" || [ ! -e "$HERE/etc/$2" ]; then
        cp "$1/etc/$2" "$target/etc/$2"
    elif ! cmp -s "$1/etc/$2" "$1/bundle/etc/$2" && ! cmp -s "$1/etc/$2" "$HERE/etc/$2"; then
        cp "$1/etc/$2" "$target/etc/$2.of-$release"
        say "note: the bundle brings a new $2; the robot's own is kept as $PREFIX/current/etc/$2.of-$release"
    fi
}

unpacked() {
    say "copying"
    rm -rf "$target"
    mkdir -p "$target/bundle" "$target/etc"
    sed 's/^[0-9a-f]*  //; /^wheels\//d' "$HERE/SHA256SUMS" | while read -r each; do
        mkdir -p "$target/bundle/$(dirname "$each")"
        cp "$HERE/$each" "$target/bundle/$each"
    done
    cp "$HERE/SHA256SUMS" "$target/bundle/"
    cp "$HERE"/etc/* "$target/etc/"
    used=$PREFIX/current
    [ -d "$used/etc" ] || used=$PREFIX/left
    for each in "$used"/etc/*; do
        if [ -f "$each" ]; then kept "$used" "${each##*/}"; fi
    done
    # Whoever unpacked it, and with whatever umask: the detector reads it, and only who installs may change it.
    chmod -R u=rwX,go=rX "$target"
    if [ "$(id -u)" = 0 ]; then chown -R 0:0 "$target"; fi
}

others() { grep -v '^vm_embedded==' "$1/requirements.txt"; } # packages of other projects, with their hashes

alike() { # whether the current release has the same ones
    whole "$(linked current)" && [ "$(others "$HERE")" = "$(others "$PREFIX/current/bundle")" ]
}

installed() {
    say "installing packages"
    "$python" -m venv --without-pip "$target/venv"
    needed=$HERE/requirements.txt
    if alike && (cd "$PREFIX/current/venv" && cp -al --parents lib/python*/site-packages "$target/venv/"); then
        needed=$target/own.txt # the others take no space and no time
        grep '^vm_embedded==' "$HERE/requirements.txt" >"$needed"
    fi
    "$target/venv/bin/python" "$(echo "$HERE"/wheels/pip-*.whl)/pip" --isolated install --quiet --no-index \
        --find-links "$HERE/wheels" --no-deps --require-hashes --force-reinstall --requirement "$needed" \
        --disable-pip-version-check --no-cache-dir --root-user-action ignore
}

tried() {
    say "testing the model"
    "$target/venv/bin/vm-detect" --config "$target/etc/vm.toml" --check-config
    "$target/venv/bin/vm-doctor" --config "$target/etc/vm.toml" || say "note: vm-doctor found what is above"
}

abandoned() { # the new release, before it was ever in use
    trap - EXIT
    rm -rf "$target"
    fail "nothing has changed"
}

checked_files
checked_machine
chosen_supervisor
python=$(found_python)
checked_folder
release=$(field release "$manifest")
if [ -n "$DRY" ]; then
    say "would install $release into $PREFIX/releases with $python (supervisor: $SUPERVISOR)"
    exit 0
fi

mkdir -p "$PREFIX" || fail "can't write $PREFIX"
lock 0
[ -e "$PREFIX/supervisor" ] || written supervisor "$SUPERVISOR"
mkdir -p "$PREFIX/releases"
settled
case $(linked current) in
"$release" | "$release"+*)
    if supervised && booted; then systemctl is-active --quiet "$UNIT" || start || fail "$release does not start"; fi
    say "$release is in use already"
    exit 0
    ;;
esac
number=2
while whole "$release"; do # it is the one before: a way back that stays until this one is well
    release=$(field release "$manifest")+$number
    number=$((number + 1))
done
target=$PREFIX/releases/$release
trap abandoned EXIT
trap 'exit 1' INT TERM HUP
unpacked
installed
tried
touch "$target/complete"
sync
trap - EXIT

if supervised && [ "$SUPERVISOR" = none ]; then forgotten; fi
written supervisor "$SUPERVISOR"
ln -sfn current/bundle/vm-deploy "$PREFIX/vm-deploy"
if ! activate "$release"; then
    rm -rf "$target"
    exit 1
fi
rm -rf "$PREFIX/left"
prune
say "$release is in use"
if ! supervised; then
    say "start it: $PREFIX/current/venv/bin/vm-detect --config $PREFIX/current/etc/vm.toml"
fi
