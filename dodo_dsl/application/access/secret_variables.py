"""Variables that look like secrets: the pipeline's own, tokens, passwords and keys."""

import re
from collections.abc import Collection, Mapping
from fnmatch import fnmatchcase

PIPELINE = "CI_*"
PATTERNS = (
    PIPELINE, "*TOKEN*", "*PASSWORD*", "*SECRET*", "*KEY*",
    "*PASSWD*", "*PASSPHRASE*", "*CREDENTIAL*", "*_PASS", "DOCKER_AUTH_CONFIG",
)  # fmt: skip
STEERING = (
    "PATH", "HOME", "SHELL", "ENV", "IFS", "TMPDIR", "LD_*", "GCONV_PATH", "LOCPATH", "GLIBC_TUNABLES", "MALLOC_*",
    "GODEBUG", "GOCOVERDIR", "GOTRACEBACK", "RES_OPTIONS", "HOSTALIASES", "BASH_*", "PYTHON*", "XDG_*", "OTEL_*",
    "GIT_*", "SSH_*", "BUILDX_*", "BUILDKIT_*", "COMPOSE_*", "DODO_*", "DOCKER_HOST", "DOCKER_CONTEXT",
    "DOCKER_CONFIG", "DOCKER_CERT_PATH", "DOCKER_TLS*", "DOCKER_API_VERSION", "DOCKER_CLI*", "DOCKER_CONTENT_TRUST*",
    "DOCKER_CUSTOM_HEADERS", "DOCKER_AUTH_CONFIG", "DOCKER_BUILDKIT",
)  # fmt: skip
"""What programs of the host, the engine's client and compose read for themselves."""
_NO_SECRETS = ("DODO_IMAGE_*",)
_SECRET_VALUE = re.compile(r"://[^/@:\s]+:[^/@\s]+@|-----BEGIN [A-Z ]*PRIVATE KEY")


def is_secret(name: str) -> bool:
    """Whether a variable's name is one of a secret, in whatever case it is written."""
    return _matches(name, PATTERNS) and not _matches(name, _NO_SECRETS)


def is_of_pipeline(name: str) -> bool:
    """Whether GitLab sets the variable for its own jobs."""
    return _matches(name, (PIPELINE,))


def holds_secret(name: str, value: str) -> bool:
    """The same with a look at the value: a URL with a password, or a private key."""
    return is_secret(name) or bool(_SECRET_VALUE.search(value))


def _matches(name: str, patterns: Collection[str]) -> bool:
    return any(fnmatchcase(name.upper(), pattern) for pattern in patterns)


def is_steering(name: str) -> bool:
    """Whether a variable of an application could change what DoDo and the engine's client do on the host."""
    return _matches(name, STEERING)


def visible(variables: Mapping[str, str], passed: Collection[str] = ()) -> dict[str, str]:
    """The variables that are no secrets, and those that ``dodo.yml`` passes."""
    return {name: value for name, value in variables.items() if name in passed or not is_secret(name)}
