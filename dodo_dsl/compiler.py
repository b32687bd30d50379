"""The compiler from end to end: from paths to checked tests, and on to Plans."""

import functools
import itertools
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dodo_dsl import package_data
from dodo_dsl.application import hidden_paths
from dodo_dsl.application.model import Access, ApplicationSource
from dodo_dsl.application.read import read_application
from dodo_dsl.check import check, file_rules
from dodo_dsl.check.resolve import ResolvedTest, known_ids, resolve
from dodo_dsl.check.service_rules import unknown_messages
from dodo_dsl.check.spec_rules import check_suite
from dodo_dsl.diagnostics import Diagnostic, has_errors, ordered
from dodo_dsl.source import Scalar, read
from dodo_dsl.spec.deployment import Deployment, find_deployment, load_deployment
from dodo_dsl.spec.load import Settings, applied, load_spec, on_each, varied
from dodo_dsl.spec.manifest import Manifest, load_manifests
from dodo_dsl.spec.matrix import Choice
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.registry import locate
from dodo_dsl.spec.rig import PORT
from dodo_dsl.spec.vary import Values

if TYPE_CHECKING:  # what only plans need is loaded where tests are planned: it takes as long as the rest
    from dodo_dsl.emit.render import File
    from dodo_dsl.plan.build import Compiled
    from dodo_dsl.plan.pipeline import JobOptions, Pipeline

UNSATISFIED = ("no-producer", "no-sample", "true-pose")
"""The rules by which a service consumes what nobody produces."""
RUN, SAMPLE = "run", "sample"
"""What announces the number of a test at values of its ranges; the report groups samples by the second."""
_MOST_READ = 256  # files that are kept for the tests that extend them
_OF_ALL = "name-taken"
"""A service that has the name of another is not known, so that no test uses it."""


@dataclass(frozen=True)
class Problems:
    """Everything that was found: with the deployment and its application, its services, each spec as it was read.

    ``by_rules`` are those of each spec's instances, which the ``tests`` of a problem name, all of them.
    """

    common: tuple[Diagnostic, ...] = ()
    of_services: tuple[Diagnostic, ...] = ()
    as_read: Mapping[Path, Sequence[Diagnostic]] = field(default_factory=dict)
    by_rules: Mapping[Path, Sequence[Diagnostic]] = field(default_factory=dict)

    def without_unused(self, tests: Sequence[ResolvedTest]) -> "Problems":
        """The same without those of services that no test uses; all stay where a test uses one that cannot be read."""
        if not all(test.is_complete for test in tests):
            return self
        used = {service.manifest.folder.resolve() for test in tests for service in test.services}
        kept = (d for d in self.of_services if d.rule == _OF_ALL or Path(d.span.file).resolve().parent in used)
        return replace(self, of_services=tuple(kept))

    def of(self, specs: Iterable[Spec]) -> tuple[Diagnostic, ...]:
        """What these instances have, sorted by position, each once.

        It names the tests that have it: none if its position shows whose it is, or if it is of a file.
        """
        instances: dict[Path, list[Spec]] = {}
        for spec in specs:
            instances.setdefault(spec.path, []).append(spec)
        names: dict[Diagnostic, dict[str, None]] = {}
        at_home = set[Diagnostic]()
        for path, own in instances.items():
            titles, ends = {spec.title for spec in own}, {e.span for s in own for one in s.ranges for e in one.ends}
            every = titles | {corner.title for spec in own for corner in spec.corners}
            for problem in self.by_rules.get(path, ()):
                having = [title for title in problem.tests if title in every]
                if not having:
                    continue
                is_of_all = titles <= set(having)
                shown = [own[0].name or own[0].location.stem] if is_of_all else having
                names.setdefault(problem, {}).update(dict.fromkeys(shown))
                is_told = (problem.span.file == str(path) and is_of_all) or problem.span in ends
                if is_told or file_rules.is_own(problem):
                    at_home.add(problem)
        read = itertools.chain.from_iterable(found for path, found in self.as_read.items() if path in instances)
        everything = ordered([*self.common, *self.of_services, *read, *names])
        return tuple(replace(d, tests=() if d in at_home else tuple(names.get(d, ()))) for d in everything)


