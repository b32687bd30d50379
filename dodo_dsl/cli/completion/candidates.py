"""What a word of a command line may become: names of tests, services, rigs and rules of the deployment here."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dodo_dsl.spec.deployment.deployment import Deployment, find_deployment, load_deployment
from dodo_dsl.spec.deployment.rig import EMULATED_RIGS
from dodo_dsl.spec.registry import SUFFIX, locate


def tests(prefix: str = "", **_: Any) -> list[str]:
    """Names of tests; of a name with a bracket the parameters of its instances; paths of specs and folders."""
    if "/" in prefix:
        from argcomplete.completers import FilesCompleter

        return list(FilesCompleter(allowednames=[SUFFIX])(prefix))
    if "[" in prefix:
        return list(_instances(prefix))
    return sorted({location.stem for location in locate([], _deployment().registry)[0]})


def tests_and_rules(prefix: str = "", **_: Any) -> list[str]:
    from dodo_dsl.check import catalogue

    return [*tests(prefix), *catalogue.pages()]


def services(**_: Any) -> list[str]:
    from dodo_dsl.compiler import load

    return sorted(load([]).manifests)


def rigs(**_: Any) -> list[str]:
    return sorted({*_deployment().rigs, *EMULATED_RIGS})


def _deployment() -> Deployment:
    return load_deployment(find_deployment(Path.cwd()))[0]


def _instances(prefix: str) -> Iterator[str]:
    """The prefix up to its last parameter, with each value of each parameter that is not there yet."""
    from dodo_dsl.compiler import load

    name = prefix.partition("[")[0]
    paths = [location.path for location in locate([], _deployment().registry)[0] if location.stem == name]
    head = prefix[: max(prefix.rfind("["), prefix.rfind(",")) + 1]
    given = {pair.partition("=")[0] for pair in head.partition("[")[2].split(",")}
    values: dict[str, dict[str, None]] = {}
    for spec in load(paths).specs if paths else ():
        for parameter, value in spec.choice.values:
            values.setdefault(parameter, {})[value.text] = None
    left = [parameter for parameter in values if parameter not in given]
    for parameter in left:
        for text in values[parameter]:
            yield f"{head}{parameter}={text}]"
            if len(left) > 1:
                yield f"{head}{parameter}={text},"
