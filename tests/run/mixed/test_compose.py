"""The compose file that leaves the application of a compiled test."""

import yaml

from dodo_dsl.run.mixed import replacing


class _Loader(yaml.SafeLoader):
    """Reads what compose replaces as a value."""


_Loader.add_constructor("!override", lambda loader, node: loader.construct_mapping(node, deep=True))


def test_nothing_waits_for_services_of_dodo() -> None:
    on = {"condition": "service_started"}
    services = {"app": {"depends_on": {"track": on, "sandbox": on, "db": on}}, "db": {}, "sandbox": {}}
    own = {"services": {"sandbox": {"image": "empty:1"}}, "volumes": {"tmp": {}}}
    read = yaml.load(replacing(services, {"app", "db", "gone"}, own), _Loader)
    assert read == {
        "services": {
            "app": {"depends_on": {"sandbox": on, "db": on}},
            "db": {"depends_on": {}},
            "sandbox": {"image": "empty:1"},
        },
        "volumes": {"tmp": {}},
    }