@dataclass(frozen=True)
class Checked:
    """Tests with everything that was found wrong with them, sorted by place.

    ``problems`` are all that were found when the tests were loaded, also those of the ``application``, which is None
    where it cannot be read. ``unasked`` are the specs of shipped tests that were not asked for by name; ``left_out``
    names those among them that do not fit the application: UNSATISFIED.
    """

    deployment: Deployment
    manifests: Mapping[str, Manifest]
    tests: tuple[ResolvedTest, ...]
    diagnostics: tuple[Diagnostic, ...]
    settings: Settings = field(default_factory=Settings)
    application: ApplicationSource | None = None
    empty: tuple[Path, ...] = ()
    problems: Problems = field(default_factory=Problems)
    unasked: frozenset[Path] = frozenset()
    left_out: tuple[str, ...] = ()

    @property
    def specs(self) -> tuple[Spec, ...]:
        return tuple(test.spec for test in self.tests)

    @property
    def ok(self) -> bool:
        return not has_errors(self.diagnostics)

    def sound(self) -> "Checked":
        """The same with the tests that can be planned: those without errors, none where what all have has some."""
        if self.ok and self.application:
            return self
        found = (*self.problems.as_read.items(), *self.problems.by_rules.items())
        broken = {path for path, problems in found if has_errors(problems)}
        kept = narrowed(self, [spec for spec in self.specs if spec.path not in broken])
        is_planned = self.application and not has_errors((*kept.problems.common, *kept.problems.of_services))
        return kept if is_planned else narrowed(kept, ())


@dataclass(frozen=True)
class Compilation:
    """Everything to be written: Plans with the files they need, and the child pipeline with its ``jobs``."""

    compiled: "Compiled"
    jobs: "Pipeline"
    problems: tuple[Diagnostic, ...] = ()

    @property
    def pipeline(self) -> "File":
        from dodo_dsl.emit.render import render_pipeline

        return render_pipeline(self.jobs)


class NoApplication(Exception):
    usage = True

    def __init__(self) -> None:
        super().__init__("no application; name its compose file with --application or in dodo.yml")


def load(
    paths: Sequence[Path],
    application: Sequence[Path] = (),
    settings: Settings = Settings(),  # noqa: B008  (it is frozen)
    start: Path | None = None,
    services_only: bool = False,
    names: Collection[str] = (),
) -> Checked:
    """Reads and checks the specs at or below ``paths``, or those of the deployment's registries without any.

    ``application`` are compose files that replace the deployment's, which is looked for at ``start``, then above the
    tests. With ``services_only`` no test is read, and where all ``names`` are those of files, no other is.
    """
    deployment, found = load_deployment(find_deployment(start or Path.cwd(), paths))
    manifests, manifest_problems = load_manifests(deployment.services)
    own = unknown_messages(deployment.services, known_ids(deployment.messages))
    locations, empty = locate(paths, deployment.registry, _registries_above(paths))
    is_each_one = {location.stem for location in locations}.issuperset(names)
    wanted = [location for location in locations if location.stem in names] if names and is_each_one else locations
    once = functools.lru_cache(maxsize=_MOST_READ)(read)
    loaded = {} if services_only else {location.path: load_spec(location, once) for location in wanted}
    source = None
    if files := application or deployment.application:
        source, of_application = read_application(
            files, access(deployment), deployment.sandbox, deployment.declarations
        )
        found = [*found, *of_application]
        if source:
            found += hidden_paths.problems(source, deployment, {location.root for location in locations})
    if settings.emulate:
        rigs = {name: replace(rig, cid=None) for name, rig in deployment.rigs.items()}
        deployment = replace(deployment, rigs=rigs)
    written = (applied(spec, settings) for instances, _ in loaded.values() for spec in instances)
    specs = [one for spec in written for one in on_each(spec, deployment.rigs)]
    shared = {id(corner): corner for spec in specs for corner in spec.corners}  # by instances of a matrix
    corners = [applied(corner, settings) for corner in shared.values()]
    tests, at_ends = (tuple(resolve(some, manifests, deployment, source)) for some in (specs, corners))
    by_rules = check(tests, manifests, deployment, source, at_ends)
    as_read = {path: of_file for path, (_, of_file) in loaded.items()}
    problems = Problems(tuple(found), (*manifest_problems, *own), as_read, by_rules)
    return _with_tests(Checked(deployment, manifests, (), (), settings, source, tuple(empty), problems), tests)


def narrowed(checked: Checked, specs: Collection[Spec]) -> Checked:
    keys = {(spec.path, spec.slug) for spec in specs}
    tests = tuple(test for test in checked.tests if (test.spec.path, test.spec.slug) in keys)
    return _with_tests(replace(checked, problems=checked.problems.without_unused(tests)), tests)


def _with_tests(checked: Checked, tests: tuple[ResolvedTest, ...]) -> Checked:
    together = check_suite(tests, checked.deployment, checked.application)
    found = ordered([*checked.problems.of(test.spec for test in tests), *together])
    return replace(checked, tests=tests, diagnostics=tuple(found))


