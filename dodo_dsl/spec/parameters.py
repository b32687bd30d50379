"""Instances of a test by some of their parameters: ``name[light=dark]`` means all with this value in their matrix."""

import fnmatch
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dodo_dsl.diagnostics import did_you_mean
from dodo_dsl.spec.model import Spec

PATTERN = re.compile(r"(?P<test>[^\[\]]+)\[(?P<pairs>[^=\[\]]+=.*)\]")
_COMMA = re.compile(r",(?=[^,=]+=)")


class NoSuchInstance(Exception):
    """No instance has these parameters; one sentence."""


@dataclass(frozen=True)
class InstancePattern:
    """The name or pattern of tests, and values of parameters, one of which an instance has to have."""

    test: str
    values: Mapping[str, Sequence[str]]


def parse(word: str) -> InstancePattern | None:
    """None if a word is anything else."""
    match = PATTERN.fullmatch(word)
    if match is None:
        return None
    values: dict[str, list[str]] = {}
    for pair in _COMMA.split(match["pairs"]):
        name, _, value = pair.partition("=")
        values.setdefault(name.strip(), []).append(value.strip())
    return InstancePattern(match["test"], values)


def instances(asked: InstancePattern, specs: Sequence[Spec]) -> list[Spec]:
    """Those of ``specs``, the instances of one or more tests, with the values; raises NoSuchInstance."""
    for name, values in asked.values.items():
        has_name = [spec for spec in specs if name in dict(spec.choice.values)]
        if not has_name:
            raise NoSuchInstance(_without(asked.test, name, specs))
        for value in values:
            if not any(_fits(spec, name, value) for spec in has_name):
                known = dict.fromkeys(dict(spec.choice.values)[name].text for spec in has_name)
                raise NoSuchInstance(f"no instance of '{asked.test}' has {name}={value}" + _hint(value, list(known)))
    found = [
        spec
        for spec in specs
        if all(any(_fits(spec, name, value) for value in values) for name, values in asked.values.items())
    ]
    if not found:
        said = ", ".join(f"{name}={' or '.join(values)}" for name, values in asked.values.items())
        raise NoSuchInstance(f"no test '{asked.test}' has all of {said}")
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
