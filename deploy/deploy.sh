#!/bin/sh
# From this workstation to a robot that answers ssh: copy a bundle, install it, and show what it sees.
set -eu

if [ $# != 2 ]; then
    echo "usage: deploy.sh BUNDLE.tar.gz USER@HOST" >&2
    exit 2
fi
bundle=$1 robot=$2
[ -r "$bundle" ] || { echo "deploy.sh: can't read $bundle: make bundle" >&2; exit 1; }
terminal=-T
if [ -t 0 ]; then terminal=-t; fi # for sudo, which may ask for a password

# shellcheck disable=SC2029 # names are of this side, and free of what a shell would read
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
# shellcheck disable=SC2016 # the robot asks itself who it is
root='if [ "$(id -u)" = 0 ]; then s=; else s=sudo; fi; $s'
on_robot "$root sh $folder/*/install.sh"
on_robot "$root /opt/vm-embedded/vm-deploy status"
