"""Paths of the repository and of data that are not part of it."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[2]
SHARED = ROOT.parent / "shared"
# the reference program's own numbers, and a measured drive; neither is part of the repository
REFERENCE = Path(os.environ.get("JAXIDL_REFERENCE", SHARED / "reference"))
EMPS = Path(os.environ.get("JAXIDL_EMPS", SHARED / "data" / "emps" / "emps.csv"))
# a measured arm and its MJCF
UR10E = Path(os.environ.get("JAXIDL_UR10E", SHARED / "data" / "ur10e" / "ur10e.xml"))
