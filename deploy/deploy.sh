#!/bin/sh
# Copy a bundle to a robot over ssh, install it there, and show the state and the last detections.
set -eu

if [ $# != 2 ]; then
    echo "usage: deploy.sh BUNDLE.tar.gz USER@HOST" >&2
    exit 2
fi
bundle=$1 robot=$2
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
ssh -T "$robot" "tar -xzf $folder/bundle.tar.gz -C $folder && rm $folder/bundle.tar.gz"
# shellcheck disable=SC2016 # the robot expands this
root='if [ "$(id -u)" = 0 ]; then s=; else s=sudo; fi; $s'
on_robot "$root sh $folder/*/install.sh"
on_robot "$root /opt/vm-embedded/vm-deploy status"
