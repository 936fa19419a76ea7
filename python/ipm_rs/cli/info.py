"""``ipm-rs info``: what is installed."""

from __future__ import annotations

import argparse
import json
import platform
from importlib.metadata import PackageNotFoundError, version

import numpy as np

import ipm_rs
from ipm_rs.cli.arguments import Commands
from ipm_rs.cli.printing import emit

_EXTRAS = {"Pillow": "cli", "tqdm": "cli", "av": "video", "rosbags": "bags", "PyYAML": "yaml", "pyarrow": "arrow"}
_EXTRAS |= {"pypcd4": "cloud"}
"""What optional dependencies are called, and the extra that installs each."""


def add(commands: Commands) -> None:
    """Add the command."""
    info = commands.add_parser(
        "info",
        help="print versions, CPU features and build",
        description="Print the versions, the CPU features in use and how the core was built, for a bug report.",
        examples="  ipm-rs info\n  ipm-rs info --json\n  IPM_RS_ISA=scalar ipm-rs info   # without SIMD",
    )
    info.add_argument("--json", action="store_true", help="as one JSON object, for programs")
    info.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Print the versions, the CPU features and the build."""
    facts: dict[str, object] = {"ipm-rs": ipm_rs.__version__}
    facts |= {key.replace("_", " "): value for key, value in ipm_rs.cpu_info().items() if key != "version"}
    facts |= {"system": platform.platform()}
    facts |= {"Python": f"{platform.python_version()} ({platform.python_implementation()})", "NumPy": np.__version__}
    for name in _EXTRAS:
        try:
            facts[name] = version(name)
        except PackageNotFoundError:
            facts[name] = None
    if args.json:
        known = {name.lower().replace(" ", "_").replace("-", "_"): fact for name, fact in facts.items()}
        emit(json.dumps(known, indent=2))
        return
    width = max(map(len, facts))
    for name, fact in facts.items():
        text = ", ".join(map(str, fact)) if isinstance(fact, (list, tuple, set)) else fact
        if fact is None:
            text = f'not installed; pip install "ipm-rs[{_EXTRAS[name]}]"'
        emit(f"{name:{width}}  {text}")
