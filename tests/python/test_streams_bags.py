"""Bags that rosbags wrote: pixels of every encoding, timestamps, calibration and poses, and what is wrong with them."""

from __future__ import annotations

import io
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers import refuses, textured
from PIL import Image

import ipm_rs
from ipm_rs import errors, streams
from ipm_rs.cli import main

pytest.importorskip("rosbags")
from bags import KINDS, Bag

K = [[55.0, 0, 31.2], [0, 55, 23.6], [0, 0, 1]]
POSE = {"position": (1.0, 0.2, 1.5), "pitch": 0.3}
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(64, 48), **POSE)
GRID = ["--x", "2", "14", "--y", "-5", "5", "--resolution", "0.25", "0.5"]
LUT = ipm_rs.Lut(CAMERA, ipm_rs.BevGrid(x=(2, 14), y=(-5, 5), resolution=(0.25, 0.5)))
START = 1_700_000_000.25


def quaternion(R: np.ndarray) -> np.ndarray:
    vector = cv2.Rodrigues(np.asarray(R))[0].ravel()
    angle = np.linalg.norm(vector)
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) / (angle or 1) * vector)])


def write(path: Path, kind: str, count: int = 3, poses: bool = True) -> Path:
    """A drive of two cameras and a string, with calibration and tf."""
    with Bag(path, kind) as bag:
        mount = CAMERA.vehicle_from_camera
        bag.tf([("base_link", "cam", mount[:3, 3], quaternion(mount[:3, :3]))], START - 1, static=True)
        bag.text("/chatter", START - 1)
        for k in range(count):
            stamp = START + 0.1 * k
            bag.info("/front/camera_info", K, (64, 48), stamp)
            bag.image("/front/image_raw", textured(48, 64, 3, seed=k), "rgb8", stamp, logged=stamp + 0.02)
            bag.image("/rear/image_raw", textured(10, 20, seed=k), "mono8", stamp, frame="rear")
            if poses:
                turn = (np.cos(0.05 * k), 0, 0, np.sin(0.05 * k))
                bag.tf([("odom", "base_link", (k, 0, 0), turn)], stamp - 0.05)
                bag.tf([("map", "odom", (10, 5, 0), (1, 0, 0, 0))], stamp - 0.05)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_has_its_frames_its_camera_and_its_poses(tmp_path, kind):
    path = write(tmp_path / f"run.{kind}" if kind == "bag" else tmp_path / "run", kind)
    stream = streams.open(path, topic="/front/image_raw")
    frames = list(stream)
    assert [frame.name for frame in frames] == ["000000", "000001", "000002"] and stream.count == 3
    assert stream.size == (64, 48) and 5 < stream.rate < 50
    for k, frame in enumerate(frames):
        assert np.array_equal(frame.image, textured(48, 64, 3, seed=k))
        assert frame.timestamp == pytest.approx(START + 0.1 * k, abs=1e-6)
    camera = frames[0].camera
    assert camera == stream.camera and camera.image_size == (64, 48) and np.array_equal(camera.intrinsics, K)
    assert np.abs(camera.vehicle_from_camera - CAMERA.vehicle_from_camera).max() < 1e-9
    # tf comes 50 ms before each picture: in the middle between the first two, and none after the last
    assert np.allclose(frames[0].map_from_vehicle[:3, 3], [10.5, 5, 0]) and frames[2].map_from_vehicle is None
    assert np.allclose(frames[0].map_from_vehicle[:3, :3], ipm_rs.rotation_from_euler(0, 0, 0.05))
    odom = next(iter(streams.open(path, topic="front/image_raw", map_frame="/odom")))
    assert np.allclose(odom.map_from_vehicle[:3, 3], [0.5, 0, 0])
    assert [f.name for f in streams.open(path, topic="/front/image_raw", start=0.05, end=0.15)] == ["000001"]
    logged = next(iter(streams.open(path, topic="/front/image_raw", clock="log")))
    assert logged.timestamp == pytest.approx(START + 0.02, abs=1e-6)
    with refuses(errors.ArgumentError, "/front/image_raw (3), /rear/image_raw (3)", "--topic"):
        streams.open(path)
    for topic, phrase in (("/side", "'/side'"), ("/chatter", "std_msgs/msg/String")):
        with refuses(errors.ArgumentError, phrase, "/front/image_raw (3)"):
            streams.open(path, topic=topic)
    with refuses(errors.ArgumentError, "map_frame", "base_link, cam, map, odom"):
        list(streams.open(path, topic="/front/image_raw", map_frame="earth"))
    with refuses(errors.ArgumentError, "camera_info", "/front/camera_info"):
        streams.open(path, topic="/front/image_raw", camera_info="/none")


