"""The compiled step on disk: found again by the next process, never stale, and safe when two write it at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from fusiond.assembly import package
from fusiond.assembly.package import fingerprint, write_package

MODEL = """
from fusiond.models.contract import Process
from fusiond.numerics.kernel import kernel
from fusiond.types import Slot

SPEED_M_S = {speed}


def describe(*, walk_m_sqrt_s: float) -> Process:
    return Process(states=(Slot("place", "m"),), noises=1, parameters=(walk_m_sqrt_s**2,), linear=True)


@kernel
def discretise(dt_s, p, F, B, c, G, q):
    F[0, 0] = 1.0
    c[0] = SPEED_M_S * dt_s
    G[0, 0] = 1.0
    q[0] = p[0] * dt_s
"""
SENSOR = """
from fusiond.models.contract import Sensor
from fusiond.numerics.kernel import kernel


def describe(process, *, scale: float = 1.0) -> Sensor:
    return Sensor(channels=(process.slot("place"),), reads=("place",), parameters=(scale,))


@kernel
def observe(x, z, at, p, h, H):
    h[0] = p[0] * x[at[0]]
    H[0, at[0]] = p[0]
    return True
"""
CONFIG = """
name = "own"
[model]
file = "walk.py"
walk_m_sqrt_s = 0.1
[initial]
state = { place_m = 5.0 }
std = { place_m = 0.0 }
[sensor.tape]
file = "tape.py"
scale = 2.0
noise_std = { place_m = 0.1 }
"""
RUN = """
import json, sys
from pathlib import Path
import numpy as np
from fusiond.assembly.assembly import load

told = []
for edited in [None, *sys.argv[1:]]:
    if edited is not None:
        Path("walk.py").write_text(Path(edited).read_text())
    assembly = load(Path("own.toml"))
    engine = assembly.engine()
    readings = np.zeros(2, assembly.layout.reading)
    readings["t_ns"], readings["length"], readings["z"] = [[0, 1_000_000_000], 1, [[10.0], [10.0]]]
    report = engine.process(readings)[1]
    stats = assembly.package.run.stats
    told.append({"nu": float(report["nu"][0]), "S": float(report["S"][0]),
                 "folder": Path(assembly.package.__file__).parent.name,
                 "hits": sum(stats.cache_hits.values()), "misses": sum(stats.cache_misses.values())})
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    (folder / "own.toml").write_text(CONFIG)
    (folder / "tape.py").write_text(SENSOR)
    for name, speed in (("walk.py", 1.0), ("slow.py", 1.0), ("fast.py", 3.0)):
        (folder / name).write_text(MODEL.format(speed=speed))
    return folder


def run(folder, *edits):
    """Run the user's configuration in a process of its own, again after each edit of the model; what it told."""
    environment = {**os.environ, "FUSIOND_CACHE": str(folder / "cache"), "PYTHONPATH": str(Path.cwd())}
    environment.pop("NUMBA_DISABLE_JIT", None)
    done = subprocess.run(
        [sys.executable, "-c", RUN, *edits],
        cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=280,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_users_own_model_is_compiled_once_and_never_stale(home):
    """Cold; from disk in a second process; edited under a running process; edited back, from disk again."""
    (cold,) = run(home)
    assert (cold["hits"], cold["misses"]) == (0, 1)
    # h = 2 x: predicted 2 (5 + 1) = 12 at one metre a second; S = 4 P + R, P = 0.1^2
    assert cold["nu"] == pytest.approx(10.0 - 12.0)
    assert cold["S"] == pytest.approx(4.0 * 0.01 + 0.01)

    warm, edited, back = run(home, "fast.py", "slow.py")
    assert (warm["hits"], warm["misses"]) == (1, 0)
    assert warm["folder"] == cold["folder"]
    assert warm["nu"] == cold["nu"]

    assert edited["misses"] == 1
    assert edited["folder"] != cold["folder"]
    assert edited["nu"] == pytest.approx(10.0 - 16.0)

    assert back["folder"] == cold["folder"]
    assert back["nu"] == cold["nu"]
    assert back["misses"] == 0


FILES = {"__init__.py": '"""A step."""\n', "sizes.py": "STATES = 1\n" * 20_000}
WRITE = """
import json, sys, time
from pathlib import Path
from fusiond.assembly.package import write_package
files = json.loads(Path(sys.argv[1]).read_text())
print("here", flush=True)
sys.stdin.readline()
for k in range(20):
    folder = write_package({**files, "round.py": str(k)})
    assert {path.name for path in folder.glob("*.py")} == {*files, "round.py"}
    assert all((folder / name).read_text() == text for name, text in files.items())
"""


def test_two_processes_that_write_the_same_step_agree(tmp_path):
    """Released together on an empty cache, twenty times: each sees whole folders only, and no drafts remain."""
    said = tmp_path / "files.json"
    said.write_text(json.dumps(FILES))
    environment = {**os.environ, "FUSIOND_CACHE": str(tmp_path / "cache"), "PYTHONPATH": str(Path.cwd())}
    racers = [
        subprocess.Popen(
            [sys.executable, "-c", WRITE, str(said)],
            env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )
        for _ in range(2)
    ]  # fmt: skip
    try:
        for racer in racers:
            assert racer.stdout.readline() == "here\n"
        for racer in racers:
            racer.stdin.write("\n")
            racer.stdin.flush()
        for racer in racers:
            _, errors = racer.communicate(timeout=120)
            assert racer.returncode == 0, errors
    finally:
        for racer in racers:
            racer.kill()
            racer.communicate()
    folders = [path.name for path in (tmp_path / "cache" / "steps").iterdir()]
    assert len(folders) == 20
    assert not [name for name in folders if name.startswith("draft-")]


def test_every_byte_of_a_step_is_in_its_fingerprint():
    base = fingerprint(FILES)
    assert fingerprint({**FILES, "sizes.py": FILES["sizes.py"] + "#"}) != base
    assert fingerprint({**FILES, "more.py": ""}) != base
    assert fingerprint({"__init__.py": FILES["sizes.py"], "sizes.py": FILES["__init__.py"]}) != base
    assert fingerprint(dict(reversed(FILES.items()))) == base


def test_what_the_step_is_compiled_with_is_in_its_fingerprint(monkeypatch):
    """Another numba, or another text of a shared kernel, gives another folder."""
    base = fingerprint(FILES)
    monkeypatch.setattr(numba, "__version__", "0.0.0")
    assert fingerprint(FILES) != base
    monkeypatch.undo()
    sources = package.shared_sources()
    assert {"numerics/ud.py", "models/sensors/radar.py", "types.py", "engine/records.py"} <= set(sources)
    for name in sources:
        changed = {**sources, name: sources[name] + "#"}
        monkeypatch.setattr(package, "shared_sources", lambda changed=changed: changed)
        assert fingerprint(FILES) != base


def test_a_step_is_written_once(tmp_path, monkeypatch):
    monkeypatch.setenv("FUSIOND_CACHE", str(tmp_path))
    folder = write_package(FILES)
    stamp = (folder / "sizes.py").stat().st_mtime_ns
    assert write_package(FILES) == folder
    assert (folder / "sizes.py").stat().st_mtime_ns == stamp
    assert {path.name: path.read_text() for path in folder.iterdir()} == FILES
