"""The pictures of docs/method.md can be drawn again."""

import re

import pytest

from mpe_core.search.pose_search import QUICK
from tests.conftest import PROJECT

pictures = pytest.importorskip("benchmarks.pictures", reason="matplotlib is not installed")

LARGEST = 150_000  # bytes
METHOD = PROJECT / "docs" / "method.md"


@pytest.fixture(scope="module")
def story(data):
    return pictures.tell()


@pytest.mark.parametrize("picture", pictures.PICTURES, ids=lambda picture: picture.__name__)
def test_a_picture_is_drawn_the_same_twice(story, picture, tmp_path):
    drawn = []
    for name in ("once", "twice"):
        (tmp_path / name).mkdir()
        drawn.append(pictures.draw(picture, story, tmp_path / name).read_bytes())
    assert drawn[0] == drawn[1]
    assert 2_000 < len(drawn[0]) < LARGEST


def test_the_story_is_that_of_the_result(story):
    assert story.degrees(story.found[0].minimum.T) < 1
    assert len(story.votes) == len(story.rotations) == QUICK.rotations
    assert [len(poses) for poses, _ in story.waves] == sorted(
        (len(poses) for poses, _ in story.waves), reverse=True
    )


def test_the_page_shows_every_picture():
    shown = re.findall(r"\(pictures/([\w-]+)\.png\)", METHOD.read_text())
    assert sorted(shown) == sorted(p.__name__.replace("_", "-") for p in pictures.PICTURES)
    for name in shown:
        assert (METHOD.parent / "pictures" / f"{name}.png").stat().st_size < LARGEST
