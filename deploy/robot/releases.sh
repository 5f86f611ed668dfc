# The layout of releases, and how one release replaces another. install.sh, vm-deploy and uninstall.sh source this file
# and set PREFIX.
#
#   PREFIX/releases/ID/bundle   the bundle without its wheels
#   PREFIX/releases/ID/venv     the program
#   PREFIX/releases/ID/etc      vm.toml, model and lens in use; .old.onnx while a new model is on trial;
#                               .previous.onnx, the model before, if the last change was one of the model
#   PREFIX/releases/ID/complete written last: a release without it is incomplete
#   PREFIX/current, previous    links to releases; the unit starts `current`
#   PREFIX/trial                the two links before the switch; exists until `current` has proved healthy
#   PREFIX/model-signed         signing time and hash of the last signed model that was accepted
#   PREFIX/.bundle              a bundle that vm-deploy install has unpacked
#   PREFIX/supervisor           systemd or none; marks the folder as ours
#   PREFIX/run                  sockets of the detector, without systemd
#   PREFIX/left                 what uninstall.sh keeps for the next install.sh
# shellcheck shell=sh

OURS="releases current previous trial model-signed supervisor run left vm-deploy" # in PREFIX; the rest is the user's
UNITS=/etc/systemd/system
RULES=/etc/udev/rules.d
COMMAND=/usr/local/bin/vm-deploy
UNIT=vm-detect.service
RESCUE=vm-detect-rollback.service
RULE=60-vm-embedded.rules
PATIENCE=3 # times in a row, a second apart, that a release must be ok

trap '' PIPE # finish the work even if the reader of the output disappears

say() { printf '%s\n' "$*" 2>/dev/null || :; }

fail() {
    printf '%s: %s\n' "${0##*/}" "$*" >&2 || :
    exit 1
}

field() { # NAME FILE: print an entry of a manifest.json, which has one entry per line
    sed -n "s/^ *\"$1\": \"\{0,1\}\([^\",]*\)\"\{0,1\},\{0,1\}\$/\1/p" "$2" | head -n 1
}

linked() { # LINK: print the release that the link points to, or nothing
    if [ -L "$PREFIX/$1" ]; then basename "$(readlink "$PREFIX/$1")"; fi
}

write_file() { # NAME TEXT: replace a file in PREFIX atomically
    printf '%s\n' "$2" >"$PREFIX/.$1.new" && mv -f "$PREFIX/.$1.new" "$PREFIX/$1"
}

set_link() { # LINK RELEASE: change a link atomically; remove it if RELEASE is empty
    if [ -n "$2" ]; then
        ln -sfn "releases/$2" "$PREFIX/.$1.new" && mv -fT "$PREFIX/.$1.new" "$PREFIX/$1"
    else
        rm -f "$PREFIX/$1"
    fi
}

is_complete() { [ -n "$1" ] && [ -e "$PREFIX/releases/$1/complete" ]; } # RELEASE

uses_systemd() {
    case $(cat "$PREFIX/supervisor" 2>/dev/null || echo none) in
    systemd) return 0 ;;
    none) return 1 ;;
    *) fail "$PREFIX/supervisor must contain systemd or none" ;;
    esac
}

systemd_runs() { [ -d /run/systemd/system ]; } # it does not in a chroot, while the image of a robot is built

lock() { # SECONDS: wait for other commands of this program for so long, then fail
    # install.sh inherits the lock of vm-deploy install.
    if [ "$(readlink /proc/self/fd/9)" != "$PREFIX/.lock" ]; then
        (umask 077 && : >>"$PREFIX/.lock") 2>/dev/null ||
            fail "can't write $PREFIX: run as root or choose another --prefix"
        exec 9>>"$PREFIX/.lock"
    fi
    flock -w "$1" 9 || fail "another install.sh or vm-deploy is running"
    case $(readlink /proc/self/fd/9) in # the next command would lock another file of this name
    *" (deleted)") fail "uninstall.sh has just removed $PREFIX: run this command again" ;;
    esac
}

uptime_seconds() { cut -d . -f 1 /proc/uptime; } # a clock that nobody can set

sockets() { if uses_systemd; then say /run/vm-detect; else say "$PREFIX/run"; fi; } # print their folder

detect() { # ARGUMENT...: run vm-detect of the current release with its configuration
    RUNTIME_DIRECTORY=$(sockets) "$PREFIX/current/venv/bin/vm-detect" --config "$PREFIX/current/etc/vm.toml" "$@"
}

say_restart() { # say how a change comes into use without systemd: nothing else starts the detector
    if uses_systemd; then return; fi
    if [ -n "$(state)" ]; then
        say "the detector that runs does not use it yet: stop it, and start it again with $PREFIX/vm-deploy run"
    else
        say "start the detector with $PREFIX/vm-deploy run"
    fi
}

setting() { # NAME: print an entry of [deploy]
    printed=$(detect --print-config) || return 1
    say "$printed" | sed -n "/^\[deploy\]/,/^\[/ s/^$1 = \"\{0,1\}\([^\"]*\)\"\{0,1\}\$/\1/p"
}

state() { # print the state of the running detector and the reason; print nothing if none runs
    detect --status 2>/dev/null | sed -n 's/^{"type": "state", "state": "\([a-z_]*\)".*"reason": "\([^"]*\)".*/\1 \2/p'
}

