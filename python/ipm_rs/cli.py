"""The command line ``ipm-rs``: warp images, see a demo, ask what is installed.

Exit status: 0 when all went well, 2 after a mistake of the user or a damaged file (one line on stderr says what was
expected, what came and how to mend it), 130 after Ctrl-C. Nothing is written before every argument, every image header
and every output name has been checked, and a file is written whole or not at all.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import platform
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

import numpy as np

import ipm_rs
from ipm_rs import imagefile
from ipm_rs.errors import ArgumentError, FileError, ImageError, IpmError, MissingExtraError

DEMO_NAME = "ipm_demo.png"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        The arguments, without the program's name; by default those of the process.

    Returns
    -------
    int
        The exit status.
    """
    try:
        args = _parser().parse_args(argv)
        args.run(args)
        return 0
    except SystemExit as stop:  # --help and --version
        return int(stop.code or 0)
    except KeyboardInterrupt:
        _print("ipm-rs: interrupted", sys.stderr)
        return 130
    except IpmError as error:
        _print(f"ipm-rs: error: {error}", sys.stderr)
        return 2
    except BrokenPipeError:  # argparse of Python 3.10 prints without a guard; our own printing is in _print
        _discard(sys.stdout)
        return 0
    except OSError as error:  # the file system's own refusals, such as a name that is too long
        reason = error.strerror or str(error)
        _print(f"ipm-rs: error: {error.filename}: expected a usable path, got: {reason}; check it", sys.stderr)
        return 2
    except MemoryError:
        _print("ipm-rs: error: expected enough memory, got too little; use a coarser --resolution", sys.stderr)
        return 2
    finally:
        with contextlib.suppress(ValueError):  # a closed stream
            _print("", sys.stdout, end="")


# ---------------------------------------------------------------------------------------------------------------------
# Arguments


class _Parser(argparse.ArgumentParser):
    """Parser whose mistakes are ordinary errors of this program, and whose help ends with examples."""

    def __init__(self, *, examples: str = "", **options: Any) -> None:
        super().__init__(
            formatter_class=argparse.RawDescriptionHelpFormatter,
            epilog=f"Examples:\n{examples}",
            allow_abbrev=False,
            **options,
        )

    def error(self, message: str) -> NoReturn:
        stray_words = message.startswith("unrecognized") and ": -" not in message
        hint = "; give all images together, before the options" if stray_words else ""
        raise ArgumentError(f"{message}{hint}; see {self.prog} --help")


if TYPE_CHECKING:
    _Commands = argparse._SubParsersAction[_Parser]


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="ipm-rs",
        description="Metric bird's-eye views from camera images and their calibration.",
        examples="""\
  ipm-rs demo                                      # a synthetic road, nothing needed
  ipm-rs warp camera.json frame.png -o bev.png     # your own image
  ipm-rs info                                      # what is installed""",
    )
    parser.add_argument("--version", action="version", version=f"ipm-rs {ipm_rs.__version__}")
    parser.set_defaults(run=lambda _: _print(parser.format_help(), end=""))
    commands = parser.add_subparsers(metavar="COMMAND", parser_class=_Parser)
    _add_demo(commands)
    _add_warp(commands)
    _add_info(commands)
    return parser


def _add_demo(commands: _Commands) -> None:
    demo = commands.add_parser(
        "demo",
        help="warp a synthetic road and measure the error",
        description="""\
Render a synthetic road through a Cityscapes calibration, warp it to a bird's-eye view, draw both side by side, and
print sizes, times, coverage and the error against the analytic truth.""",
        examples="""\
  ipm-rs demo                    # writes ./ipm_demo.png
  ipm-rs demo road.png --force   # another name; replaces an existing file""",
    )
    demo.add_argument(
        "out", metavar="OUT", nargs="?", help=f"the picture; without it ./{DEMO_NAME}, which is replaced if it exists"
    )
    demo.add_argument("--force", action="store_true", help="replace an existing OUT")
    demo.set_defaults(run=_demo)


