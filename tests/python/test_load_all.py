"""`Camera.load_all` and `Rig.load`: every camera of a file or a directory, each as `Camera.load` reads it."""

from __future__ import annotations

import pytest
from calibration_samples import SAMPLES
from helpers import refuses

import ipm_rs
from ipm_rs import errors

# What each sample holds, beside its options; None is a file of one camera, by the file's name.
NAMES = {
    "kitti object": ["P0", "P1", "P2", "P3"],
    "kitti raw": ["image_00", "image_01", "image_02", "image_03"],
    "kitti-360": ["image_00", "image_01", "image_02", "image_03"],
    "nuscenes directory": None,
    "waymo context": None,
    "carla ros bridge": None,
    "opencv stereo": None,
    "kalibr": ["cam0", "cam1", "cam2"],
    "colmap": None,
    "argoverse2": None,
}


@pytest.mark.parametrize("sample", [name for name in NAMES if name in SAMPLES])
def test_each_is_as_load_reads_it(sample, tmp_path):
    given = SAMPLES[sample]
    path = given.write(tmp_path)
    options = {key: value for key, value in given.options.items() if key != "camera"}
    cameras = ipm_rs.Camera.load_all(path, **options)
    expected = NAMES[sample]
    assert len(cameras) > 1 or expected is None
    assert expected is None or list(cameras) == expected
    for name, camera in cameras.items():
        assert camera == ipm_rs.Camera.load(path, camera=name, **options)
    chosen = ipm_rs.Camera.load(path, **given.options)
    assert chosen in cameras.values()
    assert ipm_rs.Rig.load(path, **options) == ipm_rs.Rig(cameras)


def test_a_file_of_one_camera_is_one_by_its_name(tmp_path):
    path = SAMPLES["cityscapes"].write(tmp_path)
    assert ipm_rs.Camera.load_all(path) == {path.stem: ipm_rs.Camera.load(path)}


def test_a_directory_with_a_file_for_each_camera(tmp_path):
    content = SAMPLES["cityscapes"].write(tmp_path / "one").read_bytes()
    folder = tmp_path / "rig"
    folder.mkdir()
    for name in ("right", "front"):
        (folder / f"{name}.json").write_bytes(content)
    (folder / "LICENCE.txt").write_text("do what you like\n")
    (folder / "front.png").write_bytes(b"not looked at")
    cameras = ipm_rs.Camera.load_all(folder)
    assert list(cameras) == ["front", "right"] and cameras["front"] == ipm_rs.Camera.load(folder / "front.json")
    (folder / "broken.json").write_text('{"fx": 3}')
    with refuses(errors.CalibrationError, "broken.json", "known format"):
        ipm_rs.Camera.load_all(folder)
    (folder / "broken.json").unlink()
    (folder / "front.yaml").write_bytes(SAMPLES["kalibr"].files["camchain-imucam.yaml"])
    with pytest.raises(errors.IpmError):
        ipm_rs.Camera.load_all(folder)


def test_what_a_rig_saved(tmp_path):
    camera = ipm_rs.Camera.load(SAMPLES["cityscapes"].write(tmp_path))
    ipm_rs.Rig({"b": camera, "a": camera.masked(hide=[[0, 0], [9, 0], [0, 9]])}).save(tmp_path / "rig.json")
    cameras = ipm_rs.Camera.load_all(tmp_path / "rig.json")
    assert list(cameras) == ["b", "a"] and cameras["a"].mask is not None
    assert ipm_rs.Camera.load(tmp_path / "rig.json", camera="a") == cameras["a"]
    with refuses(errors.ArgumentError, "camera"):
        ipm_rs.Camera.load(tmp_path / "rig.json")
    with refuses(errors.ArgumentError, "no options"):
        ipm_rs.Camera.load_all(tmp_path / "rig.json", image_size=(3, 4))


def test_what_holds_no_camera_is_refused(tmp_path):
    with refuses(errors.CalibrationError, "a calibration file for each camera"):
        ipm_rs.Camera.load_all(tmp_path)
    with pytest.raises(errors.MissingFileError):
        ipm_rs.Camera.load_all(tmp_path / "none")
    with refuses(errors.ArgumentError, "frame: expected none"):
        ipm_rs.Camera.load_all(SAMPLES["cityscapes"].write(tmp_path), frame="imu")
