"""Writes real bags with rosbags: ROS 1, ROS 2 (sqlite) and MCAP, of whatever messages a test wants."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

KINDS = ("bag", "db3", "mcap")


@functools.cache
def store_of(kind: str) -> Any:
    if kind != "bag":
        return get_typestore(Stores.ROS2_HUMBLE)
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    return store


class Bag:
    """A bag that is being written; `stamp` is in seconds."""

    def __init__(self, path: Path, kind: str) -> None:
        self.path, self.kind = path, kind
        self.store = store_of(kind)
        self.connections: dict[str, Any] = {}
        if kind == "bag":
            self.writer: Any = rosbag1.Writer(path)
        else:
            plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
            self.writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)

    def __enter__(self) -> Bag:
        self.writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def header(self, stamp: float, frame: str = "") -> Any:
        types = self.store.types
        nanoseconds = round(stamp * 1e9)
        time = types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        more = {"seq": 0} if self.kind == "bag" else {}
        return types["std_msgs/msg/Header"](stamp=time, frame_id=frame, **more)

    def write(self, topic: str, message: Any, logged: float) -> None:
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, message.__msgtype__, typestore=self.store)
        pack = self.store.serialize_ros1 if self.kind == "bag" else self.store.serialize_cdr
        self.writer.write(self.connections[topic], round(logged * 1e9), pack(message, message.__msgtype__))

    def image(
        self, topic, pixels, encoding, stamp, *, frame="cam", size=None, height=None, big=False, padding=0, logged=None
    ):
        """An Image message of an array of bytes or samples; `size` where the array is not shaped like it.

        `height` where it has more rows than the picture: planes of chroma.
        """
        rows, cols = (size[1], size[0]) if size else pixels.shape[:2]
        if big:
            pixels = pixels.astype(pixels.dtype.newbyteorder(">"))
        lines = np.frombuffer(pixels.tobytes(), np.uint8).reshape(rows, -1)
        lines = np.pad(lines, [(0, 0), (0, padding)])
        message = self.store.types["sensor_msgs/msg/Image"](
            header=self.header(stamp, frame),
            height=height or rows,
            width=cols,
            encoding=encoding,
            is_bigendian=int(big),
            step=lines.shape[1],
            data=lines.ravel(),
        )
        self.write(topic, message, stamp if logged is None else logged)

    def compressed(self, topic, data: bytes, form, stamp, frame="cam"):
        message = self.store.types["sensor_msgs/msg/CompressedImage"](
            header=self.header(stamp, frame), format=form, data=np.frombuffer(data, np.uint8)
        )
        self.write(topic, message, stamp)

    def info(self, topic, K, size, stamp, frame="cam", D=(0.0,) * 5):
        types = self.store.types
        roi = types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        K = np.asarray(K, float)
        fields = {"K": K.ravel(), "D": np.array(D), "R": np.eye(3).ravel(), "P": np.c_[K, np.zeros(3)].ravel()}
        if self.kind != "bag":
            fields = {name.lower(): value for name, value in fields.items()}
        message = types["sensor_msgs/msg/CameraInfo"](
            header=self.header(stamp, frame),
            width=size[0],
            height=size[1],
            distortion_model="plumb_bob",
            binning_x=0,
            binning_y=0,
            roi=roi,
            **fields,
        )
        self.write(topic, message, stamp)

    def tf(self, transforms: Iterable[tuple[str, str, Any, Any]], stamp, static=False):
        """`(parent, child, (x, y, z), (w, x, y, z))` at a moment."""
        types = self.store.types
        listed = []
        for parent, child, place, turn in transforms:
            vector = types["geometry_msgs/msg/Vector3"](**dict(zip("xyz", map(float, place), strict=True)))
            rotation = types["geometry_msgs/msg/Quaternion"](**dict(zip("wxyz", map(float, turn), strict=True)))
            transform = types["geometry_msgs/msg/Transform"](translation=vector, rotation=rotation)
            listed.append(
                types["geometry_msgs/msg/TransformStamped"](
                    header=self.header(stamp, parent), child_frame_id=child, transform=transform
                )
            )
        message = types["tf2_msgs/msg/TFMessage"](transforms=listed)
        self.write("/tf_static" if static else "/tf", message, stamp)

    def text(self, topic, stamp):
        self.write(topic, self.store.types["std_msgs/msg/String"](data="hello"), stamp)