def _add_warp(commands: _Commands) -> None:
    warp = commands.add_parser(
        "warp",
        help="warp camera images to bird's-eye views",
        description="""\
Warp camera images to metric bird's-eye views. Row 0 is far ahead, column 0 is to the left; metres are those of the
vehicle frame of the calibration: x forward, y left, z up.

Images may be grey, 16-bit grey, colour, with alpha, or label images with a palette (nearest only; indices and palette
are kept). EXIF orientation is not applied: the calibration belongs to the pixels as they are stored. The extension of
the output decides its format: """
        + " ".join(imagefile.FORMATS)
        + ".",
        examples="""\
  ipm-rs warp camera.json frame.png -o bev.png
  ipm-rs warp camera.json frame.png -o bev.png --x 7 50 --y -10 10 --resolution 0.05 0.025 --sample-at corner
  ipm-rs warp camera.json frames/*.png -o bevs/ --mask bevs/valid.png
  ipm-rs warp camera.json labels.png -o bev_labels.png --interpolation nearest --border-value 255""",
    )
    add = warp.add_argument
    add("calibration", metavar="CALIBRATION", help="camera calibration, a Cityscapes camera JSON")
    add("images", metavar="IMAGE", nargs="+", type=Path, help="camera images, all of the calibration's size")
    add(
        "-o",
        "--output",
        metavar="OUT",
        required=True,
        help="a file for one image; a directory for several, which get the names <image>_bev.png",
    )
    grid = warp.add_argument_group("grid")
    grid.add_argument(
        "--x", metavar=("MIN", "MAX"), nargs=2, type=_real, default=[7.0, 50.0], help="metres forward (default: 7 50)"
    )
    grid.add_argument(
        "--y", metavar=("MIN", "MAX"), nargs=2, type=_real, default=[-10.0, 10.0], help="metres left (default: -10 10)"
    )
    grid.add_argument(
        "--resolution",
        metavar=("DX", "DY"),
        nargs="+",
        type=_real,
        default=[0.05],
        help="cell size in metres, one number for both axes or two (default: 0.05)",
    )
    grid.add_argument(
        "--sample-at", choices=("center", "corner"), default="center", help="where a cell is sampled (default: center)"
    )
    grid.add_argument(
        "--ground", metavar="HEIGHT", type=_real, default=0.0, help="height z of the road in metres (default: 0)"
    )
    pixels = warp.add_argument_group("pixels")
    pixels.add_argument(
        "--interpolation", choices=("bilinear", "nearest"), default="bilinear", help="(default: bilinear)"
    )
    pixels.add_argument(
        "--border-value",
        metavar="V",
        nargs="+",
        type=_value,
        default=[0],
        help="value of cells that the camera does not see, one or one per channel (default: 0)",
    )
    pixels.add_argument(
        "--image-size",
        metavar=("W", "H"),
        nargs=2,
        type=_count,
        default=(2048, 1024),
        help="size of the images that the calibration was made for (default: 2048 1024)",
    )
    run = warp.add_argument_group("run")
    run.add_argument("--mask", metavar="PATH", type=Path, help="also write the validity mask, 255 where a cell is seen")
    run.add_argument("--threads", metavar="N", type=_count, help="threads of a warp (default: the CPUs there are)")
    run.add_argument("--force", action="store_true", help="replace existing outputs")
    run.add_argument("--quiet", action="store_true", help="print nothing but warnings and errors")
    warp.set_defaults(run=_warp)


def _add_info(commands: _Commands) -> None:
    info = commands.add_parser(
        "info",
        help="print versions, CPU features and build",
        description="Print the versions, the CPU features in use and how the core was built, for a bug report.",
        examples="  ipm-rs info\n  IPM_RS_ISA=scalar ipm-rs info   # without SIMD",
    )
    info.set_defaults(run=_info)


def _real(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        mend = "give the calibration and the images before the options" if Path(text).exists() else "give a number"
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}; {mend}") from None


def _value(text: str) -> int | float:
    try:
        return int(text)
    except ValueError:
        return _real(text)


def _count(text: str) -> int:
    try:
        count = int(text)
    except ValueError:
        count = 0
    if count < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, got {text!r}")
    return count


