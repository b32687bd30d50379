# Sourced by scripts that need Debian packages. `need COMMAND-OR-FILE PACKAGE...` notes packages that are missing, and
# `install_missing` installs them: 0 when they are there, 1 where this user cannot install them. A script called with
# --packages prints them instead, so that scripts/install-test-tools installs those of all scripts at once.
missing=()

need() {
    [ -e "$1" ] || command -v "$1" >/dev/null || missing+=("${@:2}")
}

if [ "${1:-}" = --packages ]; then
    install_missing() {
        [ ${#missing[@]} -eq 0 ] || printf '%s\n' "${missing[@]}"
        exit 0
    }
else
    install_missing() {
        [ ${#missing[@]} -gt 0 ] || return 0
        [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 1
        echo "Installing ${missing[*]}"
        (
            flock 9 # of scripts that run side by side
            apt-get -qq update
            DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends "${missing[@]}" >/dev/null
        ) 9>/run/lock/dodo-apt.lock
    }
fi
