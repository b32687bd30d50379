"""Changes of a valid test or its files, and which rules say where that it is wrong, beside those in ``rows``."""

from pathlib import Path

import pytest

from dodo_dsl.opendlv.odvd import STANDARD_0_9
from tests.check import examples
from tests.check.contexts import checked, resolved

S, P, F = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest", "opendlv.sim.Frame"
OLD = "float x; float y; float z; float roll; float pitch; float yaw;"


END = "path: {uses: beacon, with: {length: 1 m}}"
HOLD = "path: {uses: beacon, with: {length: 1 m, hold: true}}"


def app(takes: str = "", sends: str = f"{S}, {P}") -> str:
    return (
        "# docker-compose.yml\nservices: {driver: {image: driver, command: --cid=1, "
        f"x-dodo: {{in: [{takes}], out: [{sends}]}}}}}}\n"
    )


def cmd(*words: str) -> str:
    services = (f'  s{number}: {{image: x, command: "--cid=111 {word}"}}\n' for number, word in enumerate(words))
    return "# docker-compose.yml\nservices:\n" + "".join(services)


def cam(values: str) -> str:
    return f"environment: {{camera: {{uses: virtual-camera, with: {{map-path: ../maps/plain, {values}}}}}}}\n"


def track(values: str) -> str:
    return f"evaluation: {{track: {{uses: collision, with: {{{values}}}}}}}\n"


def own(definition: str, takes: str = "") -> str:
    text = f"# dodo.yml\nmessages: [my.odvd]\n# my.odvd\nmessage {definition}\n"
    return text + (app(takes) if takes else "")


def signal(path: str, limits: str, begin: float, end: float) -> str:
    return (
        "kind: open-loop\nclock: lockstep\ntimeout: 90 s\nenvironment:\n"
        f"  camera: {{uses: virtual-camera, with: {{map-path: ../maps/plain, freq: 10 Hz}}}}\n  {path}\n"
        "evaluation:\n  judge:\n    uses: continuous-signal\n"
        f"    with: {{message: {S}, field: groundSteering, target: ../t.csv, max-mean: 1{limits}}}\n"
        f"# tests/t.csv\ntime,value\n{begin},0\n{end},0\n"
    )


