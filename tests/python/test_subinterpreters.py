"""A second interpreter of one process is refused with an ImportError, by NumPy or by us, and the first one goes on."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import sys
try:
    import _interpreters as interpreters
    run = interpreters.exec
except ImportError:
    import _xxsubinterpreters as interpreters  # before 3.13
    run = interpreters.run_string

INNER = '''
import os, warnings
warnings.simplefilter("ignore")
try:
    {}
    os.write(1, b"imported\\\\n")
except ImportError:
    os.write(1, b"ImportError\\\\n")
'''
import ipm_rs, numpy as np

def warp():
    camera = ipm_rs.Camera.from_euler(np.array([[30.0, 0, 20], [0, 30, 15], [0, 0, 1]]), image_size=(40, 30),
                                      position=(0, 0, 1.5), pitch=0.2)
    lut = ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(3, 9), y=(-2, 2), resolution=0.5))
    return lut.warp(np.arange(1200, dtype=np.uint16).reshape(30, 40))

before = warp()
core = f'''import importlib.machinery, importlib.util
    loader = importlib.machinery.ExtensionFileLoader("ipm_rs._core", {ipm_rs._core.__file__!r})
    spec = importlib.util.spec_from_loader("ipm_rs._core", loader)
    loader.exec_module(importlib.util.module_from_spec(spec))'''
# before 3.12 no module can say that it is for one interpreter; NumPy refuses there as everywhere
for body in ("import ipm_rs", core) if sys.version_info >= (3, 12) else ("import ipm_rs",):
    inner = interpreters.create()
    run(inner, INNER.format(body))
    interpreters.destroy(inner)
assert (warp() == before).all()
print("first goes on", flush=True)
"""


def test_a_second_interpreter_is_refused_and_the_first_goes_on():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    *refused, last = done.stdout.splitlines()
    assert last == "first goes on" and set(refused) == {"ImportError"}, done
