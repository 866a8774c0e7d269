"""Start and stop, in this process and in others."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from fusiond.assembly.assembly import load
from fusiond.errors import ConfigError
from fusiond.recording.log import open_log
from fusiond.service.client import SensorPublisher
from fusiond.service.serve import serve
from fusiond.service.settings import settings_of

RECORD = """
import sys
from pathlib import Path
from fusiond.assembly.assembly import load
from fusiond.service.record import listen_and_record
config, out = sys.argv[1:]
sys.exit(listen_and_record(load(Path(config)), Path(out), listen=["tcp/127.0.0.1:0"],
                           on_ready=lambda endpoints: print("ready", *endpoints, flush=True)))
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_during_compilation_ends_it_at_once(assembly, number):
    """While the step compiles nobody looks at a flag: the signal itself ends the start."""

    class Compiling:
        config, layout, is_compiled = assembly.config, assembly.layout, False

        def prepare(self):
            os.kill(os.getpid(), number)
            raise AssertionError("the signal was not heard")

    before = signal.getsignal(number)
    assert serve(Compiling(), listen=["tcp/127.0.0.1:0"], on_ready=lambda _: pytest.fail("was ready")) == 0
    assert signal.getsignal(number) is before


def test_a_failure_of_the_engine_ends_it_with_that_failure(assembly):
    class Broken:
        """The assembly in everything but its engine."""

        def __getattr__(self, name):
            return getattr(assembly, name)

        def prepare(self):
            pass

        def engine(self):
            engine = assembly.engine()
            process = engine.process
            engine.process = lambda readings: process(readings) if readings["t_ns"][0] == 0 else 1 / 0
            return engine

    def send(endpoints):
        with SensorPublisher("bench", "ultrasonic", endpoints[0]) as sensor:
            sensor.wait_until_heard()
            sensor.publish([0.5])

    with pytest.raises(ZeroDivisionError):
        serve(Broken(), listen=["tcp/127.0.0.1:0"], on_ready=send)
    assert threading.enumerate() == [threading.main_thread()]


def test_after_a_stop_no_thread_is_left(assembly):
    def stop(_):
        os.kill(os.getpid(), signal.SIGTERM)

    assert serve(assembly, listen=["tcp/127.0.0.1:0"], on_ready=stop) == 0
    assert threading.enumerate() == [threading.main_thread()]


def test_a_key_that_is_none_is_the_operators_mistake(config):
    text = config.read_text(encoding="utf-8")
    config.write_text(
        text.replace("[sensor.ultrasonic]", '[sensor.ultrasonic]\nkey = "/car//us"'), encoding="utf-8"
    )
    assembly = load(config)
    with pytest.raises(ConfigError, match=r"sensor\.ultrasonic\.key: `/car//us` is no key expression; write"):
        settings_of(assembly.config, assembly.layout, (), ())


def test_sensors_are_recorded_without_a_daemon(config, assembly, tmp_path):
    out = tmp_path / "heard.mcap"
    with subprocess.Popen(
        [sys.executable, "-c", RECORD, str(config), str(out)], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            endpoint = process.stdout.readline().split()[1]
            with SensorPublisher("bench", "ultrasonic", endpoint) as sensor:
                sensor.wait_until_heard()
                for k in range(10):
                    sensor.publish([float(k)], 10**18 + k)
            heard = wait_for_file(out)
            process.terminate()
            assert process.wait(10) == 0
        finally:
            process.kill()
    readings = [reading for block in open_log(out, assembly.layout) for reading in block.copy()]
    assert heard
    assert [float(r["z"][0]) for r in readings] == list(range(10))
    assert all(r["arrival_ns"] > 0 for r in readings)


def wait_for_file(out) -> bool:
    """Until the readings have reached the file: it only grows when they do."""
    first, deadline = out.stat().st_size, time.monotonic() + 10.0
    while time.monotonic() < deadline:
        if out.stat().st_size > first:
            return True
    return False
