"""The command line: what it writes is what the library computes, and every mistake is refused before any work."""

from __future__ import annotations

import errno
import io
import json
import os
import re
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import cv2
import numpy as np
import pytest
from calibration_samples import SAMPLES
from golden import CALIBRATION
from helpers import textured
from PIL import Image

import ipm_rs
from ipm_rs import cli
from ipm_rs.files import images

WIDTH, HEIGHT = 128, 64
SIZE = ["--image-size", str(WIDTH), str(HEIGHT)]
COARSE = ["--resolution", "0.5"]
GRID = {"x": (7, 50), "y": (-10, 10), "resolution": 0.5}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Current directory with ``camera.json``, of 128 x 64 pixels, and ``frame.png``, RGB."""
    monkeypatch.chdir(tmp_path)
    intrinsic = CALIBRATION["intrinsic"]
    small = {key: intrinsic[key] / 16 for key in ("fx", "fy")}
    small |= {key: (intrinsic[key] + 0.5) / 16 - 0.5 for key in ("u0", "v0")}
    Path("camera.json").write_text(json.dumps(CALIBRATION | {"intrinsic": small}))
    Image.fromarray(textured(HEIGHT, WIDTH, 3)).save("frame.png")
    return tmp_path


@pytest.fixture
def warp(here: Path) -> Callable[..., int]:
    """``ipm-rs warp camera.json ... --image-size 128 64 --resolution 0.5``."""
    return lambda *arguments: cli.main(["warp", "camera.json", *arguments, *SIZE, *COARSE])


def camera() -> ipm_rs.Camera:
    return ipm_rs.Camera.from_cityscapes("camera.json", image_size=(WIDTH, HEIGHT))


def lut(**grid: object) -> ipm_rs.Lut:
    return ipm_rs.Lut(camera(), ipm_rs.BevGrid(**(GRID | grid)))


def load(name: str | Path) -> np.ndarray:
    with Image.open(name) as image:
        return np.asarray(image)


def snapshot(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() if path.is_file() else b"" for path in sorted(folder.rglob("*"))}


def png(width: int, height: int, kind: int, rows: bytes = b"", palette: list[int] | None = None) -> bytes:
    """PNG of 8 bits per sample, of colour type ``kind``; its pixels may be missing and its palette too short."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0))
    colours = b"" if palette is None else chunk(b"PLTE", bytes(palette))
    return b"\x89PNG\r\n\x1a\n" + header + colours + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


# ---------------------------------------------------------------------------------------------------------------------
# What is written


MODES = {
    "L": (textured(HEIGHT, WIDTH), ".png .tif .bmp"),
    "LA": (textured(HEIGHT, WIDTH, 2), ".png .tif"),
    "RGB": (textured(HEIGHT, WIDTH, 3), ".png .tiff .bmp"),
    "RGBA": (textured(HEIGHT, WIDTH, 4), ".png .tif"),
    "I;16": (textured(HEIGHT, WIDTH, dtype="uint16"), ".png .tif"),
    "F": (textured(HEIGHT, WIDTH, dtype="float32"), ".tif"),
    "1": (textured(HEIGHT, WIDTH, dtype="bool"), ".png .tif .bmp"),
}


@pytest.mark.parametrize(
    ("mode", "extension", "interpolation"),
    [
        (mode, extension, interpolation)
        for mode, (_, extensions) in MODES.items()
        for extension in extensions.split()
        for interpolation in ("bilinear", "nearest")
        if (mode, interpolation) != ("1", "bilinear")
    ],
)
def test_pixels_are_those_of_the_library(
    warp: Callable[..., int], mode: str, extension: str, interpolation: str
) -> None:
    source = "in.tif" if mode == "F" else "in.png"
    pixels = MODES[mode][0]
    Image.fromarray(pixels).save(source)
    assert warp(source, "-o", f"bev{extension}", "--interpolation", interpolation) == 0
    with Image.open(f"bev{extension}") as image:
        assert image.mode == mode or (image.mode, mode) == ("I", "I;16"), "older Pillow reads 16-bit PNG as I"
        written = np.asarray(image)
    if mode == "I;16":
        assert cv2.imread(f"bev{extension}", cv2.IMREAD_UNCHANGED).dtype == np.uint16
    assert np.array_equal(written, lut().warp(pixels, interpolation=interpolation))