CHANGES = [
    (
        "clock: realtime\naction:\n  vehicle: {uses: dynamic-model, with: {freq: 75 Hz}}\n  pose: {uses: integrator}\n",
        "",
    ),
    (
        "clock: lockstep\naction:\n  vehicle: {uses: dynamic-model, with: {freq: 2.5 Hz}}\n"
        "  pose: {uses: integrator, with: {freq: 1 kHz}}\n",
        "",
    ),
    (
        "environment:\n  camera: {uses: virtual-camera, with: {map-path: ../maps/plain}}\n"
        "  other: {uses: virtual-camera, with: {map-path: ../maps, name.argb: b.argb, name.i420: b.i420, "
        "frame-id: 1}}\n",
        "11:3 missing-parameter, 14:3 no-producer, map.json:1:1 wrong-file",
    ),
    (track("goal: finish, walls: [a, finish, b]"), "12:68 unknown-name, 12:79 unknown-name"),
    (
        track("walls: ['*', blocks, hedge, obstacle-1, obstacle-2]")
        + '# tests/maps/plain/map.json\n{"obstacles": [{"lines": [0, 0, 1, 1]}], "block": [{"name": "hedge"}]}\n',
        "base.dodo.yml:14:41 unknown-name, 12:86 unknown-name",
    ),
    ("timeout: 1 min\n" + track("goal: finish, max-time: 40 s"), ""),
    (signal(END, "", 0, 0.5), "7:3 two-producers, 15:3 input-limit"),
    (signal(END, ", min-samples: 6", 0, 0.5), "7:3 two-producers"),
    (signal(END, ", from: 2 s, until: 2.8 s", 0, 9), "7:3 two-producers, 15:3 input-limit"),
    (signal(END, ", max-gap: 50 ms", 0, 9), "7:3 two-producers, 17:121 input-limit"),
    (signal(END, "", 1.7e9, 1.7e9 + 9), "7:3 two-producers, 17:89 input-limit"),
    (signal(END, ", align: sample-time", 0, 9), "7:3 two-producers, 17:89 input-limit"),
    (signal(HOLD, "", 0, 89), "7:3 two-producers, 15:3 input-limit"),
    (signal(HOLD, ", max-time: 60 s", 0, 89), "7:3 two-producers"),
    (signal(END, "", 0, 89), "7:3 two-producers"),
    (app("my.Own/3"), "docker-compose.yml:1:68 application-input, docker-compose.yml:1:68 unknown-message"),
    (
        "# dodo.yml\nmessages: [my.odvd]\n# my.odvd\nmessage my.Own [id = 3000] { float x [id = 1]; }\n"
        + app("my.Own/3"),
        "docker-compose.yml:1:68 application-input",
    ),
    (own(f"{S} [id = 1090] {{ float groundSteering; float rate; }}"), ""),
    (own(f"{S} [id = 1090] {{ double groundSteering; }}"), "my.odvd:1:9 wrong-messages"),
    (own(f"{S} [id = 1071] {{ float groundSteering; }}"), "my.odvd:1:9 wrong-messages"),
    (own("team.Angle [id = 1090] { float angle; }"), "my.odvd:1:9 wrong-messages"),
    (own("team.Angle [id = 1130] { float angle; }"), ""),
    (own(f"{F} [id = 1001] {{ {OLD} }}"), ""),
    (own(f"{F} [id = 1001] {{ {OLD} }}", F), ""),
    (own(f"{F} [id = 1001] {{ float x; float y; float yaw; }}", F), "my.odvd:1:9 wrong-messages"),
    (app(), ""),
    (app("", S), "base.dodo.yml:11:3 no-producer, 10:3 no-producer"),
    (app("", f"{S}, {P}, {F}"), "docker-compose.yml:1:150 two-producers"),
    (app(f"opendlv.proxy.DistanceReading, {F}"), "docker-compose.yml:1:68 application-input"),
    ("action: {vehicle: {uses: dynamic-model}}\n", "8:3 no-producer, 10:3 no-sample"),
    (
        "environment: {camera: {uses: virtual-camera, with: {map-path: ../maps/plain}}, "
        "ranges: {uses: range-finder, with: {id: [0, 2]}}}\n"
        + app("opendlv.proxy.DistanceReading/2, opendlv.proxy.DistanceReading/21"),
        "docker-compose.yml:1:68 application-input, docker-compose.yml:1:101 application-input, "
        "docker-compose.yml:1:101 application-input",
    ),
    (cmd("--name=${MEMORY:-pictures}"), "docker-compose.yml:2:27 application-memory"),
    (cmd("--name=/video0.argb"), ""),
    (cmd("--name.in=video0.argb --name.out=seen"), ""),
    (cmd("--name=${MEMORY}"), ""),
    (cmd("--name=seen", "--name=seen"), ""),
]


def told(change: str, folder: Path) -> str:
    found = checked(change, folder).diagnostics
    places = {problem: f"{Path(problem.span.file).name}:{problem.span.line}:{problem.span.column}" for problem in found}
    return ", ".join(f"{place.removeprefix('example.dodo.yml:')} {problem.rule}" for problem, place in places.items())


@pytest.mark.parametrize(("change", "expected"), CHANGES, ids=range(len(CHANGES)))
def test_a_change_and_what_is_said_of_it(change: str, expected: str, tmp_path: Path) -> None:
    assert told(change, tmp_path) == expected


def test_the_base_of_all_changes_is_valid(tmp_path: Path) -> None:
    assert told("", tmp_path) == ""
    assert examples.problems(tmp_path) == []


@pytest.mark.parametrize("takes", [F, S])
def test_an_application_of_set_0_9_gets_its_frames(takes: str, tmp_path: Path) -> None:
    example = f"# dodo.yml\nmessages: [my.odvd]\n# my.odvd\n{STANDARD_0_9.read_text()}\n"
    test = resolved(example + app(takes, ""), tmp_path)
    (pose,) = (service for service in test.services if service.manifest.name == "integrator")
    assert pose.texts["euler"] == ("true" if takes == F else "false")


def test_where_the_input_ends_by_itself_it_is_judged_for_the_tests_timeout(tmp_path: Path) -> None:
    for name, path, limit in (("a", END, "90"), ("b", HOLD, "60")):
        (tmp_path / name).mkdir()
        judge = next(
            each for each in resolved(signal(path, "", 0, 9), tmp_path / name).services if each.use.name == "judge"
        )
        assert judge.texts["max-time"] == limit
