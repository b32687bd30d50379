"""Which tests a command line selects: names, patterns, files or folders, and levels."""

import argparse
import fnmatch
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.compiler import Checked, load, narrowed, without_unsatisfied
from dodo_dsl.diagnostics import did_you_mean, format_text, has_errors
from dodo_dsl.spec.deployment import FILE_NAME, SHIPPED, Deployment, find_deployment, load_deployment
from dodo_dsl.spec.load import Settings
from dodo_dsl.spec.model import LEVELS, Spec
from dodo_dsl.spec.registry import SUFFIX, locate
from dodo_dsl.terminal import printable

_INSTANCES = re.compile(r"(?P<test>[^\[\]]+)\[(?P<pairs>[^=\[\]]+=.*)\]")
_COMMA = re.compile(r",(?=[^,=]+=)")
_MOST_SHOWN = 6


class NoSuchTest(UsageError):
    """A name, pattern or path that matches no test."""


def checked_deployment() -> Deployment:
    """The nearest ``dodo.yml``; raises UsageError with all its problems."""
    deployment, problems = load_deployment(find_deployment(Path.cwd()))
    if has_errors(problems):
        raise UsageError(f"{FILE_NAME} has problems:\n{format_text(problems)}")
    return deployment


def add_application(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--application",
        metavar="FILE",
        type=Path,
        action="append",
        default=[],
        help="compose file of the application; repeatable, files are merged (default: that of dodo.yml)",
    )


def existing_files(paths: Sequence[Path]) -> Sequence[Path]:
    """The paths, or NoSuchTest with a sentence when there is no such file."""
    for path in paths:
        if not path.is_file():
            raise NoSuchTest(f"there is no file '{path}', expected the application's compose file")
    return paths


def _is_path(word: str) -> bool:
    if _INSTANCES.fullmatch(word) and not Path(word).exists():
        return False  # the slash may be in a value
    return "/" in word or word.endswith(SUFFIX) or Path(word).is_dir()


def select(
    words: Sequence[str],
    levels: Sequence[str],
    application: Sequence[Path],
    settings: Settings = Settings(),  # noqa: B008  (it is frozen)
) -> Checked:
    """The checked tests that the words mean (all without any), kept to the levels; raises NoSuchTest.

    Shipped tests that the application cannot feed are skipped, unless a word is the name or path of one.
    """
    paths = [Path(word) for word in words if _is_path(word)]
    names = [word for word in words if not _is_path(word)]
    checked = load(paths, existing_files(application), settings=settings, names=() if paths else names)
    if checked.empty:
        raise NoSuchTest(f"there is no test at '{checked.empty[0]}'; specs end in .dodo.yml")
    given = {spec.path for spec in checked.specs} if paths else set()
    if names:
        if paths:
            checked = load([*paths, *checked.deployment.registry], application, settings=settings)
        others = [spec for spec in checked.specs if spec.path not in given]
        try:
            chosen = {spec.slug for word in names for spec in _named(word, others, checked.deployment)}
        except NoSuchTest:
            checked_deployment()  # its problems come first: without them there may be such a test
            raise
        checked = narrowed(checked, [s for s in checked.specs if s.path in given or s.slug in chosen])
        given |= {spec.path for spec in others if any(_is_meant(word, spec) for word in names)}
    elif paths:
        checked = narrowed(checked, checked.specs)
    if levels:
        if not any(spec.level in levels for spec in checked.specs):
            raise NoSuchTest(f"no test has level {' or '.join(levels)}")
        kept = tuple(spec for spec in checked.specs if spec.level in levels or spec.level not in LEVELS)
        checked = narrowed(checked, kept)
    return without_unsatisfied(checked, given)


def left_out(checked: Checked) -> str:
    """One line about the shipped tests that were skipped; empty when there are none."""
    if not checked.left_out:
        return ""
    names = printable(", ".join(checked.left_out))
    return (
        f"skipped shipped tests that do not fit what the application sends and takes: {names} (see dodo explain NAME)\n"
    )


def _is_name(word: str, spec: Spec) -> bool:
    return word in (spec.location.stem, spec.title, spec.slug)


def _is_meant(word: str, spec: Spec) -> bool:
    return _is_name(word, spec) or _is_name(_parsed(word)[0], spec)


def _named(word: str, specs: Sequence[Spec], deployment: Deployment) -> list[Spec]:
    """The tests, or instances of them, that a word names; raises NoSuchTest."""
    test, values = _parsed(word)
    tests = [s for s in specs if any(fnmatch.fnmatchcase(name, test) for name in (s.location.stem, s.slug))]
    title = word.replace("[", "[[]")  # brackets mean themselves
    found = [s for s in specs if _is_name(word, s)]
    found = found or [s for s in tests if _fits(s, values)]
    found = found or [s for s in specs if fnmatch.fnmatchcase(s.title, title)]
    if found:
        return found
    if tests:
        shown = [s.title for s in tests[:_MOST_SHOWN]]
        more = f" and {len(tests) - len(shown)} more" if len(tests) > len(shown) else ""
        raise NoSuchTest(f"no instance of '{test}' has these values; known: {', '.join(shown)}{more}")
    names = list(dict.fromkeys(s.location.stem for s in specs))
    hint = _shipped_hint(word, deployment) or did_you_mean(word, names)
    raise NoSuchTest(f"unknown test '{word}'" + (f"; {hint}" if hint else ""))


def _shipped_hint(word: str, deployment: Deployment) -> str:
    """A hint where the word means a test that ships with DoDo and that the deployment leaves out."""
    if package_data.registry() in deployment.registry:
        return ""
    shipped = [location.stem for location in locate([], [package_data.registry()])[0]]
    names = [name for name in shipped if fnmatch.fnmatchcase(name, word) or re.split(r"\[|--", word)[0] == name]
    return f"'{names[0]}' ships with DoDo: add \"{SHIPPED}\" to 'registry' in {FILE_NAME}" if names else ""


def _parsed(word: str) -> tuple[str, Mapping[str, Sequence[str]]]:
    """The name or pattern of tests, and values of parameters, one of which an instance has to have."""
    match = _INSTANCES.fullmatch(word)
    values: dict[str, list[str]] = {}
    for pair in _COMMA.split(match["pairs"]) if match else ():
        name, _, value = pair.partition("=")
        values.setdefault(name.strip(), []).append(value.strip())
    return match["test"] if match else word, values


def _fits(spec: Spec, values: Mapping[str, Sequence[str]]) -> bool:
    chosen = {name: value.text for name, value in spec.choice.values}
    return all(
        name in chosen and any(chosen[name] == value or fnmatch.fnmatchcase(chosen[name], value) for value in wanted)
        for name, wanted in values.items()
    )
