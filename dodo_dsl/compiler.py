"""The compiler from end to end: from paths to checked specs, and on to Plans."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.application.read import read_application
from dodo_dsl.check import check
from dodo_dsl.check.context import Declared
from dodo_dsl.diagnostics import Diagnostic, Span, has_errors, ordered
from dodo_dsl.emit.output_folder import pipeline_folder
from dodo_dsl.emit.pipeline import pipeline_problems
from dodo_dsl.emit.render import render_pipeline
from dodo_dsl.plan.build import Compiled, build
from dodo_dsl.spec.deployment import Deployment, find_deployment, load_deployment
from dodo_dsl.spec.manifest import Manifest, load_manifests
from dodo_dsl.spec.model import Spec, load_spec
from dodo_dsl.spec.registry import locate


@dataclass(frozen=True)
class Checked:
    """Specs with everything that was found wrong with them, sorted by place.

    ``left_out`` names shipped tests that were not asked for by name and that the application cannot feed.
    """

    deployment: Deployment
    manifests: Mapping[str, Manifest]
    specs: tuple[Spec, ...]
    diagnostics: tuple[Diagnostic, ...]
    application: ApplicationSource | None = None
    empty: tuple[Path, ...] = field(default=())
    left_out: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        return not has_errors(self.diagnostics)


UNFED = ("no-producer", "no-sample")
"""The rules by which a service of a test hears what nobody sends."""


class NoApplication(Exception):
    """Plans need an application, and neither the command line nor a deployment names one."""


def load(paths: Sequence[Path], application: Sequence[Path] = (), start: Path | None = None) -> Checked:
    """Reads and checks the specs at or below ``paths``, or those of the deployment's registries without any.

    ``application`` are compose files that count instead of the deployment's.
    """
    deployment, found = load_deployment(find_deployment(start or Path.cwd()))
    manifests, manifest_problems = load_manifests(deployment.services)
    locations, empty = locate(paths, deployment.registry, _registries_above(paths))
    loaded = [load_spec(location) for location in locations]
    specs = tuple(spec for instances, _ in loaded for spec in instances)
    found = [*found, *manifest_problems, *(d for _, problems in loaded for d in problems)]
    files = application or deployment.application
    source = None
    if files:
        source, problems = read_application(files)
        found.extend(problems)
    found.extend(check(specs, manifests, deployment, source.declared if source else None))
    return Checked(deployment, manifests, specs, tuple(ordered(found)), source, tuple(empty))


def without_unfed(checked: Checked, named: Collection[Path] = ()) -> Checked:
    """The same without shipped tests that hear what the application does not send, but for the files ``named``."""
    if not any(d.rule in UNFED for d in checked.diagnostics):
        return checked
    groups: dict[Path, list[Spec]] = {}
    for spec in checked.specs:
        groups.setdefault(spec.path, []).append(spec)
    found = {path: set(_checked_again(checked, specs)) for path, specs in groups.items()}
    left_out = {
        path
        for path, specs in groups.items()
        if path not in named
        and package_data.is_shipped(specs[0].location.root, checked.deployment.root)
        and any(d.rule in UNFED for d in found[path])
    }
    gone = {d for path in left_out for d in found[path]} - {d for p in groups.keys() - left_out for d in found[p]}
    return replace(
        checked,
        specs=tuple(spec for spec in checked.specs if spec.path not in left_out),
        diagnostics=tuple(d for d in checked.diagnostics if d not in gone),
        left_out=tuple(sorted(groups[path][0].location.stem for path in left_out)),
    )


def _checked_again(checked: Checked, specs: Iterable[Spec]) -> list[Diagnostic]:
    return check(specs, checked.manifests, checked.deployment, _declared(checked))


def _declared(checked: Checked) -> Mapping[str, Declared | None] | None:
    return checked.application.declared if checked.application else None


def with_clock(checked: Checked, clock: str) -> Checked:
    """The same by another clock, with what is wrong then; hardware keeps the one that it has."""
    return _with(checked, (spec if spec.level == "hil" else replace(spec, clock=clock) for spec in checked.specs))


def with_isolation(checked: Checked, isolation: str) -> Checked:
    """The same isolated otherwise, with what is wrong then, whatever the specs write about it."""
    return _with(checked, (_isolated(spec, isolation) for spec in checked.specs))


def _isolated(spec: Spec, isolation: str) -> Spec:
    return replace(spec, isolation=isolation, spans={k: v for k, v in spec.spans.items() if k != "isolation"})


def _with(checked: Checked, changed: Iterable[Spec]) -> Checked:
    """The same with other specs, checked once more."""
    specs = tuple(changed)
    known = {_key(d) for d in checked.diagnostics}
    more = [d for d in _checked_again(checked, specs) if _key(d) not in known]
    return replace(checked, specs=specs, diagnostics=tuple(ordered([*checked.diagnostics, *more])))


def _key(diagnostic: Diagnostic) -> tuple[Span, str]:
    """What makes a diagnostic the same one, whichever instances have it."""
    return diagnostic.span, diagnostic.rule


def _registries_above(paths: Sequence[Path]) -> list[Path]:
    """The registries of the deployments that hold the paths, wherever DoDo was started."""
    files = {find_deployment(path if path.is_dir() else path.parent) for path in paths}
    return [folder for file in files if file for folder in load_deployment(file)[0].registry]


def plan(checked: Checked, out: Path) -> tuple[Compiled, tuple[Diagnostic, ...]]:
    """The Plans of specs without errors, for the output folder ``out``; raises NoApplication without one."""
    if checked.application is None:
        raise NoApplication
    compiled, problems = build(checked.specs, checked.manifests, checked.deployment, checked.application, out.resolve())
    child = render_pipeline(compiled.suite, pipeline_folder(out))
    files = {spec.slug: str(spec.path) for spec in checked.specs}
    shown = {plan.spec: files[plan.slug] for plan in compiled.suite.plans}
    for problem in pipeline_problems(compiled.suite, child.text):
        span = replace(problem.span, file=shown.get(problem.span.file, problem.span.file))
        problems.append(replace(problem, span=span))
    return compiled, tuple(ordered(problems))
