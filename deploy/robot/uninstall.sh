#!/bin/sh
# Remove vm-embedded from this robot; its configuration stays for the next install.sh.
set -eu
umask 022

HERE=$(cd "$(dirname "$0")" && pwd -P)
PREFIX=/opt/vm-embedded
PURGE=
if [ -e "$HERE/../complete" ]; then PREFIX=${HERE%/releases/*}; fi # this file belongs to an installed release

# shellcheck source=deploy/robot/releases.sh
. "$HERE/releases.sh"

usage() {
    cat <<END
usage: uninstall.sh [--prefix DIR] [--purge]

  --prefix DIR  folder of the releases; default: the installation that contains this script, or /opt/vm-embedded
  --purge       also remove the configuration
END
}

while [ $# -gt 0 ]; do
    case $1 in
    --prefix)
        PREFIX=${2-}
        shift $(($# > 1))
        ;;
    --prefix=*) PREFIX=${1#*=} ;;
    --purge) PURGE=1 ;;
    -h | --help)
        usage
        exit 0
        ;;
    *)
        printf 'uninstall.sh: unknown option %s\n' "$1" >&2
        usage >&2
        exit 2
        ;;
    esac
    shift
done
PREFIX=${PREFIX%/}
[ -e "$PREFIX/supervisor" ] || [ -e "$PREFIX/left/etc/vm.toml" ] || fail "nothing is installed at $PREFIX"

lock 0
if uses_systemd; then remove_service; fi
if [ -e "$PREFIX/supervisor" ] && [ -d "$PREFIX/current/etc" ]; then
    rm -rf "$PREFIX/.left.new"
    mkdir -p "$PREFIX/.left.new/bundle"
    cp -rp "$PREFIX/current/etc" "$PREFIX/.left.new/etc"
    cp -rp "$PREFIX/current/bundle/etc" "$PREFIX/.left.new/bundle/etc"
    rm -rf "$PREFIX/left"
    mv "$PREFIX/.left.new" "$PREFIX/left"
fi
if [ -e "$PREFIX/supervisor" ]; then # it goes last, because it says that the rest is ours
    for each in $OURS .bundle; do
        case $each in left | supervisor) ;; *) rm -rf "${PREFIX:?}/$each" ;; esac
    done
    rm -f "$PREFIX/supervisor"
fi
if [ -n "$PURGE" ]; then
    rm -rf "$PREFIX/left" "$PREFIX/.lock"
    rmdir "$PREFIX" 2>/dev/null || :
    say "vm-embedded is removed"
else
    say "vm-embedded is removed; its configuration stays in $PREFIX/left for the next install.sh (--purge removes it)"
fi
