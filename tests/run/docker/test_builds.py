"""Names of built images: none that an application's file asks for."""

import pytest

from dodo_dsl.run.docker.builds import is_built, private_images

BUILD = {"context": "/application"}


def test_a_built_image_has_a_name_of_its_own_for_all_that_use_it() -> None:
    services = {"a-b": {"image": "postgres", "build": BUILD}, "c": {"image": "postgres"}, "d": {"image": "alpine"}}
    names = private_images(services, services)
    assert names.keys() == {"DODO_IMAGE_A_B", "DODO_IMAGE_C"}
    (name,) = set(names.values())
    assert name.startswith("dodo-build:")


def test_names_differ_by_build_and_image_and_last() -> None:
    kinds = [("a", BUILD), ("b", BUILD), ("a", {"context": "/other"}), ("a", BUILD)]
    names = [private_images({"s": {"image": image, "build": build}}, ("s",))["DODO_IMAGE_S"] for image, build in kinds]
    assert len(set(names[:3])) == 3
    assert names[3] == names[0]


def test_only_the_applications_images_get_one() -> None:
    assert private_images({"dodo-clock": {"image": "dodo/clock", "build": BUILD}, "s": {"build": BUILD}}, ("s",)) == {}


@pytest.mark.parametrize(
    ("service", "built"),
    [
        ({"build": BUILD}, True),
        ({"build": BUILD, "image": "a:1"}, True),
        ({"build": BUILD, "image": f"a@sha256:{'0' * 64}"}, False),
        ({"image": "a:1"}, False),
    ],
)
def test_what_is_built(service: dict[str, object], built: bool) -> None:
    assert is_built(service) is built
