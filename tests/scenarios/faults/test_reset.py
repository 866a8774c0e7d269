"""A reset leaves nothing behind, wherever in the history it comes."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import RESET, Action, Health
from tests.scenarios.faults.drive import scene
