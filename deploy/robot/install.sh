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

# shellcheck source=deploy/robot/releases.sh
. "$HERE/releases.sh"

usage() {
    cat <<END
usage: install.sh [--prefix DIR] [--no-systemd] [--dry-run]

  --prefix DIR   where releases go; default $PREFIX
  --no-systemd   install the program only; the one who starts it restarts it
  --dry-run      check everything, change nothing

Exit status: 0 the release is in use; 1 it is not, and nothing has changed; 2 wrong usage.
END
}

while [ $# -gt 0 ]; do
    case $1 in
    --prefix)
        PREFIX=${2-}
        shift $(($# > 1))
        ;;
    --prefix=*) PREFIX=${1#*=} ;;
    --no-systemd) SUPERVISOR=none ;;
    --dry-run) DRY=1 ;;
    -h | --help)
        usage
        exit 0
        ;;
    *)
        printf 'install.sh: unknown option %s\n' "$1" >&2
        usage >&2
        exit 2
        ;;
    esac
    shift
done
case $PREFIX in
/*[!A-Za-z0-9/._+-]* | [!/]* | / | "") fail "--prefix must be an absolute path of letters, digits and ._+-/, not $PREFIX" ;;
esac
PREFIX=${PREFIX%/}

manifest=$HERE/manifest.json
release=$(field release "$manifest")

checked_hashes() {
    say "checking hashes"
    (cd "$HERE" && sha256sum --check --quiet SHA256SUMS) || fail "the bundle is damaged: copy it again"
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
    for each in sha256sum flock readlink df sed mv; do
        command -v $each >/dev/null || fail "there is no $each: install it (coreutils, util-linux)"
    done
}

found_python() { # the interpreter that the bundle is for
    wanted=$(field python "$manifest")
    for python in "python3.${wanted#cp3}" python3; do
        seen=$("$python" -c 'import sys, venv; print("cp%d%d" % sys.version_info[:2])' 2>/dev/null) || continue
        [ "$seen" != "$wanted" ] || { command -v "$python"; return; }
    done
    fail "this bundle is for Python 3.${wanted#cp3}, and here is $(python3 --version 2>&1 || echo none): make bundle" \
        "TARGET=linux_$(field machine "$manifest")-cp3XX"
}

checked_space() {
    folder=$PREFIX
    while [ ! -d "$folder" ]; do folder=$(dirname "$folder"); done
    free=$(df -Pk "$folder" | awk 'NR == 2 { print int($4 / 1024) }')
    needed=$(field disk_mib "$manifest")
    if alike; then needed=$OWN_MIB; fi
    [ "$free" -ge "$needed" ] || fail "$folder has $free MiB left, and this release takes $needed"
}

chosen_supervisor() {
    [ -z "$SUPERVISOR" ] || return 0
    SUPERVISOR=$(cat "$PREFIX/supervisor" 2>/dev/null || echo systemd)
    [ "$SUPERVISOR" != systemd ] || systemctl --version >/dev/null 2>&1 || fail "there is no systemd: use --no-systemd"
    [ "$SUPERVISOR" != systemd ] || [ "$(id -u)" = 0 ] || fail "be root, or use --no-systemd"
}

kept() { # FILE: of the configuration in use, if nobody but this robot has changed it; see deploy/README.md
    for used in "$PREFIX/current" "$PREFIX/left"; do
        [ -d "$used/etc" ] || continue
        [ -e "$used/etc/$1" ] || return 0
        if cmp -s "$used/bundle/etc/$1" "$HERE/etc/$1" || [ ! -e "$HERE/etc/$1" ]; then
            cp -p "$used/etc/$1" "$target/etc/$1"
        elif ! cmp -s "$used/etc/$1" "$used/bundle/etc/$1" && ! cmp -s "$used/etc/$1" "$HERE/etc/$1"; then
            cp -p "$used/etc/$1" "$target/etc/$1.of-${release}"
            say "note: the bundle brings a new $1; the robot's own is kept as $PREFIX/current/etc/$1.of-${release}"
        fi
        return 0
    done
}

unpacked() {
    say "copying"
    rm -rf "$target"
    mkdir -p "$target/bundle" "$target/etc"
    (cd "$HERE" && find . -path ./wheels -prune -o -type f -print) | while read -r each; do
        mkdir -p "$target/bundle/$(dirname "$each")"
        cp -p "$HERE/$each" "$target/bundle/$each"
    done
    cp -p "$HERE"/etc/* "$target/etc/"
    for used in "$PREFIX/current" "$PREFIX/left"; do
        [ -d "$used/etc" ] || continue
        for each in "$used"/etc/*; do kept "${each##*/}"; done
        break
    done
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

checked_hashes
checked_machine
python=$(found_python)
checked_space
chosen_supervisor
if [ -n "$DRY" ]; then
    say "would install $release into $PREFIX/releases with $python (supervisor: $SUPERVISOR)"
    exit 0
fi

mkdir -p "$PREFIX/releases" || fail "can't write $PREFIX"
lock
settled
case $(linked current) in
"$release" | "$release"+*)
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

printf '%s\n' "$SUPERVISOR" >"$PREFIX/supervisor"
ln -sfn current/bundle/vm-deploy "$PREFIX/vm-deploy"
if ! activate "$release"; then
    rm -rf "$target"
    exit 1
fi
if supervised; then systemctl enable --quiet "$UNIT"; fi
rm -rf "$PREFIX/left"
prune
say "$release is in use"
if ! supervised; then
    say "start it: $PREFIX/current/venv/bin/vm-detect --config $PREFIX/current/etc/vm.toml"
fi