def test_a_pose_of_the_very_moment_of_a_picture(tmp_path):
    """Also the last one of all: equal stamps are equal seconds."""
    with Bag(tmp_path / "run.bag", "bag") as bag:
        for k in range(20):
            bag.tf([("map", "base_link", (k, 0, 0), (1, 0, 0, 0))], 10 + 0.1 * k)
            bag.image("/image", textured(4, 4), "mono8", 10 + 0.1 * k)
    poses = [frame.map_from_vehicle for frame in streams.open(tmp_path / "run.bag")]
    assert [pose[0, 3] for pose in poses] == list(range(20))


def test_the_file_of_a_bag_alone_and_without_metadata(tmp_path):
    for kind in ("mcap", "db3"):
        path = write(tmp_path / kind, kind, count=2)
        (file,) = path.glob(f"*.{kind}")
        assert len(list(streams.open(file, topic="/rear/image_raw"))) == 2
        (path / "metadata.yaml").unlink()
        assert len(list(streams.open(path, topic="/rear/image_raw"))) == 2
        shutil.copy(file, path / f"second.{kind}")
        with refuses(errors.FileError, "metadata.yaml", "ros2 bag reindex"):
            streams.open(path, topic="/rear/image_raw")


def one(tmp_path: Path, pixels, encoding: str, **options):
    with Bag(tmp_path / "one.bag", "bag") as bag:
        bag.image("/image", pixels, encoding, 5.0, **options)
    stream = streams.open(tmp_path / "one.bag")
    return next(iter(stream)).image


GREY, RGB, RGBA = textured(12, 16), textured(12, 16, 3), textured(12, 16, 4)
DEEP, METRES = textured(12, 16, dtype="uint16"), textured(12, 16, dtype="float32")


@pytest.mark.parametrize(
    ("encoding", "stored", "expected"),
    [
        ("mono8", GREY, GREY),
        ("8UC1", GREY, GREY),
        ("mono16", DEEP, DEEP),
        ("16UC1", DEEP, DEEP),
        ("16SC1", DEEP.view("i2"), DEEP.view("i2")),
        ("32FC1", METRES, METRES),
        ("64FC1", METRES.astype("f8"), METRES.astype("f8")),
        ("rgb8", RGB, RGB),
        ("bgr8", RGB[..., ::-1], RGB),
        ("rgba8", RGBA, RGBA),
        ("bgra8", RGBA[..., [2, 1, 0, 3]], RGBA),
        ("rgb16", textured(12, 16, 3, "uint16"), textured(12, 16, 3, "uint16")),
    ],
)
def test_encodings_that_store_the_pixels(tmp_path, encoding, stored, expected):
    for number, options in enumerate(({}, {"padding": 7}, {"big": True, "padding": 2})):
        (tmp_path / str(number)).mkdir()
        found = one(tmp_path / str(number), stored, encoding, **options)
        assert found.dtype == expected.dtype and np.array_equal(found, expected), options


@pytest.mark.parametrize(("tile", "theirs"), [("rggb", "BG"), ("bggr", "RG"), ("gbrg", "GR"), ("grbg", "GB")])
@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_bayer_tiles_are_as_opencv_has_them(tmp_path, tile, theirs, dtype):
    for number, size in enumerate(((12, 16), (11, 17))):
        raw = textured(*size, dtype=dtype)
        (tmp_path / str(number)).mkdir()
        found = one(tmp_path / str(number), raw, f"bayer_{tile}{8 * raw.itemsize}")
        expected = cv2.cvtColor(raw, getattr(cv2, f"COLOR_Bayer{theirs}2RGB"))
        inside = np.s_[1:-1, 1:-1]  # the border is each program's own
        assert np.abs(found[inside].astype(int) - expected[inside]).max() <= 1
        for y, x in ((0, 0), (0, 1), (1, 0), (1, 1)):  # a colour that the sensor saw is kept
            assert np.array_equal(found[y::2, x::2, "rgb".index(tile[2 * y + x])], raw[y::2, x::2])


