"""Variables that look like secrets: the pipeline's own, tokens, passwords and keys."""

import functools
import re
from collections.abc import Collection, Iterator, Mapping
from fnmatch import fnmatchcase

PIPELINE = "CI_*"
PATTERNS = (
    PIPELINE, "*TOKEN*", "*PASSWORD*", "*SECRET*", "*KEY*",
    "*PASSWD*", "*PASSPHRASE*", "*CREDENTIAL*", "*_PASS", "PGPASS*", "*_PAT", "DOCKER_AUTH_CONFIG",
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
_HARMLESS = ("PATH", "HOME", "USER", "LANG", "LC_*", "TZ", "TERM", "DODO_IMAGE_*")
"""What every program gets, and the images that a pipeline has built."""
_OF_CLIENT = (
    "PATH", "HOME", "USER", "LANG", "LC_*", "TMPDIR", "XDG_RUNTIME_DIR", "XDG_CONFIG_HOME", "SSL_CERT_*",
    "DOCKER_HOST", "DOCKER_CONTEXT", "DOCKER_CONFIG", "DOCKER_CERT_PATH", "DOCKER_TLS*", "DOCKER_API_VERSION",
    "DOCKER_BUILDKIT", "BUILDX_*", "BUILDKIT_*",
)  # fmt: skip
"""What the engine's client reads for itself, and holds no secret."""
NEVER = ("DODO_SEARCH_STORAGE",)
"""What DoDo itself reads, and passes to nobody."""
_SECRET_VALUE = re.compile(
    r"(?P<url>://[^/@:\s]*:(?![$@])[^/@\s]+@)"
    r"|(?P<key>-----BEGIN [A-Z ]*PRIVATE KEY)"
    r"|(?P<token>\b(?:gl(?:pat|ptt|dt|rt|cbt|soat|oas|ft|imt|agent|ffct)-[\w-]{20,}|gh[opsur]_\w{30,}|github_pat_\w{30,}|A(?:KIA|SIA)[0-9A-Z]{16}\b"
    r"|AIza[\w-]{35}|xox[abeoprs]-[\w-]{10,}|npm_\w{36}|hf_\w{30,}|pypi-[\w-]{50,}|sk-(?:proj-|ant-)?\w{20,}"
    r"|eyJ[\w-]{8,}\.eyJ[\w-]{8,}\.[\w-]{8,}))"
)
_KINDS = {"url": "an address with a password", "key": "a private key", "token": "a token"}


def is_secret(name: str) -> bool:
    return _matches(name, PATTERNS) and not _matches(name, _NO_SECRETS)


def is_of_pipeline(name: str) -> bool:
    return _matches(name, (PIPELINE,))


def holds_secret(name: str, value: str) -> bool:
    return is_secret(name) or bool(secret_kind(value))


def secret_kind(value: str) -> str:
    """What a value looks like: an address with a password, a private key, or a token; empty for others."""
    found = _SECRET_VALUE.search(value)
    return _KINDS[found.lastgroup or ""] if found else ""


def passed_secrets(variables: Mapping[str, str], passed: Collection[str]) -> Iterator[str]:
    """Sentences on passed variables whose values look like secrets, which nothing hides once they are passed."""
    for name in sorted(set(passed)):
        if kind := secret_kind(variables.get(name, "")):
            what = f"the application gets '{name}', which looks like {kind}, as dodo.yml passes it"
            yield f"{what}; what it prints of it is in its log"


@functools.lru_cache(maxsize=1024)  # a run asks for each of its own variables with each process
def _matches(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name.upper(), pattern) for pattern in patterns)


def is_steering(name: str) -> bool:
    """Whether a variable of an application could change what DoDo and the engine's client do on the host."""
    return _matches(name, STEERING)


def visible(variables: Mapping[str, str], passed: Collection[str] = ()) -> dict[str, str]:
    """The variables that DoDo's own services get: those that are not secrets, and those that ``dodo.yml`` passes."""
    return {
        name: value
        for name, value in variables.items()
        if name not in NEVER and (name in passed or not holds_secret(name, value))
    }


def allowed(variables: Mapping[str, str], passed: Collection[str] = ()) -> dict[str, str]:
    """The variables that an application may use: what every program gets, and those that ``dodo.yml`` passes."""
    return {
        name: value
        for name, value in variables.items()
        if name not in NEVER and (name in passed or _matches(name, _HARMLESS))
    }


def of_client(variables: Mapping[str, str]) -> dict[str, str]:
    """The variables that the engine's client needs; an agent of keys only where it reaches the engine by that."""
    more = ("SSH_AUTH_SOCK",) if variables.get("DOCKER_HOST", "").startswith("ssh://") else ()
    return {name: value for name, value in variables.items() if _matches(name, (*_OF_CLIENT, *more))}
