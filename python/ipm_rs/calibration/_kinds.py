"""What a file is, by its first bytes, where it is nothing that a calibration is written in."""

from __future__ import annotations

__all__ = ["is_zip", "kind_of"]

_IMAGES = {
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"GIF8": "a GIF image",
    b"II*\0": "a TIFF image",
    b"MM\0*": "a TIFF image",
    b"\0\0\0\x0cjP  ": "a JPEG 2000 image",
    b"v/1\x01": "an OpenEXR image",
    b"\x1aE\xdf\xa3": "a Matroska video",
    b"\0\0\x01\xba": "an MPEG video",
    b"\0\0\x01\xb3": "an MPEG video",
}
_OTHERS = {
    b"\x93NUMPY": (
        "an .npy array without a name",
        "save K and the coefficients by name, np.savez(path, mtx=K, dist=D)",
    ),
    b"MATLAB 5": ("a .mat file", "write its numbers as JSON with jsonencode"),
    b"\x89HDF\r\n": ("an HDF5 file", "write its numbers as JSON"),
    b"\x1f\x8b": ("a gzip archive", "unpack it first"),
    b"7z\xbc\xaf": ("a 7z archive", "unpack it first"),
    b"#ROSBAG ": ("a ROS bag", "dump one CameraInfo message of it: rostopic echo -n 1"),
    b"%PDF": ("a PDF", "pass the calibration file"),
    b"\xff\xfe": ("text in UTF-16", "save it as UTF-8"),
    b"\xfe\xff": ("text in UTF-16", "save it as UTF-8"),
}
_NETPBM = tuple(b"P%d" % digit for digit in range(1, 8))


def is_zip(data: bytes) -> bool:
    """Whether it is a zip archive, as .npz files are."""
    return data[:4] in (b"PK\x03\x04", b"PK\x05\x06")


def kind_of(data: bytes) -> str | None:
    """Say what a file is, and how to mend that, by its first bytes; None where it may be a calibration."""
    image = next((name for magic, name in _IMAGES.items() if data.startswith(magic)), None)
    if data[:2] == b"BM" and data[6:10] == b"\0\0\0\0":
        image = "a BMP image"
    elif data[:4] == b"RIFF" and data[8:12] in (b"WEBP", b"AVI "):
        image = "a WebP image" if data[8:12] == b"WEBP" else "an AVI video"
    elif data[4:8] == b"ftyp":
        image = "an AVIF or HEIF image" if data[8:12] in (b"avif", b"heic", b"heix", b"mif1") else "an MP4 video"
    elif data[:2] in _NETPBM and data[2:3].isspace() and data[3:4] in tuple(b"%c" % digit for digit in b"0123456789#"):
        image = "a PNM image"
    if image is not None:
        return f"{image}; did you swap calibration and image?"
    if data[:1] == b"\x80" and data[1:2] in (b"\x02", b"\x03", b"\x04", b"\x05"):  # its protocol
        return "a pickle; it may run anything when it is read: load it yourself, and pass a mapping"
    return next((f"{name}; {mend}" for magic, (name, mend) in _OTHERS.items() if data.startswith(magic)), None)