@pytest.mark.parametrize(
    ("encoding", "theirs"), [("yuv422", "UYVY"), ("uyvy", "UYVY"), ("yuv422_yuy2", "YUY2"), ("yuyv", "YUY2")]
)
def test_yuv_is_as_opencv_has_it(tmp_path, encoding, theirs):
    stored = textured(12, 16, 2)
    found = one(tmp_path, stored, encoding)
    expected = cv2.cvtColor(stored, getattr(cv2, f"COLOR_YUV2RGB_{theirs}"))
    assert np.abs(found.astype(int) - expected).max() <= 1


@pytest.mark.parametrize("encoding", ["nv12", "nv21"])
def test_planes_of_luma_and_chroma_are_as_opencv_has_them(tmp_path, encoding):
    stored = textured(18, 16)  # 12 rows of luma, 6 of chroma
    expected = cv2.cvtColor(stored, getattr(cv2, f"COLOR_YUV2RGB_{encoding.upper()}"))
    for number, padding in enumerate((0, 5)):
        (tmp_path / str(number)).mkdir()
        found = one(tmp_path / str(number), stored, encoding, height=12, padding=padding)
        assert found.shape == (12, 16, 3) and np.abs(found.astype(int) - expected).max() <= 1


@pytest.mark.parametrize(("encoding", "order"), [("nv24", 1), ("nv42", -1)])
def test_chroma_for_every_pixel(tmp_path, encoding, order):
    luma, chroma = textured(12, 16), textured(12, 16, 2)
    stored = np.concatenate([luma, chroma.reshape(24, 16)])
    u, v = np.moveaxis(chroma[..., ::order], -1, 0)
    pairs = np.stack([luma, u, luma, v], -1).reshape(12, 32, 2)  # each pixel twice, as YUYV has two of one chroma
    expected = cv2.cvtColor(pairs, cv2.COLOR_YUV2RGB_YUY2)[:, ::2]
    assert np.abs(one(tmp_path, stored, encoding, height=12).astype(int) - expected).max() <= 1


def packed(pixels, form) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, form, **({"quality": 95} if form == "JPEG" else {}))
    return buffer.getvalue()


def rvl(depths: np.ndarray) -> bytes:
    """What the paper's encoder makes: numbers in groups of three bits, nibbles in words from the highest on."""
    nibbles: list[int] = []

    def put(number: int) -> None:
        while True:
            group, number = number & 7, number >> 3
            nibbles.append(group | (8 if number else 0))
            if not number:
                return

    flat, place, before = depths.ravel().astype(int), 0, 0
    while place < len(flat):
        zeros = next((k for k, depth in enumerate(flat[place:]) if depth), len(flat) - place)
        place += zeros
        others = next((k for k, depth in enumerate(flat[place:]) if not depth), len(flat) - place)
        put(zeros)
        put(others)
        for depth in flat[place : place + others]:
            put(2 * (depth - before) if depth >= before else 2 * (before - depth) - 1)
            before = depth
        place += others
    words = [int("".join(f"{n:x}" for n in (nibbles[k : k + 8] + [0] * 8)[:8]), 16) for k in range(0, len(nibbles), 8)]
    return np.array([*depths.shape[::-1]], "<i4").tobytes() + np.array(words, "<u4").tobytes()


