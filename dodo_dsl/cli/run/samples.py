"""Tests at samples of their ranges, for ``dodo run --samples``."""

from dodo_dsl import compiler
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.cli.errors import UsageError, require_extra
from dodo_dsl.search.space import space_of, sweep
from dodo_dsl.spec.instances.pools import of_test
from dodo_dsl.spec.instances.vary import Values


def sample(checked: compiler.Checked, number: int) -> tuple[compiler.Checked, dict[str, str]]:
    """The tests with ranges at the first values of a sweep, which depend on their seed alone.

    With them the slug of each one's test by its own slug. Raises UsageError where no test has a range.
    """
    require_extra("--samples", "search")
    if not any(test.spec.ranges for test in checked.tests):
        raise UsageError("--samples is for tests with ranges: none of these has 'vary'")
    origins: dict[str, str] = {}

    def swept(test: ResolvedTest) -> list[Values]:
        values = list(sweep(space_of(test), number, test.spec.seed))
        slugs = (f"{test.spec.slug}--{compiler.SAMPLE}-{n}" for n in range(1, len(values) + 1))
        origins.update(dict.fromkeys(slugs, of_test(test.spec).slug))
        return values

    return compiler.sampled(checked, swept), origins
