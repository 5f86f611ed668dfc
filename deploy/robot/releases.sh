# Where releases are, and how one gives way to another; read by install.sh, vm-deploy and uninstall.sh, which set PREFIX.
#
#   PREFIX/releases/ID/bundle   what was delivered, but for the wheels
#   PREFIX/releases/ID/venv     the program
#   PREFIX/releases/ID/etc      vm.toml, model and lens as they are used; .old.onnx while a new model is on trial
#   PREFIX/releases/ID/complete written last: a release without it is none
#   PREFIX/current, previous    links to releases; `current` is what the unit starts
#   PREFIX/trial                while `current` has not shown yet that it is well: the two links before it
#   PREFIX/supervisor           systemd, or none; whose folder this is
# shellcheck shell=sh

UNITS=/etc/systemd/system
RULES=/etc/udev/rules.d
COMMAND=/usr/local/bin/vm-deploy
UNIT=vm-detect.service
RESCUE=vm-detect-rollback.service
RULE=60-vm-embedded.rules
PATIENCE=3 # times in a row, a second apart, that a release must be ok

trap '' PIPE # who listens may go away; what was begun is finished

say() { printf '%s\n' "$*" 2>/dev/null || :; }

fail() {
    printf '%s: %s\n' "${0##*/}" "$*" >&2 || :
    exit 1
}

field() { # NAME FILE: an entry of a manifest.json, which has one on each line
    sed -n "s/^ *\"$1\": \"\{0,1\}\([^\",]*\)\"\{0,1\},\{0,1\}\$/\1/p" "$2" | head -n 1
}

linked() { # LINK: the release that it points to, or nothing
    if [ -L "$PREFIX/$1" ]; then basename "$(readlink "$PREFIX/$1")"; fi
}

written() { # FILE TEXT: at once, or not at all
    printf '%s\n' "$2" >"$PREFIX/.$1.new" && mv -f "$PREFIX/.$1.new" "$PREFIX/$1"
}

point() { # LINK RELEASE, or no release: change or remove a link at once
    if [ -n "$2" ]; then
        ln -sfn "releases/$2" "$PREFIX/.$1.new" && mv -fT "$PREFIX/.$1.new" "$PREFIX/$1"
    else
        rm -f "$PREFIX/$1"
    fi
}

whole() { [ -n "$1" ] && [ -e "$PREFIX/releases/$1/complete" ]; }

supervised() {
    case $(cat "$PREFIX/supervisor" 2>/dev/null || echo none) in
    systemd) return 0 ;;
    none) return 1 ;;
    *) fail "$PREFIX/supervisor must say systemd or none" ;;
    esac
}

booted() { [ -d /run/systemd/system ]; } # or this is the image of a robot, in which nothing runs

lock() { # SECONDS: or fail, if another of these commands is at work for so long
    (umask 077 && : >>"$PREFIX/.lock") 2>/dev/null || fail "can't write $PREFIX: be root, or give another --prefix"
    exec 9>>"$PREFIX/.lock"
    flock -w "$1" 9 || fail "another install.sh or vm-deploy is at work"
}

seconds() { cut -d . -f 1 /proc/uptime; } # that the machine runs: no clock that somebody sets

detect() { # ARGUMENT...: vm-detect of the current release, with its configuration
    RUNTIME_DIRECTORY=/run/vm-detect "$PREFIX/current/venv/bin/vm-detect" --config "$PREFIX/current/etc/vm.toml" "$@"
}

setting() { # NAME: an entry of [deploy]
    printed=$(detect --print-config) || return 1
    say "$printed" | sed -n "/^\[deploy\]/,/^\[/ s/^$1 = \"\{0,1\}\([^\"]*\)\"\{0,1\}\$/\1/p"
}

state() { # of the detector that runs, and why; nothing if none does
    detect --status 2>/dev/null | sed -n 's/^{"type": "state", "state": "\([a-z_]*\)".*"reason": "\([^"]*\)".*/\1 \2/p'
}

placed() { # FILE FOLDER: write a file of the current release where the system looks for it
    mkdir -p "$2" || return 1
    sed "s|@PREFIX@|$PREFIX|g" "$PREFIX/current/bundle/$1" >"$2/.$1.new" && mv -f "$2/.$1.new" "$2/$1"
}

