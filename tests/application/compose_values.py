"""Values of keys in a service of a compose file, right and wrong ones; the volume ``known`` is declared."""

RIGHT = """
stop_grace_period: 1.5s
stop_grace_period: "0"
stop_grace_period: ${STOP:-5s}
volumes: [known:/data, "${V:-known}:/more"]
volumes: [./data:/data, /data]
volumes: [{type: volume, source: known, target: /data}]
volumes: [{type: volume, target: /data}, {type: tmpfs, target: /t}, {type: bind, source: ./data, target: /b}]
cpus: 0.5
cpus: "1e1"
cpus: 0x10
tmpfs: "/run:size=3m"
user: "1000:1000"
healthcheck: {test: a, interval: 5s, timeout: 1m, start_period: 1h2m, start_interval: 500ms, retries: 3}
healthcheck: {test: [CMD, a], interval: "${I:-5s}", retries: "3"}
healthcheck: {test: ["${T:-CMD}", a]}
healthcheck: {disable: "yes"}
healthcheck: {test: a, x-note: b}
init: Y
init: "OFF"
labels: {a: b, c: 5, d: true, e: null, f: "${B}"}
x-extra: {stop_grace_period: soon, init: perhaps}
mem_limit: 512 MB
mem_limit: "512.5kib"
pids_limit: "-1"
volumes: [{type: tmpfs, target: /t, tmpfs: {size: 5m}}]
deploy: {resources: {limits: {memory: 50M}}}
environment: {A: "${B-1}", C: "$$x", D: "$(e)", F: "g$", H: "$5", I: "${J:-${K:+l}}", M: "${N:-{o}}}", P: "$${"}
environment: ["A=${B:-$}"]
""".strip().splitlines()

WRONG = """
stop_grace_period: 10
volumes: [known:/data, "data:/more:ro"]
cap_drop: true
cpus: "0x10"
cpus: [1]
user: {a: b}
init: 1
mem_limit: lots
mem_limit: 0,5g
environment: ["A=${B:-${C}"]
environment: ["A=${B:-${}}"]
x-own: "${B"
""".strip().splitlines()

NO_VOLUMES = ['volumes: ["d:/data"]', 'volumes: [known:/data, "d:/data:ro"]']
"""These compose reads, and does not start."""


def compose_file(value: str, image: str = "x") -> str:
    """A compose file with the value in its only service."""
    return f"services:\n  a:\n    image: {image}\n    command: --cid=111\n    {value}\nvolumes: {{known: }}\n"
