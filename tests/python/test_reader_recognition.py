"""No reader claims a file that it can never read, and the error about an unknown one is of use."""

from __future__ import annotations

import json
import struct
import subprocess
import sys

import pytest
from calibration_samples import SAMPLES
from foreign_calibrations import FOREIGN
from helpers import refuses

import ipm_rs
from ipm_rs import calibration, errors
from ipm_rs.calibration._files import open_document

pytest.importorskip("yaml")


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_files_are_of_no_known_format(name, tmp_path):
    file, text, nearest = FOREIGN[name]
    path = tmp_path / file
    path.write_text(text)
    with pytest.raises(errors.CalibrationError) as caught:
        ipm_rs.Camera.load(path, image_size=(640, 400))
    head, first, *rest = str(caught.value).splitlines()
    assert "expected a calibration of a known format, got one of none" in head and head.endswith("tried")
    assert "image_size=" not in str(caught.value)
    assert first.strip().startswith(nearest)
    assert len(rest) < 10 and len(str(caught.value)) < 2000
    document = open_document(path, "")
    for module in map(calibration.reader, calibration.FORMATS):
        try:
            assert module.missing(document) is not None, module.TITLE
        except errors.CalibrationError:
            pass


def test_a_key_anywhere_in_the_text_is_no_key(tmp_path):
    path = tmp_path / "notes.yaml"
    text = "image_width: 640\nnote: 'projection_matrix: lost, camera_matrix: lost, distortion_model: plumb_bob'\n"
    path.write_text(text)
    with refuses(errors.CalibrationError, "got one of none", "ros: no [image] section"):
        ipm_rs.Camera.load(path)
    path.write_text("cam0: camera_model\n")
    with refuses(errors.CalibrationError, "got one of none", "kalibr: no section cam0"):
        ipm_rs.Camera.load(path)


PICTURES = {
    "a PNG image": b"\x89PNG\r\n\x1a\n" + bytes(40),
    "a JPEG image": b"\xff\xd8\xff\xe0\x00\x10JFIF" + bytes(40),
    "a BMP image": b"BM" + struct.pack("<IHHI", 100, 0, 0, 54) + bytes(40),
    "a TIFF image": b"II*\0" + bytes(40),
    "a WebP image": b"RIFF\x20\0\0\0WEBPVP8 " + bytes(20),
    "a PNM image": b"P6\n4 4\n255\n" + bytes(48),
    "an MP4 video": b"\0\0\0\x18ftypmp42" + bytes(40),
    "an AVI video": b"RIFF\x20\0\0\0AVI LIST" + bytes(20),
    "a Matroska video": b"\x1aE\xdf\xa3" + bytes(40),
}


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_in_place_of_a_calibration(name, tmp_path):
    path = tmp_path / "front.png"
    path.write_bytes(PICTURES[name])
    readers = (ipm_rs.Camera.from_ros, ipm_rs.Camera.from_opencv, ipm_rs.Camera.from_kitti, ipm_rs.Camera.from_nuscenes)
    for read in (ipm_rs.Camera.load, *readers):
        with refuses(errors.CalibrationError, str(path), name, "did you swap calibration and image?"):
            read(path)


def test_swapped_on_the_command_line(tmp_path):
    image = pytest.importorskip("PIL.Image")
    picture, camera = tmp_path / "front.png", tmp_path / "camera.json"
    image.new("RGB", (64, 48)).save(picture)
    ipm_rs.Camera([[60.0, 0, 31.5], [0, 60, 23.5], [0, 0, 1]], image_size=(64, 48)).save(camera)
    command = [sys.executable, "-m", "ipm_rs", "warp", str(picture), str(camera), "-o", str(tmp_path / "bev.png")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2 and "swap" in done.stderr and len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\x93NUMPY\x01\0v\0{'descr': '<f8'", "an .npy array without a name"),
        (b"\x80\x04\x95\x10\0\0\0\0\0\0\0}\x94.", "a pickle"),
        (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "a .mat file"),
        (b"\x1f\x8b\x08\0\0\0\0\0", "a gzip archive"),
        ("camera_matrix: 1".encode("utf-16"), "text in UTF-16"),
    ],
)
def test_other_files_are_named(data, said, tmp_path):
    path = tmp_path / "camera"
    path.write_bytes(data)
    with refuses(errors.CalibrationError, str(path), said, ";"):
        ipm_rs.Camera.load(path)


# ---------------------------------------------------------------------------------------------------------------------
# Large and hostile files