@pytest.mark.parametrize("form", ["png", "rvl", ""])
def test_depth_of_the_transport_for_depth(tmp_path, form):
    depths = np.where(textured(12, 16) < 90, 0, DEEP).astype(np.uint16)
    pack = rvl if form == "rvl" else lambda stored: packed(stored, "PNG")
    metres = np.linspace(0.4, 9, 12 * 16, dtype=np.float32).reshape(12, 16)
    a, b = 100.0 * 101, 100.0 / 10 + 1 - 100.0 * 101 / 100  # whatever: the two are the message's own
    stored = np.where(textured(12, 16) < 90, 0, np.rint(a / metres + b)).astype(np.uint16)
    with Bag(tmp_path / "run.bag", "bag") as bag:
        head = np.array([0], "<i4").tobytes()
        bag.compressed("/raw", head + bytes(8) + pack(depths), f"16UC1; compressedDepth {form}".strip(), 1.0)
        parameters = np.array([a, b], "<f4").tobytes()
        bag.compressed("/metres", head + parameters + pack(stored), f"32FC1; compressedDepth {form}".strip(), 1.0)
        for k, data in enumerate((head + bytes(8) + pack(depths)[:60], head + bytes(8), b"", b"1" * 80)):
            bag.compressed(f"/short{k}", data, f"16UC1; compressedDepth {form}", 1.0)
    raw = next(iter(streams.open(tmp_path / "run.bag", topic="/raw"))).image
    assert raw.dtype == np.uint16 and np.array_equal(raw, depths)
    found = next(iter(streams.open(tmp_path / "run.bag", topic="/metres"))).image
    assert found.dtype == np.float32 and np.array_equal(np.isnan(found), stored == 0)
    assert np.nanmax(np.abs(found - metres)) < 0.01
    for k in range(4):
        with refuses((errors.ImageError, errors.FileError), f"/short{k}"):
            streams.open(tmp_path / "run.bag", topic=f"/short{k}")


def test_compressed_pictures(tmp_path):
    smooth = np.add.outer(np.arange(48), np.arange(64)).astype(np.uint8)
    with Bag(tmp_path / "run", "mcap") as bag:
        bag.compressed("/png/compressed", packed(RGB, "PNG"), "bgr8; png compressed bgr8", 1.0)
        bag.compressed("/deep/compressed", packed(DEEP, "PNG"), "16UC1; png compressed", 1.0)
        bag.compressed("/jpeg/compressed", packed(smooth, "JPEG"), "jpeg", 1.0)
        bag.compressed("/bayer/compressed", packed(GREY, "PNG"), "bayer_rggb8; png compressed ", 1.0)
        bag.compressed("/depth/compressedDepth", b"0" * 40, "8UC3; compressedDepth", 1.0)
        bag.info("/jpeg/camera_info", K, (64, 48), 1.0)
        for k, data in enumerate((packed(GREY, "PNG"), packed(GREY, "PNG")[:60], packed(GREY, "PNG"))):
            bag.compressed("/some/compressed", data, "png", 1.0 + k)
    path = tmp_path / "run"
    assert np.array_equal(next(iter(streams.open(path, topic="/png/compressed"))).image, RGB)
    assert np.array_equal(next(iter(streams.open(path, topic="/deep/compressed"))).image, DEEP)
    frame = next(iter(streams.open(path, topic="/jpeg/compressed")))
    assert np.abs(frame.image.astype(int) - smooth).max() <= 4 and frame.camera is not None
    colours = next(iter(streams.open(path, topic="/bayer/compressed"))).image
    assert colours.shape == (12, 16, 3) and np.array_equal(colours[::2, ::2, 0], GREY[::2, ::2])
    with refuses(errors.ImageError, "8UC3; compressedDepth"):
        streams.open(path, topic="/depth/compressedDepth")
    table = ipm_rs.Lut.from_maps(np.zeros((2, 2)), np.zeros((2, 2)), source_size=(16, 12))
    summary = streams.warp(streams.open(path, topic="/some/compressed"), table, tmp_path / "out")
    assert summary.done == 2 and "frame 1 of /some/compressed" in str(summary.failed[0])


def test_what_is_wrong_with_a_frame_is_told_of_it_alone(tmp_path):
    with Bag(tmp_path / "run.bag", "bag") as bag:
        for k, (stamp, pixels) in enumerate(
            [(1.0, GREY), (1.5, GREY), (1.2, GREY), (1.7, textured(4, 4)), (1.8, GREY[:, :5]), (1.9, GREY)]
        ):
            size = (16, 12) if k == 4 else None  # fewer bytes than its size promises
            bag.image("/image", pixels, "mono8", stamp, size=size, logged=1.0 + k)
    table = ipm_rs.Lut.from_maps(np.zeros((2, 2)), np.zeros((2, 2)), source_size=(16, 12))
    summary = streams.warp(streams.open(tmp_path / "run.bag"), table, tmp_path / "out")
    assert summary.done == 3 and len(summary.failed) == 3
    for failed, phrases in zip(
        summary.failed,
        (("frame 2", "1.2", "after 1.5", "clock"), ("000003", "4x4"), ("frame 4", "cut short")),
        strict=True,
    ):
        assert all(phrase in str(failed) for phrase in phrases), failed


