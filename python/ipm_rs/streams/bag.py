"""ROS 1 bags, ROS 2 bags and MCAP, through rosbags (extra ``bags``).

* `topic` is one of ``sensor_msgs/Image`` or ``CompressedImage``; it may be left out where there is only one.
* Encodings: mono8, mono16, rgb8, bgr8, rgba8, bgra8 and their 16 bits, ``bayer_*8`` and ``16``, yuv422 and yuyv,
  nv12, nv21, nv24, 16UC1, 16SC1, 32FC1, 64FC1; compressed: whatever Pillow reads, JPEG and PNG above all, and
  compressedDepth, PNG or RVL, as uint16 or as float32 metres with NaN where the depth is not known.
* Timestamps are the messages' own (``header.stamp``), in seconds since 1970; ``clock="log"`` takes the recorder's,
  which never go back. ``start=`` and ``end=`` count from the first of the bag.
* The camera is that of the first ``camera_info`` beside the topic; its pose is what tf says of the image's ``frame_id``
  in `vehicle_frame`, and without one it is at the origin and looks along x. Topics whose name has ``rect`` in it are
  rectified images.
* Poses: tf from `vehicle_frame` to `map_frame`, interpolated to each frame's timestamp; None where tf does not reach.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import flag_of
from ipm_rs._core import Camera
from ipm_rs.calibration import ros
from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError, MissingExtraError
from ipm_rs.files import images
from ipm_rs.files.atomic import check_source, reading
from ipm_rs.streams._depth import depth_of, is_depth
from ipm_rs.streams._encodings import demosaiced, pixels_of
from ipm_rs.streams._frame import Frame, Stream, Ticket, bad_ticket
from ipm_rs.streams._tf import Transforms

__all__ = ["TITLE", "read", "recognises"]

TITLE = "a ROS bag or MCAP"
_ENDINGS = (".bag", ".mcap", ".db3")
_IMAGE, _COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
_INFO = "sensor_msgs/msg/CameraInfo"
_TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_MAPS = ("map", "odom", "world")
_WANTED = "a ROS bag"


def recognises(path: str) -> bool:
    """Say whether a path ends as bags do, or is a directory of one."""
    place = Path(path)
    return place.suffix.lower() in _ENDINGS or (place.is_dir() and bool(_storage(place)))


def read(
    path: str,
    topic: str | None = None,
    camera_info: str | None = None,
    vehicle_frame: str = "base_link",
    map_frame: str | None = None,
    clock: str = "header",
    max_gap: float = 1.0,
    poses: bool = True,
) -> Stream:
    """Open a bag, and look at its index, its first picture and its calibration.

    Parameters
    ----------
    path : str
        A ``.bag``, ``.mcap`` or ``.db3`` file, or the directory of a ROS 2 bag.
    topic : str, optional
        Of the images; needed where there are several.
    camera_info : str, optional
        Topic of the calibration; by default ``camera_info`` beside the images.
    vehicle_frame, map_frame : str
        Frames of tf. `map_frame` is by default the first of map, odom and world that tf leads to.
    clock : {"header", "log"}
        Whose timestamps.
    max_gap : float
        Seconds that two transforms may be apart for a pose between them.
    poses : bool
        Whether tf is read for the frames' poses, all of it before the first frame.

    Raises
    ------
    MissingFileError, FileError
        There is no such bag, or it is cut short or damaged.
    ArgumentError, ArgumentTypeError
        There is no such topic, or several and none is given: the message lists them. Another argument is wrong.
    ImageError
        The encoding of the images is unknown.
    CalibrationError
        The calibration cannot be right.
    MissingExtraError
        rosbags is not installed.
    """
    for name, value in (("topic", topic), ("camera_info", camera_info), ("map_frame", map_frame)):
        if value is not None and not isinstance(value, str):
            raise ArgumentTypeError(f"{name}: expected a name, got {type(value).__name__}")
    if not isinstance(vehicle_frame, str):
        raise ArgumentTypeError(f"vehicle_frame: expected a name, got {type(vehicle_frame).__name__}")
    if not isinstance(clock, str) or clock not in ("header", "log"):
        raise ArgumentError("clock: expected 'header' or 'log'; choose one")
    flag_of("poses", poses)
    place = Path(path)
    if not place.is_dir():
        check_source(place, _WANTED)
    bag = _Bag(place)
    with bag.opened() as reader:
        connections = _chosen(path, reader, topic)
        name = connections[0].topic
        begin = bag.first(reader, connections, 2)
        if not begin:
            raise FileError(f"{path}: expected pictures in {name}, got none; choose another topic")
        tree = Transforms(max_gap)
        for message in bag.messages(reader, _of(reader, _TF, fixed=True)):
            tree.add(message, fixed=True)
        source = _Source(path, bag, name, clock, vehicle_frame.strip("/"), map_frame, max_gap)
        camera = source.camera_of(reader, camera_info, tree, begin[0][1])
        picture = source.pixels(begin[0][1], f"{path}: {name}")
        count = sum(connection.msgcount for connection in connections)
    moments = [source.moment(*each) for each in begin]
    step = moments[-1] - moments[0]
    return Stream(
        path,
        functools.partial(_tickets, source, camera, poses),
        count=count,
        rate=1 / step if step > 0 else None,
        size=(picture.shape[1], picture.shape[0]),
        camera=camera,
        origin=moments[0],
    )


class _Bag:
    """A bag on the disk, which is opened anew for each use."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.make, self.parse = _tools(path.suffix.lower() == ".bag")

    @contextlib.contextmanager
    def opened(self) -> Iterator[Any]:
        """Open it; whatever goes wrong in the block becomes one of our errors."""
        path = self.path
        if path.is_dir() and not (path / "metadata.yaml").is_file():
            files = _storage(path)
            if len(files) > 1:
                raise FileError(
                    f"{path}: expected the metadata.yaml of a ROS 2 bag, found none beside {len(files)} files; run: "
                    f"ros2 bag reindex {path}"
                )
            path = files[0]
        with reading(self.path, _WANTED), self.make(path) as reader:
            yield reader

    def messages(self, reader: Any, connections: list[Any]) -> Iterator[Any]:
        """Give the messages of some connections."""
        if connections:
            for connection, _, data in reader.messages(connections=connections):
                yield self.message(connection, data)

    def first(self, reader: Any, connections: list[Any], count: int = 1) -> list[tuple[int, Any]]:
        """Return the first messages, each with when it was recorded, in nanoseconds."""
        found = itertools.islice(reader.messages(connections=connections), count)
        return [(logged, self.message(connection, data)) for connection, logged, data in found]

    def message(self, connection: Any, data: bytes) -> Any:
        """Return a message of its bytes."""
        kind = _TF[0] if connection.msgtype in _TF else connection.msgtype
        return self.parse(data, kind)