start() { # the current release, and wait until it is READY
    placed "$UNIT" "$UNITS" && placed "$RESCUE" "$UNITS" && placed "$RULE" "$RULES" || return 1
    mkdir -p "${COMMAND%/*}" && ln -sfn "$PREFIX/vm-deploy" "$COMMAND" || return 1
    if booted; then systemctl daemon-reload || return 1; fi
    systemctl enable --quiet "$UNIT" || return 1
    booted || return 0
    udevadm control --reload 2>/dev/null || :
    systemctl reset-failed "$UNIT" 2>/dev/null || :
    systemctl restart "$UNIT"
}

forgotten() { # by the system: unit, rule and command
    systemctl disable --now "$UNIT" 2>/dev/null || :
    rm -f "$UNITS/$UNIT" "$UNITS/$RESCUE" "$RULES/$RULE" "$COMMAND"
    if booted; then systemctl daemon-reload || :; fi
    udevadm control --reload 2>/dev/null || :
}

well() { # STATE: whether the detector is ok in time, or at least no worse than the state that it was in before
    limit=$(setting healthy_s) || limit=
    limit=${limit:-30}
    end=$(($(seconds) + ${limit%%.*}))
    good=0 found=
    while [ "$(seconds)" -lt "$end" ] && ! systemctl is-failed --quiet "$UNIT"; do
        found=$(state)
        case $found in
        ok*) good=$((good + 1)) ;;
        *) good=0 ;;
        esac
        [ "$good" -lt "$PATIENCE" ] || return 0
        sleep 1
    done
    if [ -n "$found" ] && [ "${found%% *}" = "$1" ]; then
        say "it is $found, as it was before"
        return 0
    fi
    say "it is ${found:-not running}"
    return 1
}

activate() { # RELEASE: put it in the place of the current one, and take that back if it is not well
    old=$(linked current) older=$(linked previous)
    before=$(if [ -n "$old" ]; then state; else say camera_lost; fi)
    written trial "$old
$older" || return 1
    trap 'set +e; say interrupted; back; exit 1' INT TERM HUP
    sync
    say "switching from ${old:-nothing} to $1"
    if ! { point current "$1" && point previous "$old"; }; then
        back
        return 1
    fi
    if supervised; then
        say "starting $UNIT"
        if ! { start && say "watching it" && { ! booted || well "${before%% *}"; }; }; then
            say "$1 is not well:"
            journalctl --unit "$UNIT" --lines 10 --no-pager --output cat 2>/dev/null || :
            back
            return 1
        fi
    fi
    rm -f "$PREFIX/trial"
    trap - INT TERM HUP
    sync
}

back() { # to the release before the one on trial; can be done again if it was cut off
    old=$(sed -n 1p "$PREFIX/trial") older=$(sed -n 2p "$PREFIX/trial")
    if whole "$old"; then
        say "going back to $old"
        point current "$old" && point previous "$older" || return 1
        sync
        if supervised; then start || say "$old does not start either: systemctl status $UNIT"; fi
    else
        say "there is no release to go back to"
        if supervised; then forgotten; fi
        point current ""
    fi
    rm -f "$PREFIX/trial"
    sync
}

old_model() { # bring it back
    say "going back to the old model"
    mv -f "$PREFIX/current/etc/.old.onnx" "$PREFIX/current/etc/model.onnx"
    sync
}

settled() { # what was cut off and left on trial: it stays if it is well by now
    [ -e "$PREFIX/trial" ] || [ -e "$PREFIX/current/etc/.old.onnx" ] || return 0
    say "an earlier install.sh or vm-deploy was cut off"
    case $(if supervised && booted; then state; else say ok; fi) in
    ok*) rm -f "$PREFIX/trial" "$PREFIX/current/etc/.old.onnx" ;;
    *) failed ;;
    esac
}

failed() { # what is on trial is no good
    if [ -e "$PREFIX/current/etc/.old.onnx" ]; then
        old_model
        if [ ! -e "$PREFIX/trial" ] && supervised; then start || :; fi
    fi
    if [ -e "$PREFIX/trial" ]; then back; fi
}

prune() { # remove releases that are neither current nor previous
    for each in "$PREFIX"/releases/*; do
        case ${each##*/} in
        "$(linked current)" | "$(linked previous)") ;;
        *) rm -rf "$each" ;;
        esac
    done
}
