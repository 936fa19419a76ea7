"""What the commands' arguments share: the parser, numbers, the grid, and the checks of outputs."""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NoReturn, TypeAlias, TypeVar

import ipm_rs
from ipm_rs.cli.printing import emit_error
from ipm_rs.errors import ArgumentError, CalibrationError, FileError, MissingFileError
from ipm_rs.files.atomic import check_target

Header = TypeVar("Header")


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Help as wide as the terminal: paragraphs are filled, and lines that begin with blanks stay as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraphs = [
            part if re.search(r"^ ", part, re.MULTILINE) else textwrap.fill(" ".join(part.split()), width)
            for part in text.split("\n\n")
        ]
        return "\n\n".join(paragraphs)


class Parser(argparse.ArgumentParser):
    """Parser whose mistakes are ordinary errors of this program, and whose help ends with examples."""

    def __init__(self, *, examples: str = "", **options: Any) -> None:
        super().__init__(
            formatter_class=_Formatter,
            epilog=f"Examples:\n{examples}",
            allow_abbrev=False,
            **options,
        )

    def error(self, message: str) -> NoReturn:
        """Raise what the parser objects to as one of our errors."""
        stray_words = message.startswith("unrecognized") and ": -" not in message
        hint = "; give all images together, before the options" if stray_words else ""
        raise ArgumentError(f"{message}{hint}; see {self.prog} --help")


Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


def real(text: str) -> float:
    """Return the number of an argument."""
    try:
        return float(text)
    except ValueError:
        mend = "give the calibration and the images before the options" if Path(text).exists() else "give a number"
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}; {mend}") from None


def value(text: str) -> int | float:
    """Return the number of an argument, whole if it is written so."""
    try:
        return int(text)
    except ValueError:
        return real(text)


def count(text: str) -> int:
    """Return the whole number of an argument, at least 1."""
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, got {text!r}")
    return number


def name(text: str) -> int | str:
    """Return what `Camera.load` takes as the name of a camera: a number if it is one."""
    return int(text) if text.isdecimal() else text


def add_camera(group: argparse._ArgumentGroup) -> None:
    """Add the arguments that tell `Camera.load` what a calibration leaves open."""
    group.add_argument(
        "--camera",
        metavar="NAME",
        type=name,
        help="which camera, where the calibration holds several: a name or a number",
    )
    add_reading(group)


def add_reading(group: argparse._ArgumentGroup) -> None:
    """Add the arguments that say how a calibration is to be read, whichever camera of it."""
    group.add_argument(
        "--lens",
        choices=("brown_conrady", "fisheye", "omnidir", "pinhole"),
        help="which lens, where an OpenCV file does not say it",
    )
    group.add_argument(
        "--vehicle-frame",
        metavar="NAME",
        help="which frame of a KITTI calibration is the vehicle's: velodyne, imu, camera, road",
    )
    group.add_argument(
        "--metres-per-unit",
        metavar="N",
        type=real,
        help="length of the calibration's unit: 0.001 where a board was measured in millimetres",
    )
    group.add_argument(
        "--nearest-rotation", action="store_true", help="take the nearest rotation for one of three printed digits"
    )


def add_image_size(group: argparse._ArgumentGroup) -> None:
    """Add the size of the images, which some calibrations do not say."""
    group.add_argument(
        "--image-size",
        metavar=("W", "H"),
        nargs=2,
        type=count,
        help="size of the images that the calibration was made for, if it does not say (Cityscapes: 2048 1024)",
    )


_HERE = {
    "lens": "--lens NAME",
    "frame=": "--vehicle-frame NAME",
    "metres_per_unit=": "--metres-per-unit N",
    "nearest_rotation=": "--nearest-rotation",
    "camera=": "--camera NAME",
}


def load_camera(args: argparse.Namespace, image_size: tuple[int, int] | None) -> ipm_rs.Camera:
    """Read the calibration that is named on the command line."""
    with _advising(args):
        return ipm_rs.Camera.load(args.calibration, image_size, args.camera, **_reading(args))


def load_rig(args: argparse.Namespace, image_size: tuple[int, int] | None) -> ipm_rs.Rig:
    """Read all cameras of the calibration that is named on the command line."""
    with _advising(args):
        return ipm_rs.Rig.load(args.rig, image_size=image_size, **_reading(args))


def _reading(args: argparse.Namespace) -> dict[str, Any]:
    """Return what `add_reading` added, as `Camera.load` takes it."""
    return {
        "lens": args.lens,
        "frame": args.vehicle_frame,
        "metres_per_unit": args.metres_per_unit,
        "nearest_rotation": args.nearest_rotation,
    }


@contextlib.contextmanager
def _advising(args: argparse.Namespace) -> Iterator[None]:
    """Say which option of the command line an error of a reader means."""
    try:
        yield
    except (ArgumentError, CalibrationError) as error:
        last = str(error).rpartition("; ")[2]
        here = next((option for word, option in _HERE.items() if word in last), None)
        given = args.lens is not None and here == _HERE["lens"]
        if here is None or given or "drop it" in last:
            raise
        raise type(error)(f"{error}; here: {here}") from error