# ---------------------------------------------------------------------------------------------------------------------
# Commands


def _demo(args: argparse.Namespace) -> None:
    from ipm_rs import demo

    imagefile.require_pillow()
    path = Path(DEMO_NAME if args.out is None else args.out)
    imagefile.check_format(path, "RGB", "the picture")
    _check_output(path, may_exist=args.force or args.out is None)
    result = demo.run()
    imagefile.write(path, np.asarray(demo.picture(result)), imagefile.Look("RGB"))
    for line in demo.report(result):
        _print(line)
    _print(f"picture   {path}")


def _info(args: argparse.Namespace) -> None:
    facts: dict[str, object] = {"ipm-rs": ipm_rs.__version__}
    facts |= {key.replace("_", " "): value for key, value in ipm_rs.cpu_info().items() if key != "version"}
    facts |= {"system": platform.platform()}
    facts |= {"Python": f"{platform.python_version()} ({platform.python_implementation()})", "NumPy": np.__version__}
    for name in ("Pillow", "tqdm"):
        try:
            facts[name] = version(name)
        except PackageNotFoundError:
            facts[name] = 'not installed; pip install "ipm-rs[cli]"'
    width = max(map(len, facts))
    for name, fact in facts.items():
        text = ", ".join(map(str, fact)) if isinstance(fact, (list, tuple, set)) else fact
        _print(f"{name:{width}}  {text}")


def _warp(args: argparse.Namespace) -> None:
    camera = _read_camera(args.calibration, tuple(args.image_size))
    grid = ipm_rs.BevGrid(x=args.x, y=args.y, resolution=_resolution(args.resolution), sample_at=args.sample_at)
    headers = [imagefile.probe(path) for path in args.images]
    for header in headers:
        _check_image(header, camera, args.interpolation)
    outputs = _outputs(args.output, headers)
    _check_outputs(outputs, headers, args)
    options: dict[str, Any] = {
        "interpolation": args.interpolation,
        "border_value": args.border_value[0] if len(args.border_value) == 1 else tuple(args.border_value),
        "threads": args.threads,
    }
    _rehearse(headers, options)
    show_progress = len(headers) > 1 and not args.quiet and sys.stderr.isatty()
    progress: _Progress = _progress_bar() if show_progress else _no_progress

    lut = ipm_rs.Lut(camera, grid, ground=args.ground)
    mask = lut.mask
    if camera.position[2] <= args.ground:
        _print(
            f"ipm-rs: warning: the camera, {camera.position[2]:g} m high, is not above the road at {args.ground:g} m; "
            "check --ground and the calibration",
            sys.stderr,
        )
    elif not mask.any():
        _print(f"ipm-rs: warning: {_why_blind(camera, grid, args.ground)}", sys.stderr)
    failed = 0
    with progress(list(zip(headers, outputs, strict=True))) as (jobs, say):
        for header, output in jobs:
            try:
                pixels, look = imagefile.read(header.path)
            except (FileError, ImageError) as error:  # one damaged frame does not stop the others
                if len(headers) == 1:
                    raise
                failed += 1
                say(f"ipm-rs: error: {error}", sys.stderr)
                continue
            start = perf_counter()
            bev = lut.warp(pixels, **options)
            milliseconds = 1e3 * (perf_counter() - start)
            output.parent.mkdir(parents=True, exist_ok=True)
            imagefile.write(output, bev, look)
            if not args.quiet:
                rows, cols = lut.shape
                say(f"{output}  {cols} x {rows}  {100 * mask.mean():.1f} % valid  {milliseconds:.2f} ms", sys.stdout)
    if args.mask is not None and failed < len(headers):
        imagefile.write(args.mask, np.where(mask, np.uint8(255), np.uint8(0)), imagefile.Look("L"))
        if not args.quiet:
            _print(f"{args.mask}  {mask.shape[1]} x {mask.shape[0]}  mask")
    if failed:
        raise FileError(f"{failed} of {len(headers)} images could not be read, see above; the others were written")


