"""Draw the frames of docs/conventions.md: `python scripts/draw_frames.py docs/images/frames.svg`.

Each panel shows a car from behind, the right and above, and one frame's axes: x red, y green, z blue. A test
holds the committed picture against this script.
"""

from __future__ import annotations

import sys
from pathlib import Path

WIDTH, HEIGHT, COLUMNS = 300, 256, 2
SCALE = 34.0  # pixels in a metre
COLOURS = {"x": "#d33f3f", "y": "#2e9a4b", "z": "#3a6fd8"}
NAMES = {"forward": (1, 0, 0), "left": (0, 1, 0), "up": (0, 0, 1)}
NAMES |= {"right": (0, -1, 0), "down": (0, 0, -1)}

# Title, origin (metres ahead of the rear axle, to the left, above the road), directions of x, y and z, remark.
PANELS: list[tuple[str, tuple[float, float, float], tuple[str, str, str], str]] = [
    ("Vehicle (ISO 8855)", (0, 0, 0), ("forward", "left", "up"), "ipm_rs, Cityscapes, nuScenes, WoodScape, MATLAB"),
    (
        "Camera (optical)",
        (1.7, 0, 1.45),
        ("right", "down", "forward"),
        "ipm_rs, OpenCV, ROS, Kalibr, COLMAP, most data",
    ),
    (
        "Camera with vehicle axes",
        (1.7, 0, 1.45),
        ("forward", "left", "up"),
        "Cityscapes, Waymo, CARLA's sensors mirrored",
    ),
    ("Velodyne of KITTI", (0.8, 0, 1.73), ("forward", "left", "up"), "the road is at z = -1.73"),
    ("Road of KITTI", (0.8, 0, 0), ("right", "down", "forward"), "below the Velodyne; y points into the road"),
    ("Pose of KITTI-360", (0.0, 0, 0.9), ("forward", "right", "down"), "read as x forward, y left, z up"),
    ("Ego of Argoverse 2", (0, 0, 0.33), ("forward", "left", "up"), "at the height of the axle: road at z = -0.33"),
    ("Vehicle of CARLA", (1.3, 0, 0), ("forward", "right", "up"), "left-handed; mirrored on reading"),
]


def project(point: tuple[float, float, float]) -> tuple[float, float]:
    """Oblique view from behind, the right and above: forward goes up and right."""
    forward, left, up = point
    return 104 + SCALE * (1.05 * forward - 0.62 * left), 168 - SCALE * (0.42 * forward + 0.30 * left + up)


def line(a: tuple[float, float, float], b: tuple[float, float, float], style: str) -> str:
    """One straight line between two points in metres."""
    (x1, y1), (x2, y2) = project(a), project(b)
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" {style}/>'


def car() -> list[str]:
    """Wires of a car whose rear axle is at x = 0, and the road below it."""
    grey = 'stroke="#8a8f98" stroke-width="1.1"'
    outline = [(-0.9, 0.35), (-0.9, 1.0), (-0.4, 1.05), (0.0, 1.45), (1.4, 1.45), (2.1, 1.0), (3.4, 0.9), (3.5, 0.35)]
    lines = []
    for side in (0.85, -0.85):
        corners = [(x, side, z) for x, z in outline]
        lines += [line(a, b, grey) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    lines += [line((x, 0.85, z), (x, -0.85, z), grey) for x, z in outline]
    for x in (0.0, 2.6):
        cx, cy = project((x, -0.85, 0.33))
        lines.append(
            f'<ellipse cx="{cx:.1f}" cy="{cy:.1f}" rx="{0.33 * SCALE:.1f}" ry="{0.33 * SCALE:.1f}" fill="none" {grey}/>'
        )
    road = 'stroke="#8a8f98" stroke-width="0.8" stroke-dasharray="3 3" opacity="0.7"'
    lines += [line((-1.2, y, 0), (4.2, y, 0), road) for y in (1.3, -1.3)]
    return lines


def axes(origin: tuple[float, float, float], directions: tuple[str, str, str]) -> list[str]:
    """Three arrows of 1.2 m with their names."""
    parts = []
    for name, direction in zip("xyz", directions, strict=True):
        tip = tuple(o + 1.25 * d for o, d in zip(origin, NAMES[direction], strict=True))
        text = tuple(o + 1.62 * d for o, d in zip(origin, NAMES[direction], strict=True))
        (x, y), colour = project((text[0], text[1], text[2])), COLOURS[name]
        style = f'stroke="{colour}" stroke-width="2.6" marker-end="url(#{name})"'
        parts.append(line(origin, (tip[0], tip[1], tip[2]), style))
        parts.append(
            f'<text x="{x:.1f}" y="{y + 4:.1f}" fill="{colour}" text-anchor="middle" font-weight="bold">{name}</text>'
        )
    x, y = project(origin)
    parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.4" fill="#e8a33d"/>')
    return parts


def draw() -> str:
    """Return the whole picture as SVG."""
    rows = -(-len(PANELS) // COLUMNS)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH * COLUMNS} {HEIGHT * rows}" '
        'font-family="sans-serif" font-size="13">',
        "<title>Frames of vehicles and cameras: x red, y green, z blue</title>",
        "<defs>",
    ]
    for name, colour in COLOURS.items():
        parts.append(
            f'<marker id="{name}" viewBox="0 0 8 8" refX="5" refY="4" markerWidth="4" markerHeight="4" orient="auto">'
            f'<path d="M0 0 L8 4 L0 8 Z" fill="{colour}"/></marker>'
        )
    parts.append("</defs>")
    for index, (title, origin, directions, remark) in enumerate(PANELS):
        left, top = WIDTH * (index % COLUMNS), HEIGHT * (index // COLUMNS)
        parts.append(f'<g transform="translate({left} {top})">')
        parts.append(f'<text x="12" y="20" fill="#7c828c" font-weight="bold">{title}</text>')
        parts += car() + axes(origin, directions)
        words = ", ".join(f"{name} {direction}" for name, direction in zip("xyz", directions, strict=True))
        parts.append(f'<text x="12" y="230" fill="#7c828c" font-size="11">{words}</text>')
        parts.append(f'<text x="12" y="245" fill="#7c828c" font-size="11">{remark}</text>')
        parts.append("</g>")
    parts.append("</svg>")
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("usage: draw_frames.py OUT.svg")
    Path(sys.argv[1]).write_text(draw(), encoding="utf-8")