@functools.cache
def _tools(is_first: bool) -> tuple[Any, Any]:
    """Return the reader's class and the parser of messages, of ROS 1 or 2.

    The messages that are read here are the same in every release, so a bag's own definitions are not needed: old ROS 2
    bags have none, and one odd definition of another topic would spoil the whole.
    """
    try:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MissingExtraError(
            'expected rosbags, which reads bags and MCAP, found none; install it with: pip install "ipm-rs[bags]"'
        ) from error
    store = get_typestore(Stores.ROS1_NOETIC if is_first else Stores.ROS2_HUMBLE)
    if is_first:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _TF[0]))
        return rosbag1.Reader, store.deserialize_ros1
    return rosbag2.Reader, store.deserialize_cdr


@dataclass(frozen=True)
class _Source:
    """A topic of a bag, and how it is read."""

    path: str
    bag: _Bag
    topic: str
    clock: str
    vehicle_frame: str
    map_frame: str | None
    max_gap: float

    def moment(self, logged: int, message: Any) -> float:
        """Return the seconds of a message; a header without a stamp has the recorder's."""
        stamp = message.header.stamp
        nanoseconds = stamp.sec * 1_000_000_000 + stamp.nanosec
        return (nanoseconds if nanoseconds and self.clock == "header" else logged) / 1e9

    def pixels(self, message: Any, origin: str) -> NDArray[Any]:
        """Return the picture of a message."""
        if not hasattr(message, "format"):
            return pixels_of(message, origin)
        data, form = bytes(message.data), str(message.format)
        if is_depth(form):
            return depth_of(form, data, origin)
        return demosaiced(images.decode(data, origin)[0], form.partition(";")[0].strip())

    def camera_of(self, reader: Any, topic: str | None, tree: Transforms, first: Any) -> Camera | None:
        """Return the calibration beside the topic, posed by tf; None where there is none."""
        found = _info(reader, self.topic, topic, self.path)
        if not found:
            return None
        message = next((one for _, one in self.bag.first(reader, found)), None)
        if message is None or not np.any(getattr(message, "K", getattr(message, "k", 0))):
            return None  # ROS's mark of a camera that is not calibrated
        frame = first.header.frame_id or message.header.frame_id
        pose = tree.between(self.vehicle_frame, frame)
        rectified = "rect" in self.topic
        return ros.read(message, image="rectified" if rectified else "raw", vehicle_from_camera=pose)