# ---------------------------------------------------------------------------------------------------------------------
# Steps of `warp`


def _read_camera(path: str, image_size: tuple[int, int]) -> ipm_rs.Camera:
    return ipm_rs.Camera.from_cityscapes(path, image_size=image_size)


def _resolution(numbers: list[float]) -> float | tuple[float, float]:
    if len(numbers) > 2:
        raise ArgumentError(f"--resolution: expected DX or DX DY, got {len(numbers)} numbers; give one or two")
    return numbers[0] if len(numbers) == 1 else (numbers[0], numbers[1])


def _check_image(header: imagefile.Header, camera: ipm_rs.Camera, interpolation: str) -> None:
    """Refuse an image that does not fit the camera or the interpolation, and tell of what is left out."""
    if header.size != tuple(camera.image_size):
        (width, height), (wanted_width, wanted_height) = header.size, camera.image_size
        raise ImageError(
            f"{header.path}: expected {wanted_width}x{wanted_height} pixels, as the calibration was made for, got "
            f"{width}x{height}; if it was made for {width}x{height}, give --image-size {width} {height}; if the image "
            "was scaled since, use the original, or Camera.resized() in Python"
        )
    if interpolation != "nearest" and header.mode in ("P", "1"):
        kind = "a label image with a palette" if header.mode == "P" else "a 1-bit image"
        raise ArgumentError(
            f"{header.path}: expected --interpolation nearest for {kind}, got {interpolation}, which would mix its "
            "values; give --interpolation nearest, or convert the image to RGB or grey"
        )
    if header.orientation != 1:
        _print(f"ipm-rs: warning: {header.path}: EXIF orientation {header.orientation} is not applied", sys.stderr)
    if header.frames > 1:
        _print(f"ipm-rs: warning: {header.path}: the first of {header.frames} frames is used", sys.stderr)


def _outputs(text: str, headers: list[imagefile.Header]) -> list[Path]:
    """Names of the outputs: the one given, or one per image in the directory given."""
    if not text:
        raise ArgumentError("-o: expected a file or a directory, got an empty name; give one")
    path = Path(text)
    names_directory = path.is_dir() or text.endswith(tuple(filter(None, (os.sep, os.altsep))))
    if len(headers) == 1 and not names_directory:
        return [path]
    if not names_directory and (path.exists() or path.suffix.lower() in imagefile.FORMATS):
        raise ArgumentError(f"-o: expected a directory for {len(headers)} images, got {text}; give a directory")
    if path.exists() and not path.is_dir():
        raise ArgumentError(f"-o: expected a directory, got {text}, which is a file; give another name")
    return [path / f"{header.path.stem}_bev{'.tif' if header.mode == 'F' else '.png'}" for header in headers]


def _check_outputs(outputs: list[Path], headers: list[imagefile.Header], args: argparse.Namespace) -> None:
    """Refuse outputs that cannot hold the pixels, exist, coincide, or are inputs."""
    sources = [Path(args.calibration), *(header.path for header in headers)]
    contents = [(output, header.mode, str(header.path)) for output, header in zip(outputs, headers, strict=True)]
    if args.mask is not None:
        contents.append((args.mask, "L", "the mask"))
        if args.mask.suffix.lower() in (".jpg", ".jpeg"):
            raise ArgumentError(f"--mask: expected a lossless format, got {args.mask}; use .png")
    directory = None if outputs == [Path(args.output)] else Path(args.output)  # made later if it does not exist
    taken: dict[str, str] = {}
    for path, mode, what in contents:
        imagefile.check_format(path, mode, what)
        other = taken.setdefault(os.path.normcase(os.path.realpath(path)), what)
        if other is not what:
            raise ArgumentError(f"{path}: expected one output per image, got it from {other} and {what}; rename one")
        if path.exists() and any(source.exists() and path.samefile(source) for source in sources):
            raise ArgumentError(f"{path}: expected an output, got an input; give another name, also with --force")
        _check_output(path, may_exist=args.force, may_make=path.parent == directory)