def test_encodings_and_arguments_that_are_unknown(tmp_path):
    for encoding in ("h264", "8UC3", "bayer_rggb12"):
        with Bag(tmp_path / f"{encoding}.bag", "bag") as bag:
            bag.image("/image", GREY, encoding, 1.0)
        with refuses(errors.ImageError, encoding, "bayer_rggb8"):
            streams.open(tmp_path / f"{encoding}.bag")
    with Bag(tmp_path / "odd.bag", "bag") as bag:
        bag.image("/image", textured(4, 5, 2), "yuyv", 1.0)
    for name, rows, phrase in (("odd", 5, "even width and height"), ("short", 8, "cut short")):
        with Bag(tmp_path / f"{name}_nv12.bag", "bag") as bag:
            bag.image("/image", textured(9, 16), "nv12", 1.0, height=rows)
        with refuses(errors.ImageError, phrase):
            streams.open(tmp_path / f"{name}_nv12.bag")
    with refuses(errors.ImageError, "even width"):
        streams.open(tmp_path / "odd.bag")
    for options, error in (
        ({"topic": 3}, errors.ArgumentTypeError),
        ({"vehicle_frame": 3}, errors.ArgumentTypeError),
        ({"clock": "wall"}, errors.ArgumentError),
    ):
        with refuses(error, next(iter(options))):
            streams.open(tmp_path / "odd.bag", **options)


@pytest.mark.parametrize("kind", KINDS)
def test_bags_that_are_cut_short_or_none(tmp_path, kind):
    path = write(tmp_path / "run.bag" if kind == "bag" else tmp_path / "run", kind)
    file = path if kind == "bag" else next(path.glob(f"*.{kind}"))
    data = file.read_bytes()
    for number, content in enumerate((data[: len(data) // 2], b"no bag at all", b"")):
        other = tmp_path / f"{number}.{kind}"
        other.write_bytes(content)
        with refuses(errors.FileError, other.name):
            list(streams.open(other, topic="/front/image_raw"))
    with refuses(errors.MissingFileError, "none"):
        streams.open(tmp_path / f"none.{kind}")
    with Bag(tmp_path / f"text.{kind}", kind) as bag:
        bag.text("/chatter", 1.0)
    with refuses(errors.FileError, "a topic of images", "/chatter"):
        streams.open(tmp_path / f"text.{kind}")


@pytest.mark.parametrize("kind", KINDS)
def test_the_command_takes_bags(tmp_path, kind, capsys):
    path = write(tmp_path / "run.bag" if kind == "bag" else tmp_path / "run", kind)
    CAMERA.save(tmp_path / "camera.json")
    run = ["warp", str(tmp_path / "camera.json"), str(path), *GRID]
    out = tmp_path / "bevs"
    assert main([*run, "-o", str(out), "--topic", "/front/image_raw"]) == 0
    assert "3 frames" in capsys.readouterr().out
    for k in range(3):
        assert np.array_equal(np.asarray(Image.open(out / f"00000{k}_bev.png")), LUT.warp(textured(48, 64, 3, seed=k)))
    # the bag's own calibration and tf
    assert main(["warp", str(path), str(path), "--topic", "/front/image_raw", "-o", str(tmp_path / "own"), *GRID]) == 0
    assert sorted(p.name for p in (tmp_path / "own").iterdir()) == sorted(p.name for p in out.iterdir())
    own = np.asarray(Image.open(tmp_path / "own" / "000001_bev.png")).astype(int)
    assert np.abs(own - LUT.warp(textured(48, 64, 3, seed=1))).max() <= 1
    capsys.readouterr()
    for arguments, phrase in (
        ([], "--topic"),
        (["--topic", "/none"], "/rear/image_raw (3)"),
        (["--topic", "/rear/image_raw"], "20x10"),
    ):
        assert main([*run, *arguments, "-o", str(tmp_path / "x")]) == 2
        assert phrase in capsys.readouterr().err and not (tmp_path / "x").exists()
