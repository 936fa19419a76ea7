"""Files to files on a cluster: in partitions, each of which is whole or is done again."""

from __future__ import annotations

import hashlib
import json
import os
import posixpath
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal

import numpy as np

from ipm_rs import errors
from ipm_rs._arguments import flag_of
from ipm_rs._core import Lut
from ipm_rs.errors import ArgumentError, FileError, IpmError, MissingExtraError, OutOfMemoryError
from ipm_rs.files import images
from ipm_rs.ray._batches import checked_options, checked_table, refuse_labels
from ipm_rs.ray._cluster import connected, pool, require_ray, resolved, whole
from ipm_rs.ray._places import Place, listed, place_of
from ipm_rs.streams import Summary

__all__ = ["warp_files"]

RECORDS = "_ipm_rs"
"""The folder of the output in which it is recorded which partitions are done, and of which table."""


@dataclass(frozen=True)
class _Partition:
    """Frames that a worker does one after another; `key` is of their names."""

    key: str
    inputs: list[str]
    outputs: list[str]


class _Worker:
    """What an actor does; it keeps the table from one partition to the next."""

    def __init__(
        self, lut: Any, source: Place, target: Place, options: dict[str, Any], ending: str, level: int, strict: bool
    ) -> None:
        self.lut, self.source, self.target = checked_table(resolved(lut)), source, target
        self.options, self.ending, self.level, self.strict = options, ending, level, strict

    def __call__(self, row: dict[str, Any]) -> dict[str, Any]:
        """Do a partition, and say what became of it.

        What ends the whole run is returned like the rest: of an exception Ray hands on a traceback, and not its kind.
        """
        failed: list[IpmError] = []
        try:
            for name, output in zip(row["inputs"], row["outputs"], strict=True):
                try:
                    data = self._view(str(name))
                except (MissingExtraError, OutOfMemoryError):  # the next would fail alike
                    raise
                except IpmError as error:
                    if self.strict:
                        raise
                    failed.append(error)
                    continue
                self.target.at(str(output)).write(data)
            if not failed:  # what failed is tried again next time
                record = json.dumps({"frames": len(row["inputs"])})
                (self.target / RECORDS / f"part-{row['key']}.json").write(record.encode())
        except IpmError as error:
            return {"done": 0, "failed": "[]", "fatal": _packed([error])}
        return {"done": len(row["inputs"]) - len(failed), "failed": _packed(failed), "fatal": "[]"}

    def _view(self, name: str) -> bytes:
        pixels, look = images.decode(self.source.at(name).read(), name)
        try:
            refuse_labels(look, self.options)
            return images.encode(self.ending, self.lut.warp(pixels, **self.options), look, self.level)
        except IpmError as error:
            raise type(error)(f"{name}: {error}") from error


def warp_files(
    source: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    lut: Lut,
    output: str | os.PathLike[str],
    *,
    workers: int | None = None,
    partition: int = 100,
    ending: str = ".png",
    level: int = 1,
    interpolation: Literal["nearest", "bilinear", "cubic", "lanczos4", "area", "mode"] = "bilinear",
    border_value: float | list[float] = 0,
    recursive: bool = False,
    strict: bool = False,
    overwrite: bool = False,
    filesystem: Any = None,
    address: str | None = None,
    report: Callable[[int, list[IpmError]], None] | None = None,
    **ray_options: Any,
) -> Summary:
    """Warp image files to image files on a cluster; what was stopped goes on where it stopped.

    The images are shared out in partitions. A worker reads, decodes, warps, encodes and writes those of one after
    another, so that no picture travels between machines, and records in ``<output>/_ipm_rs`` that the partition is
    done. The same call again does only the partitions that are not. A worker that dies is replaced, and its partition
    done again: files are written whole or not at all, and the same bytes each time.

    Parameters
    ----------
    source : path, URI, or list of them
        A folder, a pattern or a ``.txt`` list on this machine; a folder, or a pattern in its last part, as
        ``"s3://bucket/drive/*.jpg"``; or the images one by one. Every worker must be able to read it: on several
        machines a mounted folder or an object store.
    lut : Lut
        The table; it goes to each machine once.
    output : path or URI
        A folder; each image becomes ``<name>_bev<ending>``, below the folders that the images do not have in common.
    workers : int, optional
        Actors, each of one CPU. By default as many as there is work and room for.
    partition : int
        Images of a partition: what is lost when a worker dies. Counted from the first on, so that images added at the
        end leave those that are done as they are.
    ending : str
        ``".png"``, ``".jpg"``, ``".tif"`` or ``".bmp"``.
    level : int
        Of PNG's compression, 0 to 9.
    interpolation, border_value
        Of `Lut.warp`.
    recursive : bool
        Also the images in the folders below.
    strict : bool
        Stop at the first image that cannot be read or does not fit; otherwise it is left out and told of, and its
        partition is done again by the next call.
    overwrite : bool
        Do everything again, also where the output is of another table or other options, which is refused otherwise.
    filesystem : pyarrow.fs.FileSystem or fsspec filesystem, optional
        What `source` and `output` are paths of, where a URI cannot say it (credentials, an endpoint).
    address : str, optional
        Of the cluster, ``"auto"`` for the one that this machine belongs to, ``"local"`` for one of this machine's CPUs.
        By default what this process or ``RAY_ADDRESS`` says, else ``"local"``.
    report : callable, optional
        Called when a partition is done with the number of its images and the errors of those that failed.
    **ray_options
        Of Ray Data's `map`: ``num_cpus=``, ``memory=``, ``resources=``, ``runtime_env=``, ...

    Returns
    -------
    Summary
        Images done, left out because their partitions were done before, and failed.

    Raises
    ------
    MissingExtraError
        Ray or Pillow is not installed.
    MissingFileError, FileError
        There are no images, the output is of another table, or cannot be written.
    ArgumentError, ArgumentTypeError
        An argument is wrong, or there is no cluster at the address.
    """
    lut = checked_table(lut)
    options = checked_options(lut, interpolation, border_value, 1)
    level, partition = whole("level", level, 0, 9), whole("partition", partition, 1, 1_000_000)
    if not isinstance(ending, str) or ending not in images.FORMATS:
        raise ArgumentError(f"ending: expected {', '.join(images.FORMATS)}, got another; choose one")
    flags = [("recursive", recursive), ("strict", strict), ("overwrite", overwrite)]
    recursive, strict, overwrite = (flag_of(name, value) for name, value in flags)
    images.require_pillow()
    require_ray()
    workers = None if workers is None else whole("workers", workers, 1, 1_000_000)
    target = place_of("output", output, filesystem)
    sources = listed(source, filesystem, recursive)
    parts = _partitions([place.path for place in sources], target, partition, ending)
    identity = _identity(lut, options, ending, level)
    done = _begin(target, identity, overwrite)
    summary, begin = Summary(), perf_counter()
    summary.skipped = sum(len(part.inputs) for part in parts if part.key in done)
    todo = [vars(part) for part in parts if part.key not in done]
    if todo:
        with connected(address) as ray:
            context = ray.data.DataContext.get_current()
            shown, context.enable_progress_bars = context.enable_progress_bars, False
            try:
                ray_options.setdefault("num_cpus", 1)
                results = ray.data.from_items(todo, override_num_blocks=len(todo)).map(
                    _Worker,
                    fn_constructor_args=(ray.put(lut), sources[0], target, options, ending, level, strict),
                    compute=pool(ray, workers),
                    **ray_options,
                )
                for row in results.iter_rows():
                    for error in _unpacked(row["fatal"]):
                        raise error
                    failed = _unpacked(row["failed"])
                    summary.done += row["done"]
                    summary.failed += failed
                    if report is not None:
                        report(row["done"], failed)
            finally:
                context.enable_progress_bars = shown
    summary.seconds = perf_counter() - begin
    return summary


