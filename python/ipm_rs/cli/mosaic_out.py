"""What ``ipm-rs mosaic`` writes beside the map: names that are checked before anything is done, and the pictures."""

from __future__ import annotations

import argparse
import contextlib
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import ipm_rs
from ipm_rs import draw, streams
from ipm_rs.cli.arguments import check_apart, check_not_input, check_output
from ipm_rs.cli.frames import files_of
from ipm_rs.cli.printing import emit
from ipm_rs.errors import ArgumentError
from ipm_rs.files import images
from ipm_rs.mosaic._checks import range_of
from ipm_rs.mosaic._geotiff import metric_system
from ipm_rs.streams._frame import tickets_of

__all__ = ["check", "check_inputs", "removed_if_empty", "write"]

_TABLES = (".csv", ".json", ".txt", ".yaml", ".yml")
"""Endings of what datasets have beside their pictures: calibrations, times, poses."""

_MAP = ("mosaic.json", "frames.txt", "lock")
"""Files of a map, beside its tiles."""


def check(args: argparse.Namespace) -> None:
    """Refuse what cannot be written, or not as it is asked for."""
    outputs = _outputs(args)
    if args.picture is not None:
        images.check_format(args.picture, "RGB", "the picture")
    elif args.x is not None or args.y is not None:
        raise ArgumentError("--x, --y: expected --picture with them, got none; give its name")
    for path in outputs:
        check_output(path, may_exist=args.force)
    check_apart(outputs)
    for name, given in (("--x", args.x), ("--y", args.y)):
        range_of(name, given, args.resolution)
    for option in ("crs", "origin"):
        if getattr(args, option) is not None and args.geotiff is None:
            raise ArgumentError(f"--{option}: expected --geotiff with it, got none; give its name")
    if args.geotiff is not None:
        if args.crs is None:
            raise ArgumentError("--geotiff: expected --crs with it, such as EPSG:32632, got none; give it")
        _check_crs(args.crs)


def check_inputs(args: argparse.Namespace, sources: Iterable[Path], stream: streams.Stream) -> None:
    """Refuse outputs that are the calibration, pictures, poses or the map itself, also with --force."""
    existing = [path for path in _outputs(args) if path.exists()]
    if not existing:
        return
    inputs = [Path(given) for given in (args.calibration, args.poses, args.mask) if given is not None]
    inputs += [args.output / name for name in _MAP]
    for source in sources:
        inputs += files_of(source)
    for directory in [path for path in inputs if path.is_dir()]:
        inputs += [path for path in directory.iterdir() if path.suffix.lower() in _TABLES]
    with contextlib.closing(tickets_of(stream)) as tickets:
        for ticket in tickets:
            if ticket.path is None:
                break
            inputs.append(ticket.path)
    for path in existing:
        check_not_input(path, inputs)


def _outputs(args: argparse.Namespace) -> list[Path]:
    return [path for path in (args.picture, args.geotiff) if path is not None]


def _check_crs(crs: str) -> None:
    """Refuse, before a drive is gone through, what no GeoTIFF of a map is written in."""
    try:
        metric_system(crs)
    except ArgumentError as error:
        raise ArgumentError(f"--{error}") from error


@contextlib.contextmanager
def removed_if_empty(output: Path) -> Iterator[None]:
    """Remove the map that the block makes if no frame showed the road: it would hold the next run to its cells."""
    there, known = output.exists(), (output / _MAP[0]).exists()
    try:
        yield
    finally:
        if not known and _is_empty(output):
            with contextlib.suppress(OSError):  # something else lies there
                for name in _MAP:
                    (output / name).unlink(missing_ok=True)
                (output / "tiles").rmdir()
                if not there:
                    output.rmdir()


def _is_empty(output: Path) -> bool:
    with contextlib.suppress(ipm_rs.IpmError):
        with ipm_rs.Mosaic.load(output) as mosaic:
            return not mosaic.tiles  # frames that saw nothing would be taken for added the next time
    return False


def write(mosaic: ipm_rs.Mosaic, track: list[Any], args: argparse.Namespace) -> None:
    """Draw and export what was asked for, as far as the map is not too large for it."""
    blend: Any = args.blend or ("labels" if mosaic.labels else "weighted")
    if not mosaic.tiles:
        raise ArgumentError(
            "expected frames that see the road, got none that does; check the calibration and --distance"
        )
    if args.picture is not None:
        with _told_if_too_large(args.picture, "give --x MIN MAX and --y MIN MAX, of a part of it"):
            layers = mosaic.layers(args.x, args.y, names=(blend, "mask"))
            way = None if args.no_track or not track else np.array(track)
            page = draw.axes(layers[blend], mosaic.window(args.x, args.y), mask=layers["mask"], track=way)
            images.write(args.picture, np.asarray(page), images.Look("RGB"))
    if args.tiles is not None:
        with _told_if_too_large(args.tiles, "leave --tiles out, or map the stretches one by one"):
            mosaic.export_tiles(args.tiles, blend=blend)
    if args.geotiff is not None:
        with _told_if_too_large(args.geotiff, "leave --geotiff out, or map the stretches one by one"):
            mosaic.export_geotiff(args.geotiff, crs=args.crs, origin=args.origin or (0.0, 0.0), blend=blend)


@contextlib.contextmanager
def _told_if_too_large(path: Path, mend: str) -> Iterator[None]:
    """Say so where a map has more cells than one picture holds: the map itself is whole."""
    try:
        yield
    except ArgumentError as error:
        if re.search(r"at most \S+ cells", str(error)) is None:
            raise
        too_large = str(error).rpartition("; ")[0].partition(": ")[2]
        emit(f"ipm-rs: warning: {path}: not written, the map is too large: {too_large}; {mend}", sys.stderr)
