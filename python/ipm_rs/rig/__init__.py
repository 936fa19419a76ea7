"""Rings of cameras: `Rig`, the cameras by their names, and `RigLut`, one bird's-eye view of all of them."""

from ipm_rs.rig._agreement import Agreement
from ipm_rs.rig._bowl import Bowl
from ipm_rs.rig._cameras import Rig
from ipm_rs.rig._table import RigLut

__all__ = ["Agreement", "Bowl", "Rig", "RigLut"]
