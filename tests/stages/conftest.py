"""Strips in stages that several tests look at; what they compile is the same for all."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
