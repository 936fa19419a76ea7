"""The cameras of a file that has a section for each: which there are, and all that the file says of the chosen one.

Known shapes, in YAML, JSON and mappings::

    front: {K, D}                        a section for each camera
    cameras: {front: {K, D}}             in a group of their own
    cameras: [{name: front, K, D}]       or in a list
    intrinsic: {front: {K, D}}           parts of one camera in several groups
    extrinsic: {front: {rvec, tvec}}
    intrinsic: {K, D}                    one camera in several places
    extrinsic: {left: {rvec, tvec}}
    front: {intrinsic: {K, D}, extrinsic: {rvec, tvec}}   a section for each camera, in parts
    rig: {cameras: {front: {K, D}}}      all of it in a section

What stands beside the sections (a common image size, a lens) belongs to every camera.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ipm_rs.calibration._checks import describe, listed
from ipm_rs.calibration._names import MAX_KEYS, SIZE, has_camera, spelled
from ipm_rs.errors import ArgumentError

__all__ = ["choose", "sections"]

_NAMES = ("name", "cameraname", "camera", "id", "cameraid", "label", "serial", "serialnumber")
_POSE = ("rvec", "tvec")
_INTRINSIC = (
    "intrinsic", "intrinsics", "intrinsicparameters", "cameraintrinsics", "calibration", "calib", "camerainfo", "lens",
)  # fmt: skip
_EXTRINSIC = ("extrinsic", "extrinsics", "extrinsicparameters", "cameraextrinsics", "pose", "transform")
_DEEPEST = 3
_MAX_KEYS = 30_000  # a rig of 500 cameras has 10 000 at three levels


def sections(content: Any, *, depth: int = 0) -> dict[str, dict[str, Any]]:
    """Each camera's name and values, where a file has a section for each; empty where one stands at the top."""
    if not isinstance(content, (Mapping, list, tuple)) or _is_table(content):
        return {}
    if not isinstance(content, Mapping):
        return _from_list(content, {})
    if has_camera(content):
        return {}
    groups = {
        str(key): _whole(value) for key, value in content.items() if _is_section(value) and spelled(key) not in SIZE
    }
    shared = {key: value for key, value in content.items() if str(key) not in groups and not _is_list(value)}
    found = {name: value for name, value in groups.items() if has_camera(value)}
    others = [value for name, value in groups.items() if name not in found]
    if len(found) == 1:
        return _one_in_places(found, shared, others)
    if not found:
        for name, group in groups.items():
            inner = {
                str(key): whole
                for key, value in group.items()
                if has_camera(whole := _whole(value)) and spelled(key) not in _INTRINSIC
            }
            if inner:
                found = inner
                others = [value for key, value in groups.items() if key != name]
                shared = merged(shared, {key: value for key, value in group.items() if not _is_section(value)})
                break
    if found:
        return {
            name: merged(shared, value, *(part for group in others if _is_section(part := group.get(name))))
            for name, value in found.items()
        }
    lists = (value for value in content.values() if _is_list(value))
    cameras = next((cameras for value in lists if (cameras := _from_list(value, shared))), {})
    if not cameras and len(groups) == 1 and depth < _DEEPEST:
        only = next(iter(groups.values()))
        inside = {} if any(spelled(key) in _INTRINSIC for key in only) else sections(only, depth=depth + 1)
        cameras = {name: merged(shared, value) for name, value in inside.items()}
    return cameras


def choose(cameras: Mapping[str, Any], camera: Any, origin: str) -> str:
    """Name of the camera that an argument ``camera=`` means; it may be left out where there is one.

    Raises
    ------
    ArgumentError
        There is no such camera, or several and none is named.
    """
    names = list(cameras)
    if camera is None and len(names) == 1:
        return names[0]
    plain = isinstance(camera, (str, int)) and not isinstance(camera, bool)
    found = [name for name in names if plain and name == str(camera)]
    found = found or [name for name in names if plain and spelled(name) == spelled(camera)]
    if len(found) != 1:
        got = "None" if camera is None else describe(camera)
        raise ArgumentError(f"{origin}: camera: expected one of {listed(names)}, got {got}; say which to read")
    return found[0]


def merged(*parts: Mapping[Any, Any]) -> dict[str, Any]:
    """Values of all parts; of the same name, those of the later part."""
    found: dict[str, tuple[str, Any]] = {}
    for part in parts:
        found |= {spelled(key): (str(key), value) for key, value in part.items()}
    return dict(found.values())


def _one_in_places(
    found: Mapping[str, Any], shared: Mapping[Any, Any], others: Sequence[Mapping[Any, Any]]
) -> dict[str, dict[str, Any]]:
    """One camera matrix: its poses may have names."""
    ((name, camera),) = found.items()
    for group in others:
        places = {str(key): value for key, value in group.items() if _has_pose(value)}
        if places:
            return {key: merged(shared, camera, value) for key, value in places.items()}
    return {name: merged(shared, camera, *(group for group in others if _has_pose(group)))}


def _from_list(values: Sequence[Any], shared: Mapping[Any, Any]) -> dict[str, dict[str, Any]]:
    """Cameras of a list, by the names that they state, or else by their numbers."""
    if len(values) > MAX_KEYS or not all(isinstance(value, Mapping) for value in values):
        return {}
    found = {}
    for index, part in enumerate(values):
        value = _whole(part)
        if has_camera(value):
            stated = {spelled(key): item for key, item in value.items() if isinstance(item, (str, int))}
            name = next((str(stated[key]) for key in _NAMES if key in stated), str(index))
            found[name if name not in found else f"{name} ({index})"] = merged(shared, value)
    return found


def _whole(value: Any) -> Any:
    """Return a camera's section whose matrix and pose stand in sections of their own as one; anything else as it is."""
    if not _is_section(value) or len(value) > MAX_KEYS or has_camera(value):
        return value
    parts = [part for part in value.values() if _is_section(part)]
    known = [part for key, part in value.items() if spelled(key) in _INTRINSIC and has_camera(part)]
    if len(known) != 1 or sum(map(has_camera, parts)) != 1:
        return value
    plain = {key: item for key, item in value.items() if not _is_section(item) or spelled(key) in SIZE}
    if any(spelled(key) in _EXTRINSIC and not _has_pose(part) for key, part in value.items() if _is_section(part)):
        return value  # a pose of which nothing is known
    return merged(plain, known[0], *(part for part in parts if _has_pose(part)))


def _is_table(content: Mapping[Any, Any] | Sequence[Any]) -> bool:
    """Whether there is too much at the first levels for a file of cameras."""
    level: list[Any] = [content]
    for _ in range(3):
        if sum(len(value) for value in level) > _MAX_KEYS:
            return True
        items = (item for value in level for item in (value.values() if isinstance(value, Mapping) else value))
        level = [item for item in items if isinstance(item, (Mapping, list, tuple))]
    return False


def _is_section(value: Any) -> bool:
    """Whether a value is a mapping, and no matrix that is written as one."""
    return isinstance(value, Mapping) and not {"rows", "cols", "data"} <= value.keys()


def _is_list(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and bool(value) and isinstance(value[0], Mapping)


def _has_pose(value: Any) -> bool:
    return _is_section(value) and {*_POSE} <= {spelled(key) for key in value}