def load_camera_sized(args: argparse.Namespace) -> ipm_rs.Camera:
    """Read the calibration with the size that --image-size gives; what lacks one is told of that option."""
    try:
        return load_camera(args, args.image_size)
    except CalibrationError as error:
        if args.image_size is None and "image_size" in str(error):
            raise CalibrationError(f"{error}; give --image-size W H") from error
        raise


def add_grid(
    command: Parser, sampling: str | None = None, x: tuple[float, float] = (7.0, 50.0)
) -> argparse._ArgumentGroup:
    """Add the arguments of a `BevGrid`, and return their group; `sampling` says what --sample-at does, if it is one."""
    grid = command.add_argument_group("grid")
    forward = f"metres forward (default: {x[0]:g} {x[1]:g})"
    grid.add_argument("--x", metavar=("MIN", "MAX"), nargs=2, type=real, default=list(x), help=forward)
    grid.add_argument(
        "--y", metavar=("MIN", "MAX"), nargs=2, type=real, default=[-10.0, 10.0], help="metres left (default: -10 10)"
    )
    grid.add_argument(
        "--resolution",
        metavar=("DX", "DY"),
        nargs="+",
        type=real,
        default=[0.05],
        help="cell size in metres, one number for both axes or two (default: 0.05)",
    )
    if sampling is not None:
        grid.add_argument(
            "--sample-at", choices=("center", "corner"), default="center", help=f"{sampling} (default: center)"
        )
    return grid


def add_ground(grid: argparse._ArgumentGroup, *, of_drives: bool = False) -> None:
    """Add the height of the road; with `of_drives` it is None where it is not given, for datasets that know theirs."""
    known = ", or a drive's own where its dataset says it" if of_drives else ""
    grid.add_argument(
        "--ground",
        metavar="HEIGHT",
        type=real,
        default=None if of_drives else 0.0,
        help=f"height z of the road in metres (default: 0{known})",
    )


def resolution(numbers: list[float]) -> float | tuple[float, float]:
    """Return the cell size that --resolution gives, once or for each axis."""
    if len(numbers) > 2:
        raise ArgumentError(f"--resolution: expected DX or DX DY, got {len(numbers)} numbers; give one or two")
    return numbers[0] if len(numbers) == 1 else (numbers[0], numbers[1])


def read_headers(probe: Callable[[Path], Header], paths: list[Path]) -> tuple[list[Header | None], int]:
    """Look at the headers of all files; of several, a damaged one is told of and becomes None, and how many they are.

    Raises
    ------
    FileError
        A file is missing, or all are damaged.
    """
    headers: list[Header | None] = []
    for path in paths:
        try:
            headers.append(probe(path))
        except MissingFileError:  # more likely a wrong name than a damaged file
            raise
        except FileError as error:
            if len(paths) == 1:
                raise
            emit_error(error)
            headers.append(None)
    damaged = headers.count(None)
    if damaged == len(headers):
        raise FileError(f"expected images, got {damaged} files of which none can be read, see above")
    return headers, damaged


def output_names(
    option: str, text: str, sources: list[Path], name_of: Callable[[Path], str], several: str
) -> list[Path]:
    """Names of the outputs: the one given, or one for each source in the directory given; `several` says of what."""
    if not text:
        raise ArgumentError(f"{option}: expected a file or a directory, got an empty name; give one")
    path = Path(text)
    names_directory = path.is_dir() or text.endswith(tuple(filter(None, (os.sep, os.altsep))))
    if len(sources) == 1 and not names_directory:
        return [path]
    if not names_directory and (path.exists() or path.suffix[1:2].isalpha()):
        raise ArgumentError(
            f"{option}: expected a directory for {len(sources)} {several}, got {text}, the name of a file; give a "
            f"directory{'' if path.exists() else f', as {text}{os.sep} if it shall have this name'}"
        )
    if path.exists() and not path.is_dir():
        raise ArgumentError(f"{option}: expected a directory, got {text}, which is a file; give another name")
    return [path / name_of(source) for source in sources]


def check_not_input(path: Path, inputs: Iterable[str | os.PathLike[str]]) -> None:
    """Refuse an output that is an input, by whatever name; --force does not allow it either."""
    if path.exists() and any(Path(source).exists() and path.samefile(source) for source in inputs):
        raise ArgumentError(f"{path}: expected an output, got an input; give another name, also with --force")


def check_apart(outputs: Iterable[Path]) -> None:
    """Refuse two outputs that are one file."""
    taken: set[str] = set()
    for path in outputs:
        real_path = os.path.normcase(os.path.realpath(path))
        if real_path in taken:
            raise ArgumentError(f"{path}: expected a name of its own for each output, got it twice; rename one")
        taken.add(real_path)


def check_output(path: Path, *, may_exist: bool, may_make: bool = False) -> None:
    """Refuse an output that exists or whose directory does not; with ``may_make`` its directory will be made."""
    check_target(path)
    if os.path.lexists(path) and not may_exist:
        raise FileError(f"{path}: expected a new file, got one that exists; give another name, or --force")
    directory = Path(os.path.realpath(path)).parent
    while may_make and not directory.exists():
        directory = directory.parent
    if not directory.is_dir():
        raise FileError(f"{path}: expected its directory to exist, found none; make {path.parent} first")
    if not os.access(directory, os.W_OK):
        raise FileError(f"{path}: expected a directory to write in, got no permission; choose another")