install_file() { # FILE FOLDER: copy a file of the current release to a folder of the system
    mkdir -p "$2" || return 1
    sed "s|@PREFIX@|$PREFIX|g" "$PREFIX/current/bundle/$1" >"$2/.$1.new" && mv -f "$2/.$1.new" "$2/$1"
}

start_service() { # start the current release, and wait until it is READY
    install_file "$UNIT" "$UNITS" && install_file "$RESCUE" "$UNITS" && install_file "$RULE" "$RULES" || return 1
    mkdir -p "${COMMAND%/*}" && ln -sfn "$PREFIX/vm-deploy" "$COMMAND" || return 1
    if systemd_runs; then systemctl daemon-reload || return 1; fi
    systemctl enable --quiet "$UNIT" || return 1
    systemd_runs || return 0
    udevadm control --reload 2>/dev/null || :
    systemctl reset-failed "$UNIT" 2>/dev/null || :
    systemctl restart "$UNIT"
}

remove_service() { # remove unit, udev rule and command from the system
    systemctl disable --now "$UNIT" 2>/dev/null || :
    rm -f "$UNITS/$UNIT" "$UNITS/$RESCUE" "$RULES/$RULE" "$COMMAND"
    if systemd_runs; then systemctl daemon-reload || :; fi
    udevadm control --reload 2>/dev/null || :
}

becomes_healthy() { # STATE: whether the detector becomes ok in time, or at least stays in its former state
    limit=$(setting healthy_s) || limit=
    limit=${limit:-30}
    end=$(($(uptime_seconds) + ${limit%%.*}))
    good=0 found=
    while [ "$(uptime_seconds)" -lt "$end" ] && ! systemctl is-failed --quiet "$UNIT"; do
        found=$(state)
        case $found in
        ok*) good=$((good + 1)) ;;
        *) good=0 ;;
        esac
        [ "$good" -lt "$PATIENCE" ] || return 0
        sleep 1
    done
    if [ -n "$found" ] && [ "${found%% *}" = "$1" ]; then
        say "the state is $found, as it was before"
        return 0
    fi
    say "the state is ${found:-unknown, the detector does not run}"
    return 1
}

activate() { # RELEASE: make it the current one; roll back if it does not become healthy
    old=$(linked current) older=$(linked previous)
    before=$(if [ -n "$old" ]; then state; else say camera_lost; fi)
    write_file trial "$old
$older" || return 1
    trap 'set +e; say interrupted; roll_back; exit 1' INT TERM HUP
    sync
    say "switching from ${old:-nothing} to $1"
    if ! { set_link current "$1" && set_link previous "$old"; }; then
        roll_back
        return 1
    fi
    if uses_systemd; then
        say "starting $UNIT"
        if ! { start_service && say "watching its state" && { ! systemd_runs || becomes_healthy "${before%% *}"; }; }; then
            say "$1 is not healthy:"
            journalctl --unit "$UNIT" --lines 10 --no-pager --output cat 2>/dev/null || :
            roll_back
            return 1
        fi
    fi
    rm -f "$PREFIX/trial" "$PREFIX/current/etc/.previous.onnx" # the last change is one of the release
    trap - INT TERM HUP
    sync
}

roll_back() { # to the release before the one on trial; safe to repeat after an interruption
    old=$(sed -n 1p "$PREFIX/trial") older=$(sed -n 2p "$PREFIX/trial")
    if is_complete "$old"; then
        say "rolling back to $old"
        set_link current "$old" && set_link previous "$older" || return 1
        sync
        if uses_systemd; then start_service || say "$old does not start either; see systemctl status $UNIT"; fi
    else
        say "there is no release to roll back to"
        if uses_systemd; then remove_service; fi
        set_link current ""
    fi
    rm -f "$PREFIX/trial"
    sync
}

restore_model() { # bring the old model back
    say "rolling back to the old model"
    mv -f "$PREFIX/current/etc/.old.onnx" "$PREFIX/current/etc/model.onnx"
    sync
}

keep_old_model() { # for vm-deploy rollback: the new one is accepted
    [ -e "$PREFIX/current/etc/.old.onnx" ] || return 0
    if cmp -s "$PREFIX/current/etc/.old.onnx" "$PREFIX/current/etc/model.onnx"; then
        rm -f "$PREFIX/current/etc/.old.onnx"
    else
        mv -f "$PREFIX/current/etc/.old.onnx" "$PREFIX/current/etc/.previous.onnx"
    fi
}

finish_trial() { # of an interrupted command: keep the release and the model on trial if the detector is ok
    [ -e "$PREFIX/trial" ] || [ -e "$PREFIX/current/etc/.old.onnx" ] || return 0
    say "an earlier install.sh or vm-deploy was interrupted"
    case $(if uses_systemd && systemd_runs; then state; else say ok; fi) in
    ok*)
        keep_old_model
        rm -f "$PREFIX/trial"
        ;;
    *) end_trial ;;
    esac
}

end_trial() { # roll back the model and the release on trial
    if [ -e "$PREFIX/current/etc/.old.onnx" ]; then
        restore_model
        if [ ! -e "$PREFIX/trial" ] && uses_systemd; then start_service || :; fi
    fi
    if [ -e "$PREFIX/trial" ]; then roll_back; fi
}

prune() { # remove releases that are neither current nor previous, and what a killed vm-deploy install left
    rm -rf "$PREFIX/.bundle"
    for each in "$PREFIX"/releases/*; do
        case ${each##*/} in
        "$(linked current)" | "$(linked previous)") ;;
        *) rm -rf "$each" ;;
        esac
    done
}