KEYS = ",".join(f'"k{i}":0' for i in range(500))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("log.txt", "P0: 7 2 3\n" * 3_200_000),
        ("list.json", "[" + "1," * 4_000_000 + "1]"),
        ("keys.json", "{" + ",".join(f'"k{i}":0' for i in range(2_000_000)) + "}"),
        ("near.json", "{" + ",".join(f'"k{i}":0' for i in range(480_000)) + "}"),
        ("nested.json", "{" + ",".join(f'"s{i}":{{{KEYS}}}' for i in range(500)) + "}"),
        ("listed.json", "[" + ",".join(f"{{{KEYS}}}" for i in range(500)) + "]"),
        ("keys.yaml", "".join(f"key{i}: 0\n" for i in range(400_000))),
        ("flow.yaml", "a: [" + "1," * 1_900_000 + "1]\n"),
        ("deep.json", '{"a":' * 100_000),
        ("deep.yaml", "- " * 100_000 + "a\n"),
        ("colmap.txt", "1 PINHOLE 640 480 500 500 320 240\n" * 600_000),
        ("long.yaml", "camera_matrix: " + "x" * 20_000_000),
    ],
)
def test_large_files_are_refused_in_time(name, text, tmp_path):
    path = tmp_path / name
    path.write_text(text)
    code = (
        "import resource, sys, time, ipm_rs\n"
        "from ipm_rs import errors\n"
        "import ipm_rs.calibration as c; [c.reader(f) for f in c.FORMATS]\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "start = time.process_time()\n"
        "try: ipm_rs.Camera.load(sys.argv[1])\n"
        "except errors.CalibrationError as error: assert len(str(error)) < 4000\n"
        "else: raise SystemExit('read')\n"
        "print(time.process_time() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    seconds, kilobytes = map(float, done.stdout.split())
    assert seconds < 4, f"{seconds} s"  # measured: 1.5 s on an idle machine
    assert kilobytes < 300_000


def test_the_largest_table_of_a_dataset_is_read(tmp_path):
    """As many sensors as nuScenes has in all its scenes: 10 MB, printed as the dataset prints it."""
    record = {"sensor_token": "s", "translation": [1.7, 0.0, 1.5], "rotation": [0.5, -0.5, 0.5, -0.5]}
    K = [[1266.4, 0.0, 816.2], [0.0, 1266.4, 491.5], [0.0, 0.0, 1.0]]
    table = [{"token": f"{i:032x}", **record, "camera_intrinsic": K} for i in range(12_000)]
    path = tmp_path / "calibrated_sensor.json"
    path.write_text(json.dumps(table, indent=2))
    camera = ipm_rs.Camera.load(path, camera=f"{11_999:032x}")
    assert camera.intrinsics[0, 0] == 1266.4


@pytest.mark.parametrize(
    "text",
    [
        '{"K": NaN, "D": [1]}', '{"K": [[Infinity]]}', '{"a": 1, "a": 2}', "K: [1, 2\0]\n", "K: &a [*a]\n",
        "a: 1\r\nK: 3\r\n", "\ufeffk: 0.04\n", "K: " + "9" * 5000 + "\n", '{"K": ' + "9" * 5000 + "}", "{{a}: 1}\n",
        "? [a]\n: 1\n", "!!python/object/apply:os.system [ls]\n", "%TAG ! tag:x,2000:\n---\n!a b\n", "- - - a\n",
        "---\n---\n",
        "<opencv_storage/>", "<opencv_storage><K type_id='opencv-matrix'/></opencv_storage>", '{"K": {"rows": 3}}',
    ],
)  # fmt: skip
def test_odd_texts_end_in_our_errors(text, tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_bytes(text.encode())
    for name in ("load", *(f"from_{name}" for name in calibration.FORMATS)):
        with pytest.raises(errors.IpmError):
            getattr(ipm_rs.Camera, name)(path)


def test_line_ends_and_byte_order_marks_are_no_content(tmp_path):
    text = "K: [[600, 0, 320], [0, 601, 240], [0, 0, 1]]\nD: [0.1, 0, 0, 0, 0]\nimage_size: [640, 480]\n"
    plain, odd = tmp_path / "a.yaml", tmp_path / "b.yaml"
    plain.write_text(text)
    odd.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert ipm_rs.Camera.load(odd) == ipm_rs.Camera.load(plain)


def test_without_pyyaml(tmp_path, monkeypatch):
    """Formats that need no YAML are recognised as before; a file of keys asks for the extra, others do not."""
    monkeypatch.setitem(sys.modules, "yaml", None)
    for name in ("kitti object", "kitti-360 fisheye", "nuscenes record", "ros ini", "colmap", "opencv stereo", "json"):
        assert calibration.recognise(SAMPLES[name].write(tmp_path)) == SAMPLES[name].format
    with refuses(errors.MissingExtraError, 'pip install "ipm-rs[yaml]"'):
        ipm_rs.Camera.load(SAMPLES["kalibr"].write(tmp_path))
    path = tmp_path / "notes.txt"
    path.write_text("nothing of the kind\n")
    with refuses(errors.CalibrationError, "got one of none"):
        ipm_rs.Camera.load(path)