def _partitions(inputs: list[str], target: Place, size: int, ending: str) -> list[_Partition]:
    """Share images out, so many each.

    Raises
    ------
    ArgumentError
        Two would have the same output.
    """
    common = posixpath.commonpath([posixpath.dirname(path) for path in inputs]) if inputs else ""
    taken: dict[str, str] = {}
    for path in inputs:
        stem = posixpath.splitext(posixpath.relpath(path, common or "."))[0]
        other = taken.setdefault((target / f"{stem}_bev{ending}").path, path)
        if other is not path:
            raise ArgumentError(
                f"source: expected images of different names, got {other} and {path}, which would both become "
                f"{stem}_bev{ending}; rename one"
            )
    outputs = list(taken)
    pieces = [(inputs[k : k + size], outputs[k : k + size]) for k in range(0, len(inputs), size)]
    return [_Partition(_digest("\0".join(names + views).encode()), names, views) for names, views in pieces]


def _identity(lut: Lut, options: dict[str, Any], ending: str, level: int) -> dict[str, Any]:
    """Return what two runs into one folder must have in common."""
    map_x, map_y = lut.maps()
    table = _digest(map_x.tobytes(), map_y.tobytes(), repr(lut.source_size).encode())
    border = [repr(value) for value in np.asarray(options["border_value"], float).ravel().tolist()]  # NaN is not NaN
    return {
        "table": table,
        "interpolation": options["interpolation"],
        "border_value": border,
        "ending": ending,
        "level": level,
    }


def _begin(target: Place, identity: dict[str, Any], overwrite: bool) -> set[str]:
    """Record whose the output is, and return the keys of the partitions that are done.

    Raises
    ------
    FileError
        It is another table's.
    """
    records = target / RECORDS
    found = {posixpath.basename(path): path for path in records.files()}
    if "run.json" in found:
        text = records.at(found["run.json"]).read()
        try:
            before = json.loads(text)
        except ValueError:
            before = None
        if before != identity and not overwrite:
            old = before if isinstance(before, dict) else {}
            other = [key for key, value in identity.items() if old.get(key) != value]
            raise FileError(
                f"{target.path}: expected an empty folder or one of the same table and options, got one of another "
                f"{', '.join(other)}; give another folder, or overwrite=True"
            )
    if overwrite:
        for name, path in found.items():
            if name != "run.json":
                records.at(path).remove()
    if "run.json" not in found or overwrite:
        (records / "run.json").write(json.dumps(identity).encode())
    if overwrite:
        return set()
    return {name[5:-5] for name in found if name.startswith("part-") and name.endswith(".json")}


def _packed(failed: list[IpmError]) -> str:
    return json.dumps([[type(error).__name__, str(error)] for error in failed])


def _unpacked(text: str) -> list[IpmError]:
    return [getattr(errors, kind)(words) for kind, words in json.loads(text)]


def _digest(*data: bytes) -> str:
    return hashlib.sha256(b"\0\0".join(data)).hexdigest()[:32]
