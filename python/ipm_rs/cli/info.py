"""``ipm-rs info``: what is installed."""

from __future__ import annotations

import argparse
import platform
from importlib.metadata import PackageNotFoundError, version

import numpy as np

import ipm_rs
from ipm_rs.cli.arguments import Commands
from ipm_rs.cli.printing import emit


def add(commands: Commands) -> None:
    """Add the command."""
    info = commands.add_parser(
        "info",
        help="print versions, CPU features and build",
        description="Print the versions, the CPU features in use and how the core was built, for a bug report.",
        examples="  ipm-rs info\n  IPM_RS_ISA=scalar ipm-rs info   # without SIMD",
    )
    info.set_defaults(run=run)


def run(_: argparse.Namespace) -> None:
    """Print the versions, the CPU features and the build."""
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
        emit(f"{name:{width}}  {text}")
