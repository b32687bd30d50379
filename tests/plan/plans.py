"""Plans for tests, and a strategy that makes any."""

from typing import Any

from hypothesis import strategies as st

from dodo_dsl.plan.model import Application, ApplicationService, Flag, Lockstep, Place, Plan, PlannedService
from dodo_dsl.spec.model import Goal

BASE = Plan(
    name="drive[light=dark]",
    slug="drive--light-dark",
    spec="tests/drive/drive.dodo.yml",
    description="Drive.",
    level="sil",
    kind="closed-loop",
    timeout_s=60.0,
    clock="realtime",
    isolation="network",
    seed=1,
    cid=128,
    subnet="10.213.0.0/28",
    tag="sil",
    sandbox_image="dodo/sandbox:1",
    services=(
        PlannedService("environment", "camera", "virtual-camera", "dodo/camera:1", ("python", "-m", "camera")),
        PlannedService(
            "evaluation", "track-camera", "collision", "dodo/collision:1", (), (Flag("goal", "finish"),), judge=True
        ),
    ),
    application=Application("../../team", (ApplicationService("driver", ("python", "drive.py")),)),
    source_map={
        "environment.camera": Place("tests/drive/drive.dodo.yml", 8, 3),
        "evaluation.track-camera": Place("tests/drive/drive.dodo.yml", 12, 3),
    },
)

_texts = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)
_words = st.lists(_texts, max_size=3).map(tuple)
_names = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9._-]{0,8}", fullmatch=True)
_seconds = st.floats(0, 86_400) | st.integers(0, 86_400)
_inside = st.lists(st.sampled_from(["a", "b.c", "maps", "..d"]), min_size=1, max_size=3).map("/".join)
_flags = st.builds(Flag, _texts, _texts, st.sampled_from(["text", "memory", "memories"])) | st.builds(
    Flag, _texts, _inside, st.sampled_from(["path", "report"])
)
_services = st.builds(
    PlannedService,
    layer=st.sampled_from(["environment", "action", "evaluation"]),
    name=_names,
    uses=_texts,
    image=_texts,
    process=_words,
    flags=st.lists(_flags, max_size=3).map(tuple),
    judge=st.booleans(),
    devices=st.lists(st.sampled_from(["/dev/video0", "/dev/serial/by-id/x"]), max_size=2).map(tuple),
    setup_s=_seconds,
)
_application_services = st.builds(
    ApplicationService,
    name=_names,
    process=st.none() | _words,
    command=_words,
    environment=st.dictionaries(_texts, st.none() | _texts, max_size=2),
    takes_cid=st.booleans(),
    takes_memory=st.booleans(),
    env_files=_words,
    inputs=_words,
    outputs=_words,
)
_compose: Any = st.recursive(
    st.none() | st.booleans() | st.integers(-(1 << 53), 1 << 53) | _texts,
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(_texts, inner, max_size=2),
    max_leaves=5,
)
_applications = st.builds(
    Application,
    folder=_texts,
    services=st.lists(_application_services, max_size=2).map(tuple),
    compose=st.dictionaries(_texts, _compose, max_size=2),
    changes=_words,
)

plans = st.builds(
    Plan,
    name=_texts,
    slug=st.from_regex(r"[a-z0-9]{1,5}(--?[a-z0-9]{1,5}){0,2}", fullmatch=True),
    spec=_texts,
    description=_texts,
    level=st.sampled_from(["sil", "dil", "hil"]),
    kind=_texts,
    timeout_s=st.floats(0.1, 86_400),
    clock=st.sampled_from(["realtime", "lockstep"]),
    isolation=st.sampled_from(["network", "host"]),
    seed=st.integers(0, (1 << 32) - 1),
    cid=st.integers(1, 254),
    subnet=_texts,
    tag=_texts,
    sandbox_image=_texts,
    services=st.lists(_services, max_size=2).map(tuple),
    application=_applications,
    lockstep=st.none() | st.builds(Lockstep, st.integers(1, 1000), st.floats(0.1, 86_400)),
    rig=_texts,
    goals=st.lists(st.builds(Goal, _texts, st.floats(0, 1), st.floats(2, 3), st.floats(0.001, 9)), max_size=2).map(
        tuple
    ),
    messages=st.lists(_inside, max_size=2).map(tuple),
    import_paths=_words,
    shared=st.dictionaries(_inside, st.just(f"{'0' * 64}-a.rec"), max_size=2),
    source_map=st.dictionaries(
        _texts, st.builds(Place, _texts, st.integers(1, 1 << 20), st.integers(1, 1 << 20)), max_size=2
    ),
)