def at_values(checked: Checked, spec: Spec, values: Mapping[str, Values]) -> Checked:
    """The tests that an instance is at other values of its ranges, each under its own name, such as ``run-7``."""
    return replace(checked, tests=_at(checked, spec, RUN, values), diagnostics=())


def sampled(checked: Checked, samples: Callable[[ResolvedTest], Iterable[Values]]) -> Checked:
    """The same tests, but those with ranges at each of their samples, named ``TEST[sample=1,light=0.7]``."""
    tests: list[ResolvedTest] = []
    for test in checked.tests:
        numbered = {str(number): values for number, values in enumerate(samples(test), 1)} if test.spec.ranges else {}
        tests.extend(_at(checked, test.spec, SAMPLE, numbered) if numbered else [test])
    together = check_suite(tests, checked.deployment, checked.application)
    return replace(checked, tests=tuple(tests), diagnostics=(*checked.diagnostics, *together))


def _at(checked: Checked, spec: Spec, label: str, values: Mapping[str, Values]) -> tuple[ResolvedTest, ...]:
    """The tests at values by their numbers, which ``label`` announces; a sample's name shows its values, too."""
    made = []
    for number, one in values.items():
        name = (*spec.choice.values, (label, Scalar(spec.span("name"), number, number)))
        choice = Choice(name, tuple(one.items()) if label == SAMPLE else ())
        made.append(varied(spec, one, choice) if spec.ranges else replace(spec, choice=choice))
    specs = (applied(one, checked.settings) for one in made)
    return tuple(resolve(specs, checked.manifests, checked.deployment, checked.application))


def access(deployment: Deployment) -> Access:
    roots = (str(deployment.root),) if deployment.file else ()
    ports = tuple(port.text for rig in deployment.rigs.values() if isinstance(port := rig.node.get(PORT), Scalar))
    return Access(roots, tuple(deployment.paths), deployment.environment, deployment.outside, ports=ports)


def without_unsatisfied(checked: Checked, named: Collection[Path] = ()) -> Checked:
    """The same without shipped tests that do not fit the application, by UNSATISFIED, but for the files ``named``.

    Warnings about shipped tests go, too, also about those ``named``, as the user did not write these tests.
    """
    first = {test.spec.path: test.spec for test in reversed(checked.tests)}
    root = checked.deployment.root
    shipped = {path for path, spec in first.items() if package_data.is_shipped(spec.location.root, root)}
    unfed = {path for path in shipped if any(d.rule in UNSATISFIED for d in checked.problems.by_rules[path])}
    left_out = unfed - set(named)
    kept = _with_tests(checked, tuple(test for test in checked.tests if test.spec.path not in left_out))
    files = {str(path) for path in shipped}
    return replace(
        kept,
        diagnostics=tuple(d for d in kept.diagnostics if d.severity == "error" or d.span.file not in files),
        unasked=frozenset(shipped - set(named)),
        left_out=tuple(sorted(first[path].location.stem for path in left_out)),
    )


def _registries_above(paths: Sequence[Path]) -> list[Path]:
    """The registries of the deployments that hold the paths, wherever DoDo was started."""
    files = {find_deployment(path if path.is_dir() else path.parent) for path in paths}
    return [folder for file in files if file for folder in load_deployment(file)[0].registry]


def plan(checked: Checked, out: Path, options: "JobOptions | None" = None) -> Compilation:
    """The Plans of tests without errors, for the output folder ``out``; raises NoApplication without one.

    ``options`` hold for all jobs of the pipeline.
    """
    from dodo_dsl.plan.build import build
    from dodo_dsl.plan.pipeline import MOST_JOBS, JobOptions, pipeline

    if checked.application is None:
        raise NoApplication
    compiled = build(
        checked.tests, checked.manifests, checked.deployment, checked.application, out.resolve(), checked.settings
    )
    jobs = pipeline(compiled.suite, out, options or JobOptions())
    if (number := len(jobs.jobs)) <= MOST_JOBS:
        return Compilation(compiled, jobs)
    (path, most), *_ = Counter(spec.path for spec in checked.specs).most_common(1)
    spec = next(spec for spec in checked.specs if spec.path == path)
    place = spec.spans.get("matrix", spec.span("name"))
    message = f"the child pipeline has {number} jobs, {most} of this test; gitlab.com's free tier allows {MOST_JOBS}"
    hint = "compile fewer tests into one pipeline, or run them in one job with the template 'run' and 'parallel'"
    return Compilation(compiled, jobs, (Diagnostic(place, "pipeline-limit", message, hint, "warning"),))
