"""Which variables look like secrets."""

import pytest

from dodo_dsl.application.access import secret_variables


@pytest.mark.parametrize(
    "name",
    [
        *("CI_JOB_TOKEN", "CI_COMMIT_TAG", "GITHUB_TOKEN", "DB_PASSWORD", "MY_SECRET_2", "AWS_ACCESS_KEY_ID"),
        *("api_key", "Token", "PGPASSWORD", "DB_PASS", "GOOGLE_APPLICATION_CREDENTIALS", "DOCKER_AUTH_CONFIG"),
        *("DODO_IMAGES_TOKEN", "DODO_DEPLOY_KEY"),
    ],
)
def test_secrets(name: str) -> None:
    assert secret_variables.is_secret(name)


@pytest.mark.parametrize("name", ["CI", "PATH", "PASSENGERS", "DODO_IMAGE_KEYBOARD", "OD4SESSION_CID", "HOME"])
def test_others(name: str) -> None:
    assert not secret_variables.is_secret(name)


def test_the_pipeline_s_own() -> None:
    assert secret_variables.is_of_pipeline("CI_JOB_TOKEN")
    assert not secret_variables.is_of_pipeline("MY_TOKEN")


def test_values_that_hold_secrets() -> None:
    assert secret_variables.holds_secret("BACKEND", "postgres://team:pw@db/x")
    assert secret_variables.holds_secret("PEM", "-----BEGIN RSA PRIVATE KEY-----")
    assert secret_variables.holds_secret("CACHE", "redis://:pw@cache/0")
    assert secret_variables.holds_secret("A", "ghp_" + "a" * 36)
    assert secret_variables.holds_secret("A", "Bearer eyJhbGciOiJI.eyJzdWIiOiIx.SflKxwRJSM")
    assert not secret_variables.holds_secret("SITE", "https://example.org:8080/a@b")
    assert not secret_variables.holds_secret("A", "the-task-force-of-sk-learn-and-others")


@pytest.mark.parametrize(
    "name", ["LD_PRELOAD", "DOCKER_HOST", "PATH", "GIT_SSH_COMMAND", "COMPOSE_FILE", "DODO_SUBNET"]
)
def test_variables_that_steer_programs(name: str) -> None:
    assert secret_variables.is_steering(name)


@pytest.mark.parametrize("name", ["DOCKER_REGISTRY", "DOCKER_TAG", "CID", "MAPS_PATH", "HTTP_PROXY", "SPEED"])
def test_variables_that_steer_nothing(name: str) -> None:
    assert not secret_variables.is_steering(name)


def test_what_services_see() -> None:
    variables = {"A": "1", "A_KEY": "2", "CI_JOB_TOKEN": "3", "DB": "x://a:b@c", "DODO_SEARCH_STORAGE": "x"}
    assert secret_variables.visible(variables) == {"A": "1"}
    passed = ("A_KEY", "NOT_SET", "DB", "DODO_SEARCH_STORAGE")
    assert secret_variables.visible(variables, passed) == {"A": "1", "A_KEY": "2", "DB": "x://a:b@c"}


def test_what_applications_see() -> None:
    variables = {"A": "1", "B": "2", "HOME": "/root", "LC_TIME": "C", "DODO_IMAGE_A": "x", "DODO_SEARCH_STORAGE": "x"}
    common = {"HOME": "/root", "LC_TIME": "C", "DODO_IMAGE_A": "x"}
    assert secret_variables.allowed(variables) == common
    assert secret_variables.allowed(variables, ("B", "DODO_SEARCH_STORAGE")) == {"B": "2", **common}


def test_what_the_engine_s_client_sees() -> None:
    variables = {"DOCKER_HOST": "unix:///x", "SSH_AUTH_SOCK": "/s", "CI_JOB_TOKEN": "3", "HTTP_PROXY": "x://a:b@c"}
    assert secret_variables.of_client(variables) == {"DOCKER_HOST": "unix:///x"}
    remote = {**variables, "DOCKER_HOST": "ssh://host"}
    assert secret_variables.of_client(remote) == {"DOCKER_HOST": "ssh://host", "SSH_AUTH_SOCK": "/s"}


def test_passed_variables_whose_values_are_secrets() -> None:
    """They are named, and never their values; what has a secret's name is no news."""
    variables = {"A": "glpat-" + "0123456789" * 2, "B": "1", "C_TOKEN": "s3cr3t", "D": "x://a:s3cr3t@b"}
    (text,) = secret_variables.passed_secrets(variables, ["B", "C_TOKEN", "A", "A", "NONE"])
    assert text.startswith("the application gets 'A', which looks like a token, as dodo.yml passes it")
    assert "glpat" not in text