def _check_output(path: Path, *, may_exist: bool, may_make: bool = False) -> None:
    """Refuse an output that exists or whose directory does not; with ``may_make`` its directory will be made."""
    if os.path.lexists(path):
        if path.exists() and not path.is_file():
            kind = "a directory" if path.is_dir() else "no regular file"
            raise FileError(f"{path}: expected a file to write, got {kind}; give another name")
        if not may_exist:
            raise FileError(f"{path}: expected a new file, got one that exists; give another name, or --force")
    directory = Path(os.path.realpath(path)).parent
    while may_make and not directory.exists():
        directory = directory.parent
    if not directory.is_dir():
        raise FileError(f"{path}: expected its directory to exist, found none; make {path.parent} first")
    if not os.access(directory, os.W_OK):
        raise FileError(f"{path}: expected a directory to write in, got no permission; choose another")


def _rehearse(headers: list[imagefile.Header], options: dict[str, Any]) -> None:
    """Warp one pixel of each kind of image, so that what the core refuses is refused before any work."""
    one = ipm_rs.Lut.from_maps(np.zeros((1, 1), np.float32), np.zeros((1, 1), np.float32), source_size=(1, 1))
    for header in {header.mode: header for header in headers}.values():
        try:
            one.warp(header.blank(), **options)
        except IpmError as error:
            raise type(error)(f"{header.path} (mode {header.mode}): {error}") from error


def _why_blind(camera: ipm_rs.Camera, grid: ipm_rs.BevGrid, ground: float) -> str:
    """Say why no cell of the grid is seen, as far as the geometry tells."""
    x, y, z = camera.position
    forward, left, up = camera.vehicle_from_camera[:3, 2]
    heading, climb = math.degrees(math.atan2(left, forward)), math.degrees(math.atan2(up, math.hypot(forward, left)))
    corners = np.array([(corner_x, corner_y) for corner_x in grid.x for corner_y in grid.y])
    _, depth, _ = camera.project(corners, ground=ground)
    reason = "the grid is outside its image" if (depth > 0).any() else "the whole grid is behind it"
    return (
        f"no cell of the grid is seen by the camera: camera at ({x:.2f}, {y:.2f}, {z:.2f}) m, looks "
        f"{abs(heading):.1f} degrees to the {'left' if heading >= 0 else 'right'} of +x and {abs(climb):.1f} degrees "
        f"{'up' if climb > 0 else 'down'}; {reason}; check --x, --y, --ground and the calibration"
    )


# ---------------------------------------------------------------------------------------------------------------------
# Printing

_Jobs = Iterable[tuple[imagefile.Header, Path]]
_Say = Callable[[str, TextIO], None]
_Progress = Callable[[_Jobs], contextlib.AbstractContextManager[tuple[_Jobs, _Say]]]


@contextlib.contextmanager
def _no_progress(jobs: _Jobs) -> Iterator[tuple[_Jobs, _Say]]:
    yield jobs, _print


def _progress_bar() -> _Progress:
    """Return what shows a bar on stderr while the jobs are gone through, and prints lines above it."""
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise MissingExtraError(
            'expected tqdm, which shows the progress, found none; install it with: pip install "ipm-rs[cli]", or give '
            "--quiet"
        ) from error

    @contextlib.contextmanager
    def progress(jobs: _Jobs) -> Iterator[tuple[_Jobs, _Say]]:
        with tqdm(jobs, unit="image", file=sys.stderr) as bar:

            def say(line: str, stream: TextIO) -> None:
                with tqdm.external_write_mode(file=stream):
                    _print(line, stream)

            yield bar, say

    return progress


def _print(line: str, stream: TextIO | None = None, *, end: str = "\n") -> None:
    """Print now; a name that the terminal cannot show is escaped, and a reader who has gone away is no error."""
    stream = sys.stdout if stream is None else stream
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        print(line.encode(encoding, "backslashreplace").decode(encoding), end=end, file=stream, flush=True)
    except BrokenPipeError:
        _discard(stream)


def _discard(stream: TextIO) -> None:
    """Send what is still to come on a stream to nowhere, so that the interpreter's last flush does not fail either."""
    with contextlib.suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
