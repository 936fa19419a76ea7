"""The licence of every crate that may be in a wheel, against the list of deny.toml: `python scripts/check_licences.py`.

`cargo deny check` does this and more; it is not everywhere, and cargo is. Crates of tests and benches are left out,
as a wheel holds nothing of them.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def allowed() -> set[str]:
    """Read the list of licences."""
    match = re.search(r"^allow = \[(.*?)\]", (ROOT / "deny.toml").read_text(), re.MULTILINE | re.DOTALL)
    if match is None:
        raise SystemExit("deny.toml: no list of allowed licences")
    return set(re.findall(r'"([^"]+)"', match[1]))


def permits(expression: str, allow: set[str]) -> bool:
    """Whether an SPDX expression can be met by what is allowed; "/" is what crates wrote before SPDX."""
    any_of = re.split(r"\bOR\b|/", expression.replace("(", "").replace(")", ""))
    return any(all(part.strip() in allow for part in re.split(r"\bAND\b", choice)) for choice in any_of)


def shipped() -> dict[str, tuple[str, str | None]]:
    """All crates that the library is linked from, with features: name -> (version, licence)."""
    command = ["cargo", "metadata", "--format-version=1", "--features=python", "--locked"]
    metadata = json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    found: dict[str, tuple[str, str | None]] = {}
    waiting, seen = [metadata["resolve"]["root"]], set()
    while waiting:
        this = waiting.pop()
        if this in seen:
            continue
        seen.add(this)
        found[packages[this]["name"]] = (packages[this]["version"], packages[this]["license"])
        for dependency in nodes[this]["deps"]:
            if any(kind["kind"] != "dev" for kind in dependency["dep_kinds"]):
                waiting.append(dependency["pkg"])
    return found


def main() -> int:
    """Print what was found, and what is not allowed."""
    allow, crates = allowed(), shipped()
    if len(crates) < 10:
        raise SystemExit(f"expected the crates of a wheel, found {sorted(crates)}")
    wrong = {name: licence for name, (_, licence) in crates.items() if not licence or not permits(licence, allow)}
    for name, licence in sorted(wrong.items()):
        print(f"{name}: {licence or 'no licence'} is not among those that deny.toml allows", file=sys.stderr)
    print(f"{len(crates)} crates in a wheel, {len(wrong)} of a licence that is not allowed")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
