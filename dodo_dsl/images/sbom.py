"""Bills of materials: what an image, or the Python that runs DoDo, is made of, as CycloneDX 1.6 JSON.

Packages name themselves and their licences: Python's by their metadata, Debian's by dpkg and their file `copyright`,
if it has the form that programs read (DEP 5), else by the common licences that it refers to. The same contents give
the same text.
"""

import json
import subprocess
import sys
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any
from uuid import NAMESPACE_URL, uuid5

from dodo_dsl import __version__
from dodo_dsl.images import docker_command

if TYPE_CHECKING:  # of the extra sbom
    from cyclonedx.model.license import License

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
    return _bill("container", name, reference.rpartition(":")[2], told, digest.removeprefix("sha256:"))


def of_environment() -> str:
    """The bill of the Python environment that this process runs in, without the machine's own packages."""
    done = subprocess.run([sys.executable, "-c", _QUESTION], capture_output=True, text=True, check=True)
    return _bill("application", "dodo-dsl", __version__, {**json.loads(done.stdout), "debian": []})


def _bill(kind: str, name: str, version: str, told: Mapping[str, Any], digest: str = "") -> str:
    from cyclonedx.contrib.license.factories import LicenseFactory
    from cyclonedx.model import HashAlgorithm, HashType
    from cyclonedx.model.bom import Bom
    from cyclonedx.model.component import Component, ComponentType
    from cyclonedx.output.json import JsonV1Dot6
    from packageurl import PackageURL

    components: dict[str, Component] = {}

    def add(name: str, url: PackageURL, licences: Iterable["License"]) -> None:
        key = str(url)
        components[key] = Component(name=name, version=url.version, bom_ref=key, purl=url, licenses=licences)

    licence, system = LicenseFactory(), told["system"]
    for package, release, text in told["python"]:
        if (package, release) != (name, version):
            add(package, PackageURL("pypi", None, package, release), [licence.make_from_string(text)] if text else [])
    for package, release, machine, texts in told["debian"]:
        more = {"arch": machine, "distro": "-".join(filter(None, system))}
        add(package, PackageURL("deb", system[0], package, release, more), map(licence.make_with_name, texts))
    hashes = [HashType(alg=HashAlgorithm.SHA_256, content=digest)] if digest else []
    subject = Component(
        name=name, version=version, type=ComponentType(kind), hashes=hashes, bom_ref=f"{name}@{version}"
    )
    bom = Bom(components=components.values())
    bom.metadata.component = subject
    bom.metadata.tools.components.add(Component(name="dodo-dsl", version=__version__, type=ComponentType.APPLICATION))
    bom.register_dependency(subject, bom.components)
    # the same contents give the same text
    bom.metadata.timestamp = None  # type: ignore[assignment]
    bom.serial_number = uuid5(NAMESPACE_URL, " ".join([name, version, digest, *sorted(components)]))
    return JsonV1Dot6(bom).output_as_string(indent=2) + "\n"
