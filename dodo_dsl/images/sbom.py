"""Bills of materials: what an image, or the Python that runs DoDo, is made of, as CycloneDX 1.6 JSON.

Packages name themselves and their licences: Python's by their metadata, Debian's by dpkg and their file `copyright`,
where it has the form that programs read (DEP 5), else by the common licences that it refers to. The same contents give
the same text.
"""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

from dodo_dsl import __version__
from dodo_dsl.images import docker_command

_QUESTION = r"""
import importlib.metadata, json, re, shutil, subprocess
def of_debian(package):
    try:
        text = open(f"/usr/share/doc/{package}/copyright", errors="replace").read()
    except OSError:
        return []
    names = re.findall(r"^License:[ \t]*(\S.*?)[ \t]*$", text, re.M) if text.startswith("Format:") else []
    return sorted(set(names or [n.rstrip(".") for n in re.findall(r"/usr/share/common-licenses/([\w.+-]+)", text)]))
def licence(m):
    return m.get("License-Expression") or next((c.rpartition(" :: ")[2] for c in m.get_all("Classifier") or ()
                                                if c.startswith("License ::")), "")
python = [(d.metadata["Name"], d.version, licence(d.metadata)) for d in importlib.metadata.distributions()]
words = ["dpkg-query", "--show", "--showformat", "${Package}\t${Version}\t${Architecture}\n"]
said = subprocess.run(words, capture_output=True, text=True).stdout if shutil.which(words[0]) else ""
about = dict(line.rstrip().replace('"', "").split("=", 1) for line in open("/etc/os-release") if "=" in line)
debian = [line.split("\t") for line in said.splitlines()]
print(json.dumps({"python": python, "debian": [[*row, of_debian(row[0])] for row in debian],
                  "system": [about.get("ID", "linux"), about.get("VERSION_ID", "")]}))
"""


class SbomError(Exception):
    """Contents that cannot be asked for; one sentence."""


def of_image(name: str, reference: str) -> str:
    """The bill of an image that the engine has; raises SbomError."""
    words = ("run", "--rm", "--network", "none", "--read-only", "--entrypoint", "python3", reference, "-c", _QUESTION)
    try:
        told = json.loads(docker_command.ask(*words))
        digest = docker_command.ask("image", "inspect", "--format", "{{.Id}}", reference)
    except (docker_command.DockerError, ValueError) as error:
        raise SbomError(f"{reference} does not say what it is made of: {error}") from None
    kind, _, content = digest.partition(":")
    hashes = [{"alg": "SHA-256", "content": content}] if kind == "sha256" else []
    subject = {"type": "container", "name": name, "version": reference.rpartition(":")[2], "hashes": hashes}
    return _bill(subject, told, with_debian=True)


def of_environment() -> str:
    """The bill of the Python environment that this process runs in, without the machine's own packages."""
    done = subprocess.run([sys.executable, "-c", _QUESTION], capture_output=True, text=True, check=True)
    subject = {"type": "application", "name": "dodo-dsl", "version": __version__}
    return _bill(subject, json.loads(done.stdout), with_debian=False)


def _bill(subject: Mapping[str, Any], told: Mapping[str, Any], *, with_debian: bool) -> str:
    own = (subject["name"], subject["version"])
    rows = [_python(*row) for row in told["python"] if tuple(row[:2]) != own]
    if with_debian:
        rows += [_debian(*row, *told["system"]) for row in told["debian"]]
    components = {row["bom-ref"]: row for row in rows}
    document = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {"bom-ref": f"{subject['name']}@{subject['version']}", **subject},
            "tools": {"components": [{"type": "application", "name": "dodo-dsl", "version": __version__}]},
        },
        "components": [components[key] for key in sorted(components)],
    }
    return json.dumps(document, indent=2) + "\n"


def _python(name: str, version: str, licence: str) -> dict[str, Any]:
    url = f"pkg:pypi/{quote(name.lower().replace('_', '-'))}@{quote(version)}"
    return _component(name, version, url, [licence] if licence else [])


def _debian(
    name: str, version: str, architecture: str, licences: Sequence[str], system: str, release: str
) -> dict[str, Any]:
    distribution = f"{system}-{release}" if release else system
    more = f"?arch={quote(architecture)}&distro={quote(distribution)}"
    return _component(name, version, f"pkg:deb/{quote(system)}/{quote(name)}@{quote(version)}{more}", licences)


def _component(name: str, version: str, url: str, licences: Sequence[str]) -> dict[str, Any]:
    told = {"licenses": [{"license": {"name": one}} for one in licences]} if licences else {}
    return {"type": "library", "bom-ref": url, "name": name, "version": version, "purl": url, **told}
