"""What the documentation promises: every page in the navigation, one for each format, drawings that are up to date."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import ipm_rs
from ipm_rs import calibration

ROOT = Path(__file__).resolve().parents[2]
NAVIGATION = re.findall(
    r"^ +- (?:[^:\n]+: )?(\S+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE
)
FROM_THE_ROOT = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")  # scripts/mkdocs_root_pages.py


def pages() -> list[Path]:
    return [*(ROOT / name for name in FROM_THE_ROOT), *sorted((ROOT / "docs").rglob("*.md"))]


def test_every_page_is_in_the_navigation():
    """Pages, decisions and the Markdown files of the root: each once, and nothing that is not there."""
    docs = [page.relative_to(ROOT / "docs").as_posix() for page in (ROOT / "docs").rglob("*.md")]
    assert sorted(NAVIGATION) == sorted([*docs, *(name.lower() for name in FROM_THE_ROOT)])
    assert {page.parent for page in ROOT.glob("*.md")} == {ROOT} and {p.name for p in ROOT.glob("*.md")} == {
        *FROM_THE_ROOT
    }


def test_decisions_are_numbered_without_gaps():
    names = sorted(page.name for page in (ROOT / "docs" / "decisions").glob("*.md"))
    assert [name[:5] for name in names] == [f"{number:04}-" for number in range(1, len(names) + 1)]
    for name in names:
        title = (ROOT / "docs" / "decisions" / name).read_text(encoding="utf-8").splitlines()[0]
        assert title.startswith(f"# {name[:4]}: "), name


def test_the_changelog_tells_what_is_released_from_what_is_not():
    versions = re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert versions[:2] == ["Unreleased", ipm_rs.__version__]


def test_the_glossary_names_what_the_sources_have():
    sources = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.rs"))
    rows = re.findall(r"^\| .*$", (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8"), re.MULTILINE)
    names = [name for row in rows for name in re.findall(r"`([A-Z]\w+)`", row)]
    assert len(names) >= 10
    for name in names:
        assert re.search(rf"\b(struct|enum|type|trait) {name}\b", sources), name
    words = [row.split("|")[1].strip() for row in rows if "---" not in row and "| word |" not in row]
    assert len(words) == len(set(words)) > 20


@pytest.mark.parametrize("page", sorted((ROOT / "docs").rglob("*.md")), ids=lambda page: page.stem)
def test_code_is_not_cut_off(page):
    """docs/assets/wide.css has room for 120 characters in a window of 1400 pixels."""
    blocks = re.findall(r"^```.*?^```", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    assert [line for block in blocks for line in block.splitlines() if len(line) > 120] == []


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    """MkDocs checks its own pages; this checks the repository's as well, where they are read without it."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        if "://" not in target:
            found = page.parent / target
            generated = found.parent == ROOT / "docs" and found.name.upper() in map(str.upper, FROM_THE_ROOT)
            assert found.exists() or generated, target


@pytest.mark.parametrize("name", calibration.FORMATS)
def test_every_format_has_a_page(name):
    page = (ROOT / "docs" / "datasets" / f"{name}.md").read_text(encoding="utf-8")
    for part in ("```python", "## Traps", f"::: ipm_rs.calibration.{name}.read", "BevGrid(", "lut.warp("):
        assert part in page, part
    assert f"from_{name}(" in page or name == "json"
    assert f"datasets/{name}.md" in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert f"({name}.md)" in (ROOT / "docs" / "datasets" / "index.md").read_text(encoding="utf-8")


def test_frames_are_drawn_by_their_script(tmp_path):
    subprocess.run([sys.executable, ROOT / "scripts" / "draw_frames.py", tmp_path / "frames.svg"], check=True)
    assert (tmp_path / "frames.svg").read_text() == (ROOT / "docs" / "images" / "frames.svg").read_text()


SEARCHED = {
    "cityscapes": ["Cityscapes"], "kitti": ["KITTI", "odometry"], "kitti_raw": ["KITTI raw"],
    "kitti_360": ["KITTI-360"], "nuscenes": ["nuScenes", "Lyft", "nuImages"], "argoverse2": ["Argoverse 2"],
    "waymo": ["Waymo"], "carla": ["CARLA"], "woodscape": ["WoodScape"], "matlab": ["MATLAB"],
    "ros": ["ROS", "CameraInfo"], "opencv": ["OpenCV", "PhotonVision", "npz"], "kalibr": ["Kalibr"],
    "colmap": ["COLMAP"], "camodocal": ["camodocal", "VINS-Mono", "VINS-Fusion"],
    "euroc": ["EuRoC", "ASL", "TUM-VI", "Kimera"], "ncamera": ["ncamera", "maplab", "SVO Pro", "ROVIO", "aslam_cv2"],
    "okvis": ["okvis", "okvis2"], "basalt": ["basalt", "Monado"], "orbslam": ["ORB-SLAM2", "ORB-SLAM3"],
    "nerfstudio": ["nerfstudio", "instant-ngp", "NeRF", "transforms.json"], "open3d": ["Open3D"],
    "depthai": ["DepthAI", "OAK"], "ocamcalib": ["OCamCalib", "Scaramuzza"], "dgp": ["DGP", "DDAD"],
    "argoverse1": ["Argoverse 1"], "mmdet3d": ["mmdetection3d", "cam2img"], "once": ["ONCE"],
    "zod": ["ZOD", "Zenseact"], "openlane": ["OpenLane", "OpenLane-V2"], "pandaset": ["PandaSet"],
    "a2d2": ["A2D2", "Audi"], "cam2bev": ["Cam2BEV"], "autoware": ["Autoware.AI"],
    "pjlab": ["SensorsCalibration", "PJLab", "OpenCalib"], "realsense": ["RealSense", "librealsense", "D435", "T265"],
    "opensfm": ["OpenSfM", "WebODM", "Mapillary"], "metashape": ["Metashape", "PhotoScan", "Agisoft"],
    "json": ["JSON"],
}  # fmt: skip


def test_search_finds_every_name_of_a_format():
    """The site's search looks at the words of pages: each name that somebody may type stands on its format's page."""
    assert set(SEARCHED) == set(calibration.FORMATS)
    lost = []
    for name, words in SEARCHED.items():
        page = (ROOT / "docs" / "datasets" / f"{name}.md").read_text(encoding="utf-8").lower()
        lost += [f"{word} in {name}.md" for word in words if word.lower() not in page]
    assert not lost
