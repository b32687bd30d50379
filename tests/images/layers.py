"""What images weigh together: bytes of layers by their content, from what the engine saves."""

import json
import subprocess
import tarfile
from collections.abc import Sequence


def layers(references: Sequence[str]) -> dict[str, dict[str, int]]:
    """For each image the bytes of its layers (as tar files) by the digest of their content."""
    sizes: dict[str, int] = {}
    links: dict[str, str] = {}
    texts: dict[str, bytes] = {}
    with (
        subprocess.Popen(["docker", "save", *references], stdout=subprocess.PIPE) as process,
        tarfile.open(fileobj=process.stdout, mode="r|") as archive,
    ):
        for member in archive:
            sizes[member.name] = member.size
            if member.issym():
                links[member.name] = f"{member.linkname}".removeprefix("../")
            elif member.isfile() and member.size < 1_000_000 and (content := archive.extractfile(member)):
                texts[member.name] = content.read()
    found = {}
    for image in json.loads(texts["manifest.json"]):
        digests = json.loads(texts[image["Config"]])["rootfs"]["diff_ids"]
        own = {d: sizes[links.get(name, name)] for d, name in zip(digests, image["Layers"], strict=True)}
        for reference in image["RepoTags"]:
            found[reference] = own
    return found
