"""What a release says of itself: its version and where its source is, in every file that holds them.

`make version NEW=0.2.0` sets the one, `make home URL=https://...` the other, and `python scripts/release.py check
[v0.2.0]` fails where files differ. Nothing is committed and nothing is tagged: `docs/versions.md` says what comes next.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Where a version stands: a file, and what comes before it.
PLACES = {
    "Cargo.toml": r'(?<=^\[package\]\nname = "ipm_rs"\nversion = ")',
    "Cargo.lock": r'(?<=^name = "ipm_rs"\nversion = ")',
    "fuzz/Cargo.lock": r'(?<=^name = "ipm_rs"\nversion = ")',
    "CITATION.cff": r"(?<=^version: )",
}
VERSION = r"\d+\.\d+\.\d+(?:-(?:alpha|beta|rc)\.\d+)?"

# Where the address of the source stands: a file, the line that it follows, what is written, and what that looks like.
HOMES = {
    "pyproject.toml": (
        'dependencies = ["numpy>=1.24"]\n',
        '\n[project.urls]\nSource = "{url}"\nIssues = "{url}/issues"\nChangelog = "{url}/blob/main/CHANGELOG.md"\n',
        r'\n\[project\.urls\]\nSource = "(.*)"\nIssues = ".*"\nChangelog = ".*"\n',
    ),
    "Cargo.toml": ('readme = "README.md"\n', 'repository = "{url}"\n', r'repository = "(.*)"\n'),
    "CITATION.cff": ("type: software\n", 'repository-code: "{url}"\n', r'repository-code: "(.*)"\n'),
}


def versions() -> dict[str, str]:
    """Read what each file says."""
    found = {}
    for name, before in PLACES.items():
        match = re.search(before + VERSION, (ROOT / name).read_text(), re.MULTILINE)
        if match is None:
            raise SystemExit(f"{name}: no version of ipm_rs where one was expected")
        found[name] = match[0]
    return found


def homes() -> dict[str, str]:
    """Read where each file says that the source is; nothing where it does not."""
    found = {}
    for name, (_, _, written) in HOMES.items():
        match = re.search(written, (ROOT / name).read_text())
        found[name] = match[1] if match else ""
    return found


def check(tag: str) -> None:
    """Fail where files differ, or where they are not what a tag says. What has a tag must say where its source is."""
    found = versions()
    if len(set(found.values())) != 1:
        raise SystemExit(f"expected one version everywhere, got {found}; make version NEW=x.y.z sets all")
    version = found["Cargo.toml"]
    if tag and tag != f"v{version}":
        raise SystemExit(f"expected the tag v{version}, got {tag}")
    headings = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    if tag and headings[:2] != ["Unreleased", version]:
        raise SystemExit(f"CHANGELOG.md: expected Unreleased and then {version} to come first, got {headings[:2]}")
    addresses = set(homes().values())
    if len(addresses) != 1:
        raise SystemExit(f"expected one address of the source, got {homes()}; make home URL=https://... sets all")
    home = addresses.pop()
    if tag and not home:
        raise SystemExit("expected the address of the source in a release; make home URL=https://... sets it")
    print(f"{version} in {', '.join(found)}" + (f", and the tag {tag}" if tag else ""))
    print(f"source: {home or 'not said yet, which a tag needs; make home URL=https://... sets it'}")


def bump(new: str) -> None:
    """Write a new version into every file, and give what is unreleased its heading."""
    old = versions()["Cargo.toml"]
    if not re.fullmatch(VERSION, new) or order(new) <= order(old):
        raise SystemExit(f"expected a version above {old}, as 0.2.0 or 0.2.0-rc.1, got {new!r}")
    for name, before in PLACES.items():
        path = ROOT / name
        path.write_text(re.sub(before + VERSION, new, path.read_text(), flags=re.MULTILINE))
    changelog = ROOT / "CHANGELOG.md"
    changelog.write_text(
        re.sub(r"^## Unreleased$", f"## Unreleased\n\n## {new}", changelog.read_text(), flags=re.MULTILINE)
    )
    print(f"{old} -> {new} in {', '.join(PLACES)} and CHANGELOG.md")


def settle(url: str) -> None:
    """Write into every file where the source is, in place of what it said before."""
    if not re.fullmatch(r"https://[\w.-]+(?:/[\w.~-]+)+", url):
        raise SystemExit(
            f"expected an address such as https://host/owner/ipm_rs, without a slash at its end, got {url!r}"
        )
    texts = {}
    for name, (after, template, written) in HOMES.items():
        text = re.sub(written, "", (ROOT / name).read_text())
        if text.count(after) != 1:
            raise SystemExit(f"{name}: expected one line {after.strip()!r}, which the address follows")
        texts[name] = text.replace(after, after + template.format(url=url))
    for name, text in texts.items():
        (ROOT / name).write_text(text)
    print(f"{url} in {', '.join(HOMES)}")


def order(version: str) -> tuple[list[int], bool, list[str | int]]:
    """Sort as Semantic Versioning does: what is before a release comes before it."""
    release, _, before = version.partition("-")
    parts: list[str | int] = [int(part) if part.isdigit() else part for part in before.split(".")]
    return [int(part) for part in release.split(".")], not before, parts


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["check", *tag] if len(tag) <= 1:
            check("".join(tag))
        case ["bump", new]:
            bump(new)
        case ["home", url]:
            settle(url)
        case _:
            raise SystemExit(f"usage: {sys.argv[0]} check [TAG] | bump VERSION | home URL")
