# Checks of files from outside, before anything of them runs: whether a bundle is what its listing says, who signed a
# file, and how old it is. install.sh and vm-deploy source this file after releases.sh.
# shellcheck shell=sh

BUNDLE_SIGNATURES=vm-embedded-bundle # namespaces of ssh-keygen
MODEL_SIGNATURES="vm-embedded model" # with the time of signing after it

check_listing() { # FOLDER: fail unless it contains exactly the files of its SHA256SUMS
    # First of all: reading a FIFO would never end, and reading a link would copy a private file.
    odd=$(cd "$1" && find . ! -type f ! -type d | head -n 3)
    [ -z "$odd" ] || fail "the bundle has links or special files, and a bundle has only regular files: $odd"
    [ -f "$1/SHA256SUMS" ] || fail "the bundle is incomplete; copy it again: SHA256SUMS"
    listed=$(sed 's/^[0-9a-f]*  //' "$1/SHA256SUMS")
    found=$(cd "$1" && find . -type f ! -path ./SHA256SUMS ! -path ./SHA256SUMS.sig | sed 's|^\./||')
    more=$(printf '%s\n' "$found" | grep -vxF -e "$listed" || :)
    [ -z "$more" ] || fail "the bundle's folder has files that are not part of it: unpack it into an empty folder: $more"
    missing=$(printf '%s\n' "$listed" | grep -vxF -e "$found" || :)
    [ -z "$missing" ] || fail "the bundle is incomplete; copy it again: $missing"
    wrong=$(cd "$1" && LC_ALL=C sha256sum --check --strict SHA256SUMS 2>&1 | grep -v ': OK$' || :)
    [ -z "$wrong" ] || fail "the bundle is damaged; copy it again: $wrong"
}

signed_by() { # FILE SIGNER NAMESPACE: whether FILE.sig is the signer's signature
    command -v ssh-keygen >/dev/null || fail "ssh-keygen is missing: install openssh-client to check the signature"
    signers=$(mktemp)
    printf 'vm-embedded %s\n' "$2" >"$signers"
    ssh-keygen -Y verify -f "$signers" -I vm-embedded -n "$3" -s "$1.sig" <"$1" >/dev/null 2>&1 && good=1 || good=
    rm -f "$signers"
    [ -n "$good" ]
}

signing_time() { # FILE: print the time that is in the namespace of a model's signature, or nothing
    sed '/^-/d' "$1.sig" | base64 -d 2>/dev/null |
        LC_ALL=C grep -aoE "$MODEL_SIGNATURES [0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}Z" | head -n 1 |
        sed "s/^$MODEL_SIGNATURES //"
}

is_older() { # TIME OTHER: whether a time is before the other; both are like 2026-05-01T12:00:00Z
    [ "$1" != "$2" ] && [ "$(printf '%s\n%s\n' "$1" "$2" | LC_ALL=C sort | head -n 1)" = "$1" ]
}

dated() { say "$(field release "$1") of $(field time "$1")"; } # MANIFEST: print release and time

check_age() { # FOLDER: fail if a bundle is older than the release in use, unless ALLOW_OLDER is set
    used=$PREFIX/current/bundle/manifest.json
    if [ -n "$ALLOW_OLDER" ] || [ ! -e "$used" ]; then return; fi
    if is_older "$(field time "$1/manifest.json")" "$(field time "$used")"; then
        fail "this bundle, $(dated "$1/manifest.json"), is older than the release in use, $(dated "$used"):" \
            "--allow-older installs it anyway"
    fi
}
