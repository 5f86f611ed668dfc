#!/bin/sh
# Copy a bundle to a robot over ssh, check and install it there, and show the state and the last detections.
set -eu

if [ $# -lt 2 ]; then
    echo "usage: deploy.sh BUNDLE.tar.gz USER@HOST [OPTION OF INSTALL.SH...]" >&2
    exit 2
fi
bundle=$1 robot=$2
shift 2
[ -r "$bundle" ] || { echo "deploy.sh: can't read $bundle; make it with: make bundle" >&2; exit 1; }
terminal=-T
if [ -t 0 ]; then terminal=-t; fi # for sudo, which may ask for a password

# shellcheck disable=SC2029 # variables expand on this side, and contain nothing special to a shell
on_robot() { ssh "$terminal" "$robot" "$@"; }

folder=$(ssh -T "$robot" 'mktemp -d /var/tmp/vm-embedded.XXXXXX')
trap 'ssh -T "$robot" "rm -rf $folder" || :' EXIT
trap 'exit 1' INT TERM HUP
echo "copying $bundle to $robot"
if command -v rsync >/dev/null && ssh -T "$robot" 'command -v rsync' >/dev/null; then
    rsync --partial --progress "$bundle" "$robot:$folder/bundle.tar.gz"
else
    scp -q "$bundle" "$robot:$folder/bundle.tar.gz"
fi
# shellcheck disable=SC2016 # the robot expands this
root='if [ "$(id -u)" = 0 ]; then s=; else s=sudo; fi; $s'
deploy=/opt/vm-embedded/vm-deploy
# shellcheck disable=SC2016 # the robot expands this
if ssh -T "$robot" "[ -x $deploy ]"; then
    on_robot "$root $deploy install $folder/bundle.tar.gz $*"
else # the first installation: check all files before any of them runs
    on_robot "tar -xzf $folder/bundle.tar.gz -C $folder --strip-components=1 && rm $folder/bundle.tar.gz && cd $folder &&" \
        '[ -z "$(find . ! -type f ! -type d)" ] && sha256sum --check --strict --quiet SHA256SUMS &&' \
        "$root sh $folder/install.sh $*"
fi
on_robot "$root $deploy status"
