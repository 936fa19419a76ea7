"""Prove from its disassembly what a wheel was built with: `python scripts/verify_simd.py dist/ipm_rs-....whl`.

Each kernel must hold the instructions that it exists for, and nothing else may hold an instruction that the oldest CPU
of its platform lacks: a wheel that was built with `-C target-cpu=native`, or whose kernels the compiler turned into
scalar code, passes every test on the machine that built it. Needs objdump, of binutils or LLVM.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

# What the kernels of a module must hold, by name of the module: patterns of an instruction with its operands.
# Which of `vpermi2b` and `vpermt2b` it is, and similar choices, are the compiler's.
X86_64 = {
    "kernels::avx512::bytes": ["vpdpbusd .*zmm", "vperm[it]2b .*zmm", "vpmulhrsw .*zmm"],
    "kernels::avx512::floats": ["vmulps .*zmm", "vsubps .*zmm", "vcvtdq2ps .*zmm"],
    "kernels::avx512::boxes": ["vperm[it]2b .*zmm", "vpavgb .*zmm"],
    "kernels::avx512::nearest": ["vperm[it]2[bd] .*zmm"],
    "kernels::avx2::bytes": ["vpmaddwd .*ymm", "vpshufb .*ymm", "vpmulhrsw .*[xy]mm"],
    "kernels::avx2::floats": ["vmulps .*ymm", "vsubps .*ymm", "vcvtdq2ps .*ymm"],
    "kernels::avx2::pairs": ["vpmaddwd .*ymm", "vpshufb .*ymm", "vmulps .*ymm"],
    "kernels::avx2::nearest": ["vpaddd .*ymm"],
    "kernels::avx2::copy": ["vpshufb .*xmm", "vpcmpgtd .*ymm"],
    "quantise_inside::avx512": ["vaddpd .*zmm", "vpmultishiftqb .*zmm"],
    "quantise_inside::avx2": ["vaddpd .*ymm", "vpsrlq .*ymm"],
    "fill::avx512": ["vdivpd .*zmm"],
    "fill::avx2": ["vdivpd .*ymm"],
    "isa::run::avx512": ["vdivpd .*zmm", "vcvtps2pd .*zmm", "vpermt2p[sd] .*zmm"],
    "isa::run::avx2": ["vdivpd .*ymm", "vcvtps2pd .*ymm"],
    "build::bent::BentRow::fill::avx512": ["vdivpd .*zmm", "vsqrtpd .*zmm"],
    "build::bent::BentRow::fill::avx2": ["vdivpd .*ymm", "vsqrtpd .*ymm"],
}
# Every aarch64 has NEON, so its kernels are inlined into their callers and have no names. These are instructions that
# the compiler does not come upon in a loop.
AARCH64 = {"": ["sqrdmulh", "umlal2", "rshrn2", "ld2", "tbl"]}

# Modules and functions of these names may hold what the baseline may not.
SPECIAL = re.compile(r"(^|::)avx(2|512)(::|>|$)")
# All that came after SSE2: VEX and EVEX code (`verr` and `verw` are not), and SSE3 to SSE4.2, BMI and others that have
# no letter of their own. `tzcnt` runs as `bsf` on older CPUs, and is used so.
BEYOND_SSE2 = re.compile(
    r"v(?!er[rw]$)|k(mov|or|and|xn?or|not|unpck|test|shift|add)[bwdq]|andn$|bextr|bls(i|r|msk)|bzhi|(sar|shl|shr|ror|mul)x$"
    r"|pdep|pext$|lzcnt|popcnt|movbe|crc32|h(add|sub)p[sd]|addsubp[sd]|mov(ddup|s[hl]dup)|lddqu|palignr|pshufb|pabs[bwd]"
    r"|ph(add|sub)|pmaddubsw|pmulhrsw|psign|p?blend|pmulld|pmuldq|pm(ax|in)(sb|sd|uw|ud)|pmov[sz]x|p(ext|ins)r[bdq]$"
    r"|(extract|insert)ps|round[ps][sd]|pcmp(eqq|gtq|[ei]str)|packusdw|ptest|dpp[sd]|mpsadbw|movntdqa|aes|pclmul|sha(1|256)"
)
# The contract of the float kernels: nothing fused, or their answers would differ from the scalar ones.
FUSED = re.compile(r"vfn?m(add|sub)")
UNFUSED = re.compile(r"ipm_rs::kernels::|build::bent::|isa::run::")

# Ordinary code that must be among what was looked at, or looking proves nothing.
BASELINE = ["kernels::scalar::bilinear", "geometry::", "python::"]


@dataclass
class Function:
    """A function, or all that share its name because they differ in generic arguments only."""

    copies: int = 0
    instructions: Counter[str] = field(default_factory=Counter)


def disassemble(library: Path) -> dict[str, Function]:
    """Read all functions and their instructions, each as its mnemonic, a space and its operands."""
    objdump = shutil.which("objdump") or shutil.which("llvm-objdump")
    if objdump is None:
        print("not run: objdump was not found; install binutils (or LLVM, or on macOS Xcode's command line tools)")
        raise SystemExit(1 if os.environ.get("CI") else 0)
    command = [objdump, "--disassemble", "--demangle", "--no-show-raw-insn", str(library)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    functions: dict[str, Function] = {}
    current = None
    for line in lines:
        if match := re.match(r"[0-9a-f]+ <(.+)>:$", line):
            current = functions.setdefault(match[1], Function())
            current.copies += 1
        elif current and (match := re.match(r"\s+[0-9a-f]+:\s+([a-z]\S*)\s*(.*)", line)):
            mnemonic = match[1].split(".")[0]  # LLVM writes `umlal2.4s`
            current.instructions[f"{mnemonic} {match[2]}"] += 1
    return functions


def check_kernels(functions: dict[str, Function], expected: dict[str, list[str]]) -> list[str]:
    """Say which module lacks which instruction, and print how many of each there are."""
    faults = []
    for module, patterns in expected.items():
        inside = {name: function for name, function in functions.items() if module in name}
        counts = []
        for pattern in patterns:
            found = sum(
                count
                for function in inside.values()
                for instruction, count in function.instructions.items()
                if re.match(pattern, instruction)
            )
            counts.append(f"{found} {pattern}")
            if not found:
                faults.append(f"no '{pattern}' in {module or 'the library'}")
        copies = sum(function.copies for function in inside.values())
        print(f"{module or 'all':<32} {copies:>4} functions: {', '.join(counts)}")
    return faults


def check_baseline(functions: dict[str, Function]) -> list[str]:
    """Say which ordinary function holds an instruction of newer CPUs."""
    ordinary = {name: function for name, function in functions.items() if not SPECIAL.search(name)}
    faults = [
        f"{name} is not of the baseline: {instruction}"
        for name, function in ordinary.items()
        for instruction in function.instructions
        if BEYOND_SSE2.match(instruction.split()[0])
    ]
    faults += [f"no function of {name} among the baseline" for name in BASELINE if not any(name in f for f in ordinary)]
    faults += [
        f"{name} fuses: {instruction}"
        for name, function in functions.items()
        if UNFUSED.search(name)
        for instruction in function.instructions
        if FUSED.match(instruction)
    ]
    print(f"{'baseline':<32} {sum(function.copies for function in ordinary.values()):>4} functions: x86-64 and SSE2")
    return faults


def main(wheel: Path) -> None:
    """Check one wheel, whose name says what it is for; the exit status is 1 where it is not what it should be."""
    if not wheel.stem.endswith(("x86_64", "amd64", "aarch64", "arm64")):
        print(f"{wheel.name}: not checked, there are no kernels for its platform")
        return
    with tempfile.TemporaryDirectory(prefix="ipm_rs-") as folder:
        with zipfile.ZipFile(wheel) as archive:
            library = next(name for name in archive.namelist() if re.fullmatch(r"ipm_rs/_core\..*(so|pyd)", name))
            functions = disassemble(Path(archive.extract(library, folder)))
    own = [name for name in functions if "ipm_rs::" in name]
    if not own:
        raise SystemExit(f"{wheel}: no names of functions in {library}; was it stripped?")
    x86_64 = wheel.stem.endswith(("x86_64", "amd64"))
    faults = check_kernels(functions, X86_64 if x86_64 else AARCH64)
    if x86_64:
        faults += check_baseline(functions)
    for fault in faults[:20]:
        print(f"{wheel.name}: {fault}", file=sys.stderr)
    if faults:
        raise SystemExit(f"{len(faults)} faults")
    print(f"{wheel.name}: {len(own)} functions of ours looked at, nothing wrong")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(f"usage: {sys.argv[0]} WHEEL")
    main(Path(sys.argv[1]))