def _tickets(source: _Source, camera: Camera | None, poses: bool) -> Iterator[Ticket]:
    bag, path = source.bag, source.path
    tree = _moving(source) if poses else None
    last: float | None = None
    with bag.opened() as reader:
        connections = _chosen(path, reader, source.topic)
        messages = reader.messages(connections=connections)
        for index, (connection, logged, data) in enumerate(messages):
            name = f"{index:06d}"
            try:
                message = bag.message(connection, data)
                time = source.moment(logged, message)
            except Exception as error:  # the parser raises what it likes of damaged bytes
                reason = " ".join(str(error).split())[:120] or type(error).__name__
                yield bad_ticket(path, name, index, f"a message that can be read, got: {reason}")
                continue
            if last is not None and time <= last:
                back = f"timestamps that grow, got {time:.6f} s after {last:.6f} s (clock='log' takes the recorder's)"
                yield bad_ticket(path, name, index, back)
                continue
            last = time
            pose = None if tree is None else tree[0].between(tree[1], source.vehicle_frame, time)
            load = functools.partial(_load, source, message, name, index, time, camera, pose)
            yield Ticket(name, index, time, load)


def _load(source: _Source, message: Any, name: str, index: int, time: float, camera: Camera | None, pose: Any) -> Frame:
    picture = source.pixels(message, f"{source.path}: frame {index} of {source.topic}")
    return Frame(picture, name, index, time, camera, pose)


def _moving(source: _Source) -> tuple[Transforms, str] | None:
    """Return tf with all that moves, and the frame of the map; None where tf does not lead from the vehicle to one."""
    tree = Transforms(source.max_gap)
    with source.bag.opened() as reader:
        for fixed in (True, False):
            for message in source.bag.messages(reader, _of(reader, _TF, fixed=fixed)):
                tree.add(message, fixed=fixed)
    above = tree.parents(source.vehicle_frame)[1:]
    if source.map_frame is not None:
        wanted = source.map_frame.strip("/")
        if wanted not in above:
            known = ", ".join(tree.frames()) or "none"
            raise ArgumentError(
                f"map_frame: expected a frame above {source.vehicle_frame}, got {wanted!r:.60}; tf knows {known:.300}"
            )
        return tree, wanted
    found = next((name for name in _MAPS if name in above), None)
    return None if found is None else (tree, found)


def _of(reader: Any, types: tuple[str, ...], *, fixed: bool) -> list[Any]:
    """Return the connections of transforms that stand for good, or of those that move."""
    return [
        connection
        for connection in reader.connections
        if connection.msgtype in types and connection.topic.endswith("tf_static") == fixed
    ]


def _chosen(path: str, reader: Any, topic: str | None) -> list[Any]:
    """Return the connections of the images."""
    pictures: dict[str, list[Any]] = {}
    for connection in reader.connections:
        if connection.msgtype in (_IMAGE, _COMPRESSED):
            pictures.setdefault(connection.topic, []).append(connection)
    listed = ", ".join(f"{name} ({sum(one.msgcount for one in found)})" for name, found in sorted(pictures.items()))
    if topic is None and len(pictures) == 1:
        return next(iter(pictures.values()))
    if topic is None:
        others = ", ".join(sorted({connection.topic for connection in reader.connections})) or "none"
        if not pictures:
            raise FileError(f"{path}: expected a topic of images, found none; its topics are {others:.600}")
        raise ArgumentError(f"{path}: expected a topic, got none; give one of {listed:.600} (--topic)")
    wanted = next((name for name in (topic, f"/{topic}") if name in pictures), None)
    if wanted is None:
        other = next((one for one in reader.connections if one.topic in (topic, f"/{topic}")), None)
        got = f"{topic!r:.80}" if other is None else f"{topic!r:.80}, which is of {other.msgtype}"
        raise ArgumentError(
            f"{path}: expected a topic of images, got {got}; those there are {listed or 'none':.600} (--topic)"
        )
    return pictures[wanted]


def _info(reader: Any, topic: str, wanted: str | None, path: str) -> list[Any]:
    """Return the connections of the calibration."""
    infos: dict[str, list[Any]] = {}
    for connection in reader.connections:
        if connection.msgtype == _INFO:
            infos.setdefault(connection.topic, []).append(connection)
    if wanted is not None:
        if wanted not in infos:
            listed = ", ".join(sorted(infos)) or "none"
            raise ArgumentError(
                f"{path}: camera_info: expected a topic of CameraInfo, got {wanted!r:.80}; those there are "
                f"{listed:.600}"
            )
        return infos[wanted]
    # image_transport's rule, beside the topic without its transport; or beside or below the topic itself
    base = re.sub(r"/compressed$", "", topic)
    places = (base.rpartition("/")[0], topic.rpartition("/")[0], topic)
    return next((infos[f"{place}/camera_info"] for place in places if f"{place}/camera_info" in infos), [])


def _storage(path: Path) -> list[Path]:
    """Return the files of a ROS 2 bag in a directory, or its metadata alone."""
    if (path / "metadata.yaml").is_file():
        return [path / "metadata.yaml"]
    return sorted(entry for ending in (".mcap", ".db3") for entry in path.glob(f"*{ending}"))