def test_options_reach_the_library(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    grid = ["--x", "6.5", "20.5", "--y", "-4", "8", "--resolution", "0.25", "0.5", "--sample-at", "corner"]
    pixels = ["--interpolation", "nearest", "--border-value", "1", "2", "3", "--ground", "-0.3", "--threads", "3"]
    arguments = ["warp", "camera.json", "frame.png", "-o", "bev.png", "--mask", "mask.png", *SIZE, *grid, *pixels]
    assert cli.main(arguments) == 0
    cells = ipm_rs.BevGrid(x=(6.5, 20.5), y=(-4, 8), resolution=(0.25, 0.5), sample_at="corner")
    table = ipm_rs.Lut(camera(), cells, ground=-0.3)
    expected = table.warp(load("frame.png"), interpolation="nearest", border_value=(1, 2, 3))
    assert np.array_equal(load("bev.png"), expected)
    assert np.array_equal(load("mask.png"), np.where(table.mask, 255, 0))
    assert load("mask.png").dtype == np.uint8
    first, second = capsys.readouterr().out.splitlines()
    percent = f"{100 * table.mask.mean():.1f}"
    assert re.fullmatch(rf"bev\.png  24 x 56  {re.escape(percent)} % valid  \d+\.\d\d ms", first)
    assert second == "mask.png  24 x 56  mask"


def test_defaults_suit_a_car(here: Path) -> None:
    assert cli.main(["warp", "camera.json", "frame.png", "-o", "bev.png", *SIZE]) == 0
    assert np.array_equal(load("bev.png"), lut(resolution=0.05).warp(load("frame.png")))


def test_real_image_on_the_documents_grid(shared_data: Path, tmp_path: Path, seed_lut: ipm_rs.Lut) -> None:
    folder, out = shared_data / "cityscapes", tmp_path / "bev.png"
    (image,) = folder.glob("*_leftImg8bit.png")
    grid = "--x 7 50 --y -10 10 --resolution 0.05 0.025 --sample-at corner".split()
    assert cli.main(["warp", str(folder / "camera.json"), str(image), "-o", str(out), *grid]) == 0
    written = load(out)
    assert written.shape == (860, 800, 3)
    assert np.array_equal(written, seed_lut.warp(load(image)))


@pytest.mark.parametrize("extension", [".png", ".tif", ".bmp"])
def test_label_image_keeps_ids_and_palette(warp: Callable[..., int], extension: str) -> None:
    """The palette has 5 colours and the ids go to 255, as where 255 is `ignore`."""
    ids = np.random.default_rng(5).choice(np.array([0, 1, 2, 4, 255], np.uint8), (HEIGHT, WIDTH))
    palette = [0, 0, 0, 128, 64, 128, 244, 35, 232, 70, 70, 70, 102, 102, 156]
    rows = b"".join(b"\0" + row.tobytes() for row in ids)
    Path("labels.png").write_bytes(png(WIDTH, HEIGHT, 3, rows, palette))  # Pillow cannot write such a file
    assert warp("labels.png", "-o", f"bev{extension}", "--interpolation", "nearest", "--border-value", "255") == 0
    with Image.open(f"bev{extension}") as image:
        assert image.mode == "P"
        assert image.getpalette("RGB")[: len(palette)] == palette
        written = np.asarray(image)
    expected = lut().warp(ids, interpolation="nearest", border_value=255)
    assert np.array_equal(written, expected)
    assert set(np.unique(written)) <= {0, 1, 2, 4, 255}


def test_label_image_of_few_ids_keeps_its_transparency(warp: Callable[..., int]) -> None:
    ids = textured(HEIGHT, WIDTH) % 3
    labels = Image.fromarray(ids)
    labels.putpalette([10, 20, 30, 40, 50, 60, 70, 80, 90])
    labels.save("labels.png", transparency=1)
    assert warp("labels.png", "-o", "bev.png", "--interpolation", "nearest") == 0
    with Image.open("bev.png") as image:
        assert image.info["transparency"] == 1
        assert np.array_equal(np.asarray(image), lut().warp(ids, interpolation="nearest"))


def test_jpeg_is_read_and_written(warp: Callable[..., int]) -> None:
    smooth = cv2.GaussianBlur(textured(HEIGHT, WIDTH, 3), (0, 0), 6)
    Image.fromarray(smooth).save("in.jpg", quality=95)
    assert warp("in.jpg", "-o", "bev.jpg") == 0
    assert warp("in.jpg", "-o", "bev.png") == 0
    exact = lut().warp(load("in.jpg"))
    assert np.array_equal(load("bev.png"), exact)
    assert np.abs(load("bev.jpg").astype(int) - exact).mean() < 6


def test_exif_orientation_is_not_applied(warp: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(textured(HEIGHT, WIDTH, 3)).save("in.png", exif=exif)
    assert warp("in.png", "-o", "bev.png") == 0
    assert np.array_equal(load("bev.png"), lut().warp(textured(HEIGHT, WIDTH, 3)))
    assert "EXIF orientation 6 is not applied" in capsys.readouterr().err
    with Image.open("bev.png") as image:
        assert 0x0112 not in image.getexif()


def test_first_of_several_frames_is_used(warp: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    frames = [Image.fromarray(textured(HEIGHT, WIDTH, 3, seed=seed)) for seed in range(3)]
    frames[0].save("in.tif", save_all=True, append_images=frames[1:])
    assert warp("in.tif", "-o", "bev.png") == 0
    assert np.array_equal(load("bev.png"), lut().warp(np.asarray(frames[0])))
    assert "the first of 3 frames is used" in capsys.readouterr().err


# ---------------------------------------------------------------------------------------------------------------------
# Several images


def test_several_images_share_one_table(
    warp: Callable[..., int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Image.fromarray(textured(HEIGHT, WIDTH, seed=2)).save("grey.jpg")
    Image.fromarray(textured(HEIGHT, WIDTH, dtype="float32")).save("depth.tif")
    names = {"frame_bev.png": "frame.png", "grey_bev.png": "grey.jpg", "depth_bev.tif": "depth.tif"}
    expected = {f"out/{name}": lut().warp(load(source)) for name, source in names.items()}
    original, built = ipm_rs.Lut, []

    def counted(*arguments: object, **options: object) -> ipm_rs.Lut:
        built.append(arguments)
        return original(*arguments, **options)

    counted.from_maps = original.from_maps
    monkeypatch.setattr(ipm_rs, "Lut", counted)
    assert warp("frame.png", "grey.jpg", "depth.tif", "-o", "out/") == 0
    assert len(built) == 1
    assert sorted(str(path) for path in Path("out").iterdir()) == sorted(expected)
    for name, pixels in expected.items():
        assert np.array_equal(load(name), pixels)
    captured = capsys.readouterr()
    assert [line.split()[0] for line in captured.out.splitlines()] == list(expected)
    assert captured.err == "", "no bar where stderr is no terminal"


@pytest.mark.parametrize("out", ["out", "out/", "new/", "new/deeper/"])
def test_one_image_into_a_directory(warp: Callable[..., int], out: str) -> None:
    Path("out").mkdir()
    assert warp("frame.png", "-o", out) == 0
    assert Path(out, "frame_bev.png").is_file()


def test_a_damaged_image_does_not_stop_the_others(warp: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    data = Path("frame.png").read_bytes()
    Path("cut.png").write_bytes(data[: len(data) // 2])
    Path("last.png").write_bytes(data)
    assert warp("frame.png", "cut.png", "last.png", "-o", "out/", "--mask", "mask.png") == 2
    assert {path.name for path in Path("out").iterdir()} == {"frame_bev.png", "last_bev.png"}
    assert Path("mask.png").is_file()
    first, last = capsys.readouterr().err.splitlines()
    assert first.startswith("ipm-rs: error: cut.png: ")
    assert last.startswith("ipm-rs: error: 1 of 3 images could not be read")


def test_bar_on_a_terminal_leaves_the_lines_whole(warp: Callable[..., int], monkeypatch: pytest.MonkeyPatch) -> None:
    Path("last.png").write_bytes(Path("frame.png").read_bytes())
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setattr(sys, "stderr", terminal)
    assert warp("frame.png", "last.png", "-o", "out/") == 0
    shown = [line.rsplit("\r", 1)[-1] for line in terminal.getvalue().split("\n")]
    assert [line.split()[0] for line in shown[:2]] == ["out/frame_bev.png", "out/last_bev.png"]
    assert "2/2" in shown[2]
    terminal.truncate(0)
    assert warp("frame.png", "last.png", "-o", "out/", "--force", "--quiet") == 0
    assert terminal.getvalue() == ""


# ---------------------------------------------------------------------------------------------------------------------
# Whole or not at all


def fail_after_a_few_bytes(failure: BaseException) -> Callable[..., None]:
    def save(image: Image.Image, file: object, *_: object, **__: object) -> None:
        file.write(b"\x89PNG half a")
        raise failure

    return save


@pytest.mark.parametrize(
    ("failure", "status", "message"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), 2, "bev.png: expected to write it, got: No space left"),
        (ValueError("encoder error"), 2, "encoder error"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (MemoryError(), 2, "memory"),
    ],
)
@pytest.mark.parametrize("existing", [False, True])
def test_a_failure_while_writing_leaves_nothing(
    warp: Callable[..., int],
    here: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    failure: BaseException,
    status: int,
    message: str,
    existing: bool,
) -> None:
    if existing:
        Path("bev.png").write_bytes(b"precious")
    before = snapshot(here)
    monkeypatch.setattr(Image.Image, "save", fail_after_a_few_bytes(failure))
    assert warp("frame.png", "-o", "bev.png", "--force") == status
    assert snapshot(here) == before
    assert message in capsys.readouterr().err


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX permissions")
@pytest.mark.parametrize("umask", [0o022, 0o027, 0o077])
def test_permissions_are_those_of_any_new_file(warp: Callable[..., int], umask: int) -> None:
    Path("bev.png").write_bytes(b"old")
    Path("bev.png").chmod(0o600)
    before = os.umask(umask)
    try:
        assert warp("frame.png", "-o", "bev.png", "--force") == 0
    finally:
        os.umask(before)
    assert Path("bev.png").stat().st_mode & 0o777 == 0o666 & ~umask


@pytest.mark.skipif(os.name != "posix", reason="needs symbolic links")
def test_a_link_keeps_pointing_to_the_new_file(warp: Callable[..., int]) -> None:
    Path("real.png").write_bytes(b"old")
    Path("bev.png").symlink_to("real.png")
    assert warp("frame.png", "-o", "bev.png") == 2
    assert warp("frame.png", "-o", "bev.png", "--force") == 0
    assert Path("bev.png").is_symlink()
    assert np.array_equal(load("real.png"), lut().warp(load("frame.png")))


# ---------------------------------------------------------------------------------------------------------------------
# Refusals


def prepare(here: Path) -> None:
    """All the files that the refusals below name."""
    rgb = Image.fromarray(textured(HEIGHT, WIDTH, 3))
    labels = Image.fromarray(textured(HEIGHT, WIDTH) % 4)
    labels.putpalette(list(range(12)))
    labels.save("labels.png")
    Path("sub").mkdir()
    rgb.save("sub/frame.png")
    rgb.save("frame_bev.png")
    Image.fromarray(textured(HEIGHT, WIDTH, 4)).save("alpha.png")
    Image.fromarray(textured(HEIGHT, WIDTH, dtype="uint16")).save("deep.png")
    Image.fromarray(textured(HEIGHT, WIDTH, dtype="float32")).save("float.tif")
    Image.fromarray(textured(HEIGHT, WIDTH, dtype="int32")).save("int.tif")
    Image.fromarray(textured(HEIGHT, WIDTH, dtype="bool")).save("bits.png")
    rgb.convert("CMYK").save("cmyk.tif")
    rgb.convert("LAB").save("lab.tif")
    rgb.save("turned.tif", tiffinfo={0x0112: 6})
    cv2.imwrite("deep_colour.png", textured(HEIGHT, WIDTH, 3, dtype="uint16"))
    Image.fromarray(textured(32, 64, 3)).save("half.png")
    Path("existing.png").write_bytes(b"precious")
    Path("text.png").write_text("no image")
    Path("empty.png").touch()
    data = Path("frame.png").read_bytes()
    Path("cut.png").write_bytes(data[: len(data) // 2])
    Path("broken.png").write_bytes(data[:200] + bytes(50) + data[250:])
    Path("bomb.png").write_bytes(png(60_000, 60_000, 2))
    Path("large.png").write_bytes(png(12_000, 10_000, 2))
    Path("nan.json").write_text(Path("camera.json").read_text().replace('"pitch": 0', '"pitch": NaN, "old": 0'))


REFUSALS = [
    # what, arguments after `warp`, phrases of the message
    ("no calibration", "missing.json frame.png -o o.png", "missing.json"),
    ("image as calibration", "frame.png frame.png -o o.png", "frame.png expected"),
    ("calibration with NaN", "nan.json frame.png -o o.png", "pitch finite"),
    ("no image", "camera.json missing.png -o o.png", "missing.png expected found check"),
    ("directory as image", "camera.json sub -o o.png", "sub directory"),
    ("text as image", "camera.json text.png -o o.png", "text.png recognise"),
    ("empty file", "camera.json empty.png -o o.png", "empty.png"),
    ("cut image", "camera.json cut.png -o o.png", "cut.png readable damaged"),
    ("broken image", "camera.json broken.png -o o.png", "broken.png readable"),
    ("bomb", "camera.json bomb.png -o o.png", "bomb.png huge"),
    ("other size", "camera.json half.png -o o.png", "half.png 128x64 64x32 --image-size Camera.resized()"),
    ("large", "camera.json large.png -o o.png", "large.png 12000x10000"),
    ("second of other size", "camera.json frame.png half.png -o sub", "half.png 64x32"),
    ("palette, bilinear", "camera.json labels.png -o o.png", "palette nearest bilinear"),
    ("bits, bilinear", "camera.json bits.png -o o.png", "1-bit nearest"),
    ("CMYK", "camera.json cmyk.tif -o o.tif", "CMYK convert"),
    ("LAB", "camera.json lab.tif -o o.tif", "LAB convert"),
    ("32-bit integers", "camera.json int.tif -o o.tif", "mode convert"),
    ("16-bit colour", "camera.json deep_colour.png -o o.png", "8 bits 16 convert"),
    ("turned TIFF", "camera.json turned.tif -o o.png", "orientation 6 remove"),
    ("no output", "camera.json frame.png", "required -o"),
    ("empty output", "camera.json frame.png -o=", "empty"),
    ("no images", "camera.json -o o.png", "required IMAGE --help"),
    ("images apart", "camera.json frame.png -o sub alpha.png", "alpha.png together"),
    ("existing output", "camera.json frame.png -o existing.png", "existing.png exists --force"),
    ("existing mask", "camera.json frame.png -o o.png --mask existing.png", "existing.png exists --force"),
    ("existing, second", "camera.json alpha.png frame.png -o .", "frame_bev.png exists"),
    ("output is input", "camera.json frame.png -o frame.png --force", "frame.png input"),
    ("output is input, other name", "camera.json frame.png -o sub/../frame.png --force", "frame.png input"),
    ("output is another input", "camera.json frame.png frame_bev.png -o . --force", "frame_bev.png input"),
    ("mask is input", "camera.json frame.png -o o.png --mask frame.png --force", "frame.png input"),
    ("mask is output", "camera.json frame.png -o o.png --mask ./o.png", "o.png mask rename"),
    ("one output twice", "camera.json frame.png sub/frame.png -o sub", "frame_bev.png sub/frame.png rename"),
    ("unknown extension", "camera.json frame.png -o o.xyz", ".xyz .png .jpg"),
    ("no extension", "camera.json frame.png -o o", "no extension .png"),
    ("alpha as JPEG", "camera.json alpha.png -o o.jpg", "JPEG RGBA .png"),
    ("16 bits as JPEG", "camera.json deep.png -o o.jpg", "JPEG I;16 .png"),
    ("float as PNG", "camera.json float.tif -o o.png", "PNG F .tif"),
    ("labels as JPEG", "camera.json labels.png -o o.jpg --interpolation nearest", "JPEG P .png"),
    ("mask as JPEG", "camera.json frame.png -o o.png --mask m.jpg", "lossless m.jpg .png"),
    ("no directory", "camera.json frame.png -o missing/o.png", "missing/o.png directory make"),
    ("mask without directory", "camera.json frame.png -o o.png --mask o.png/m.png", "o.png/m.png directory"),
    ("file for several", "camera.json frame.png alpha.png -o o.png", "directory 2 images o.png"),
    ("file as directory", "camera.json frame.png alpha.png -o existing.png", "directory existing.png"),
    ("file as directory/", "camera.json frame.png -o existing.png/", "directory file"),
    (
        "directory below a file",
        "camera.json frame.png -o existing.png/new/",
        "existing.png/new/frame_bev.png directory",
    ),
    ("long name", f"camera.json frame.png -o {'o' * 300}.png", "ooo name"),
    ("long image name", f"camera.json {'i' * 300}.png -o o.png", "iii"),
    ("directory as mask", "camera.json frame.png -o o.png --mask sub", "sub extension"),
    ("reversed range", "camera.json frame.png -o o.png --x 50 7", "x 50 7"),
    ("no number", "camera.json frame.png -o o.png --x 7 far", "--x number 'far'"),
    ("NaN range", "camera.json frame.png -o o.png --y nan 10", "y finite NaN"),
    ("zero cells", "camera.json frame.png -o o.png --resolution 0", "resolution 0"),
    ("tiny cells", "camera.json frame.png -o o.png --resolution 1e-7", "resolution"),
    ("three sizes", "camera.json frame.png -o o.png --resolution 1 1 1", "--resolution 3 numbers"),
    ("infinite ground", "camera.json frame.png -o o.png --ground inf", "ground inf"),
    ("list eats the files", "--resolution 0.05 camera.json frame.png -o o.png", "'camera.json' before the options"),
    ("border of two", "camera.json frame.png -o o.png --border-value 1 2", "border_value frame.png"),
    ("border too large", "camera.json frame.png -o o.png --border-value 256", "border_value 256"),
    ("border no number", "camera.json frame.png -o o.png --border-value white", "'white'"),
    ("zero threads", "camera.json frame.png -o o.png --threads 0", "--threads at least 1 '0'"),
    ("unknown interpolation", "camera.json frame.png -o o.png --interpolation cubist", "cubist bilinear nearest"),
    ("unknown sampling", "camera.json frame.png -o o.png --sample-at edge", "edge center corner"),
    ("unknown option", "camera.json frame.png -o o.png --colour", "--colour --help"),
    ("abbreviated option", "camera.json frame.png -o o.png --res 1", "--res"),
]


@pytest.mark.parametrize(("what", "arguments", "phrases"), REFUSALS, ids=[row[0] for row in REFUSALS])
def test_mistakes_are_refused_before_any_work(
    here: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    what: str,
    arguments: str,
    phrases: str,
) -> None:
    prepare(here)
    before = snapshot(here)
    worked = []
    if what not in ("cut image", "broken image", "infinite ground"):  # known only when decoded, or to the table
        monkeypatch.setattr(images, "read", worked.append)
    extra = [] if "--resolution" in arguments else COARSE
    assert cli.main(["warp", *arguments.split(), *SIZE, *extra]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("ipm-rs: error: ")
    assert "Traceback" not in captured.err
    for phrase in phrases.split():
        assert phrase in captured.err
    assert snapshot(here) == before, "something was written"
    assert not worked, "an image was decoded"


@pytest.mark.skipif(os.name != "posix", reason="needs /dev/null")
def test_devices_are_neither_read_nor_replaced(warp: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo("pipe.png")
    assert warp("pipe.png", "-o", "bev.png") == 2
    assert warp("frame.png", "-o", "pipe.png", "--force") == 2
    assert capsys.readouterr().err.count("no regular file") == 2


@pytest.mark.parametrize("command", ["", "frobnicate", "warp", "demo a b", "info now", "--nonsense"])
def test_wrong_commands(here: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    status = cli.main(command.split())
    captured = capsys.readouterr()
    if not command:
        assert status == 0
        assert captured.out.startswith("usage: ipm-rs")
    else:
        assert status == 2
        assert captured.err.startswith("ipm-rs: error: ")
        assert captured.err.rstrip().endswith("--help")


@pytest.mark.filterwarnings("default::ipm_rs.CalibrationWarning")
def test_nothing_seen_is_refused_with_its_reason(warp: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    """A picture of the border's value alone would be of no use to anybody."""
    assert warp("frame.png", "-o", "bev.png", "--x", "-50", "-7", "--border-value", "9", "--quiet") == 2
    message = capsys.readouterr().err
    assert message.startswith("ipm-rs: error: no cell of the grid is seen by the camera: camera at (1.70, 0.03, 1.21)")
    assert "looks 0.6 degrees to the right of +x and 2.2 degrees down; the whole grid is behind it" in message
    assert warp("frame.png", "-o", "bev.png", "--y", "90", "110") == 2
    assert "the grid is outside its image" in capsys.readouterr().err and not Path("bev.png").exists()
    assert warp("frame.png", "-o", "bev.png", "--ground", "5") == 0
    assert "warning: the camera, 1.2124 m high, is not above the road at 5 m" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("module", "arguments"),
    [
        ("PIL", "warp camera.json frame.png -o o.png"),
        ("PIL", "demo o.png"),
        ("tqdm", "warp camera.json a.png b.png -o d/"),
    ],
)
def test_a_missing_extra_is_named(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], module: str, arguments: str
) -> None:
    for name in "ab":
        Path(f"{name}.png").write_bytes(Path("frame.png").read_bytes())
    before = snapshot(here)
    for name in [name for name in sys.modules if name == module or name.startswith(f"{module}.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert cli.main([*arguments.split(), *(SIZE if "warp" in arguments else [])]) == 2
    message = capsys.readouterr().err
    assert message.startswith("ipm-rs: error: ")
    assert 'pip install "ipm-rs[cli]"' in message
    assert snapshot(here) == before


# ---------------------------------------------------------------------------------------------------------------------
# Help, info, and the process around main()


@pytest.mark.parametrize("command", [[], ["warp"], ["demo"], ["info"]])
def test_help_ends_with_examples_that_parse(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*command, "--help"]) == 0
    text = capsys.readouterr().out
    head, examples = text.split("\nExamples:\n")
    assert head.startswith("usage: ipm-rs")
    lines = [line.split("#")[0].split() for line in examples.rstrip().splitlines()]
    assert lines
    for line in lines:
        arguments = line[line.index("ipm-rs") + 1 :]
        assert cli._parser().parse_args(arguments).run


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"ipm-rs {ipm_rs.__version__}\n"


def test_info(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["info"]) == 0
    facts = dict(re.split("  +", line) for line in capsys.readouterr().out.splitlines())
    assert facts["ipm-rs"] == ipm_rs.__version__
    assert facts["threads"] == str(ipm_rs.get_num_threads())
    assert facts["NumPy"] == np.__version__
    assert facts["Pillow"] == Image.__version__
    core = ipm_rs.cpu_info()
    assert facts["isa"] == core["isa"]
    assert facts["cpu features"] == ", ".join(core["cpu_features"])
    assert {"available isas", "platform", "build", "system", "Python", "tqdm"} <= set(facts)


def test_info_without_the_extra(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(cli.info, "version", missing)
    assert cli.main(["info"]) == 0
    assert re.search(r'Pillow +not installed; pip install "ipm-rs\[cli\]"', capsys.readouterr().out)


def test_ctrl_c_is_no_traceback(
    warp: Callable[..., int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(images, "probe", interrupt)
    assert warp("frame.png", "-o", "bev.png") == 130
    assert capsys.readouterr().err == "ipm-rs: interrupted\n"


def test_a_name_that_cannot_be_printed(warp: Callable[..., int], monkeypatch: pytest.MonkeyPatch) -> None:
    name = "bev_\N{SNOWMAN}.png"
    with Path(os.devnull).open("w", encoding="ascii") as ascii_only:
        monkeypatch.setattr(sys, "stdout", ascii_only)
        assert warp("frame.png", "-o", name) == 0
    assert Path(name).is_file()


def test_as_a_process(here: Path) -> None:
    run = [sys.executable, "-m", "ipm_rs"]
    version = subprocess.run([*run, "--version"], capture_output=True, text=True, check=True)
    assert version.stdout == f"ipm-rs {ipm_rs.__version__}\n"
    wrong = subprocess.run([*run, "warp"], capture_output=True, text=True, check=False)
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert wrong.stderr.startswith("ipm-rs: error: ")


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_gone_away_does_not_stop_the_work(here: Path, unbuffered: str) -> None:
    Path("last.png").write_bytes(Path("frame.png").read_bytes())
    warp = ["warp", "camera.json", "frame.png", "last.png", "-o", "out/", *SIZE, *COARSE]
    read_end, write_end = os.pipe()
    os.close(read_end)
    for arguments in (warp, ["--help"]):
        command = [sys.executable, "-m", "ipm_rs", *arguments]
        environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
        process = subprocess.run(
            command, env=environment, stdout=write_end, stderr=subprocess.PIPE, text=True, check=False
        )
        assert (process.returncode, process.stderr) == (0, "")
    os.close(write_end)
    assert {path.name for path in Path("out").iterdir()} == {"frame_bev.png", "last_bev.png"}


# ---------------------------------------------------------------------------------------------------------------------
# Calibrations of any format


def test_any_calibration(here):
    """KITTI needs its image size, nuScenes the camera; both give what the library gives."""
    path = SAMPLES["kitti object"].write(here)
    frame = textured(375, 1242, 3)
    Image.fromarray(frame).save("kitti.png")
    grid = ["--x", "6", "46", "--y", "-10", "10", "--resolution", "0.5", "--ground", "-1.73"]
    command = ["warp", str(path), "kitti.png", "-o", "bev.png", *grid, "--camera", "3"]
    assert cli.main(command) == 2
    assert cli.main([*command, "--image-size", "1242", "375"]) == 0
    camera = ipm_rs.Camera.from_kitti(path, camera=3, image_size=(1242, 375))
    table = ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(6, 46), y=(-10, 10), resolution=0.5), ground=-1.73)
    assert table.mask.mean() > 0.5
    np.testing.assert_array_equal(load("bev.png"), table.warp(frame))


def test_calibration_that_needs_more(here, capsys):
    Image.fromarray(textured(900, 1600, 3)).save("front.png")
    path = SAMPLES["nuscenes"].write(here)
    arguments = ["warp", str(path), "front.png", "-o", "bev.png", *COARSE]
    assert cli.main(arguments) == 2
    assert "'CAM_FRONT', 'CAM_FRONT_LEFT'" in capsys.readouterr().err
    assert cli.main([*arguments, "--camera", "CAM_FRONT"]) == 0
    kitti = SAMPLES["kitti object"].write(here)
    assert cli.main(["warp", str(kitti), "front.png", "-o", "other.png"]) == 2
    assert "--image-size W H" in capsys.readouterr().err
    Path("notes.txt").write_text("no calibration")
    assert cli.main(["warp", "notes.txt", "front.png", "-o", "other.png"]) == 2
    assert "expected a calibration of a known format" in capsys.readouterr().err
    assert not Path("other.png").exists()


def test_a_lens_that_the_file_does_not_name(here, capsys):
    Path("fisheye.yml").write_text(
        "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
        "   data: [ 60., 0., 63.5, 0., 60., 31.5, 0., 0., 1. ]\n"
        "dist_coeffs: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ 0.02, -0.01, 0.003, -0.0005 ]\n"
    )
    command = ["warp", "fisheye.yml", "frame.png", "-o", "bev.png", "--ground", "-1.5", *SIZE, *COARSE]
    assert cli.main(command) == 2
    assert "--lens" in capsys.readouterr().err
    assert not Path("bev.png").exists()
    assert cli.main([*command, "--lens", "fisheye"]) == 0
    camera = ipm_rs.Camera.from_opencv("fisheye.yml", image_size=(WIDTH, HEIGHT), lens="fisheye")
    lut = ipm_rs.Lut(camera, ipm_rs.BevGrid(**GRID), ground=-1.5)
    assert lut.mask.any()
    assert np.array_equal(load("bev.png"), lut.warp(load("frame.png")))
    # of an image that was undistorted
    assert cli.main([*command, "--lens", "pinhole", "--force"]) == 0
    assert not np.array_equal(load("bev.png"), lut.warp(load("frame.png")))
