"""Which tests a command line selects: names, patterns, files or folders, and levels."""

import argparse
import fnmatch
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
    """Whether a word is the name of a test, with parameters or without."""
    asked = _parse(word)
    return _is_name(word, spec) or (asked is not None and _is_name(asked.test, spec))


def _named(word: str, specs: Sequence[Spec], deployment: Deployment) -> list[Spec]:
    if found := [s for s in specs if _is_name(word, s)]:
        return found
    asked = _parse(word)
    if asked and (tests := [s for s in specs if _matches(s, asked.test)]):
        try:
            return _instances_of(asked, tests)
        except NoSuchTest:
            if found := [s for s in specs if _matches_title(s, word)]:
                return found
            raise
    found = [s for s in specs if _matches(s, word) or _matches_title(s, word)]
    if not found:
        hint = _shipped_hint(word, deployment) or did_you_mean(
            word, list(dict.fromkeys(s.location.stem for s in specs))
        )
        raise NoSuchTest(f"unknown test '{word}'" + (f"; {hint}" if hint else ""))
    return found


def _shipped_hint(word: str, deployment: Deployment) -> str:
    """A hint where the word means a test that ships with DoDo and that the deployment leaves out."""
    if package_data.registry() in deployment.registry:
        return ""
    shipped = [location.stem for location in locate([], [package_data.registry()])[0]]
    names = [name for name in shipped if fnmatch.fnmatchcase(name, word) or re.split(r"\[|--", word)[0] == name]
    if not names:
        return ""
    if names == [word]:
        said = "it ships"
    else:
        said = f"'{names[0]}' ships" if len(names) == 1 else f"'{names[0]}' and {len(names) - 1} more ship"
    return f"{said} with DoDo: add \"{SHIPPED}\" to 'registry' in {FILE_NAME}"


def _matches(spec: Spec, pattern: str) -> bool:
    """Whether a pattern fits the name of a test."""
    return any(fnmatch.fnmatchcase(name, pattern) for name in (spec.location.stem, spec.slug))


def _matches_title(spec: Spec, pattern: str) -> bool:
    """Whether a pattern fits that of an instance, such as ``name[light=dark]``, whose brackets mean themselves."""
    return fnmatch.fnmatchcase(spec.title, pattern.replace("[", "[[]"))


@dataclass(frozen=True)
class _InstancePattern:
    """The name or pattern of tests, and values of parameters, one of which an instance has to have."""

    test: str
    values: Mapping[str, Sequence[str]]


def _parse(word: str) -> _InstancePattern | None:
    """None if a word is anything else."""
    match = _INSTANCES.fullmatch(word)
    if match is None:
        return None
    values: dict[str, list[str]] = {}
    for pair in _COMMA.split(match["pairs"]):
        name, _, value = pair.partition("=")
        values.setdefault(name.strip(), []).append(value.strip())
    return _InstancePattern(match["test"], values)


def _instances_of(asked: _InstancePattern, specs: Sequence[Spec]) -> list[Spec]:
    """Those of ``specs``, the instances of one or more tests, with the values; raises NoSuchTest."""
    for name, values in asked.values.items():
        has_name = [spec for spec in specs if name in dict(spec.choice.values)]
        if not has_name:
            raise NoSuchTest(_without(asked.test, name, specs))
        for value in values:
            if not any(_fits(spec, name, value) for spec in has_name):
                known = dict.fromkeys(dict(spec.choice.values)[name].text for spec in has_name)
                raise NoSuchTest(f"no instance of '{asked.test}' has {name}={value}" + _hint(value, list(known)))
    found = [
        spec
        for spec in specs
        if all(any(_fits(spec, name, value) for value in values) for name, values in asked.values.items())
    ]
    if not found:
        said = ", ".join(f"{name}={' or '.join(values)}" for name, values in asked.values.items())
        raise NoSuchTest(f"no test '{asked.test}' has all of {said}")
    return found


def _fits(spec: Spec, name: str, value: str) -> bool:
    text = next((chosen.text for known, chosen in spec.choice.values if known == name), None)
    return text is not None and (text == value or fnmatch.fnmatchcase(text, value))


def _without(test: str, name: str, specs: Sequence[Spec]) -> str:
    if any(one.name == name for spec in specs for one in spec.ranges):
        return (
            f"'{name}' of '{test}' is a range of 'vary' and no parameter of its matrix: a run takes the nominal value, "
            "and dodo search looks at others"
        )
    known = list(dict.fromkeys(known for spec in specs for known, _ in spec.choice.values))
    if not known:
        return f"'{test}' has no parameters, because it has no matrix"
    return f"'{test}' has no parameter '{name}'" + _hint(name, known)


def _hint(word: str, known: Sequence[str]) -> str:
    hint = did_you_mean(word, known)
    return f"; {hint}" if hint else ""
