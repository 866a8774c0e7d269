"""`fusiond replay`: log, truth, smoother and writer put together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly
from fusiond.cli.views import counting, working
from fusiond.engine.engine import Engine
from fusiond.engine.noise_learnt import recall
from fusiond.errors import ConfigError
from fusiond.recording.accumulators import TruthSums
from fusiond.recording.log import open_log
from fusiond.recording.mcap_writer import McapWriter
from fusiond.recording.replay import replay
from fusiond.recording.truth import Truth, read_truth

if TYPE_CHECKING:
    from fusiond.demo.injecting import Injected


def replay_log(
    assembly: Assembly, log: Path, *, truth: Path | None, out: Path | None, config_text: str, smooth: bool = False,
    inject: Sequence[str] = (), seed: int = 0,
) -> dict[str, Any]:  # fmt: skip
    """Replay one log; returns the object of `replay --json`. Raises LogError, ConfigError.

    Args:
        inject: faults the recorded sensors shall have, as specifications.      seed: of what is random in them.
    """
    if out is not None and out.exists() and log.exists() and out.samefile(log):
        raise ConfigError(f"--out: {out} is the log itself; name another file")
    layout, estimate_hz = assembly.layout, assembly.config.recording.estimate_hz
    angles = {slot.name for slot in (*layout.states, *layout.outputs) if slot.unit == "rad"}
    source = open_log(log, layout)
    lies = _lying(source, assembly, inject, seed)
    if lies is not None:
        config_text = f"{lies.note}{config_text}"
    known = read_truth(truth, angles) if truth else None
    with ExitStack() as closing:
        engine, known_noise = assembly.engine(), getattr(source, "known_noise", {})
        recall(engine, known_noise)
        smoothing = closing.enter_context(Smoothing(assembly, engine)) if smooth else None
        writer = None
        if out:
            writer = closing.enter_context(McapWriter(out, layout, config_text, known_noise=known_noise))
        compiling = "for this configuration, once; up to half a minute"
        with working(f"compiling the filter {compiling}", long=not assembly.is_compiled):
            assembly.prepare()
        if smoothing:
            with working(f"compiling the smoother {compiling}", long=not smoothing.is_compiled):
                smoothing.tracer.prepare()
        given = source if lies is None else lies
        with counting(f"replay {log.name}") as progress:
            result = replay(
                engine,
                given if smoothing is None else smoothing.pieces(given),
                truth=known,
                writer=writer,
                progress=progress,
                refusals=source.refusals,
                estimate_hz=estimate_hz,
                witness=smoothing.smoother.witness if smoothing else None,
            ).json_object()
        if lies is not None:
            result["injected"] = {"faults": [str(fault) for fault in lies.faults], "seed": seed}
            result["warnings"] += lies.warnings
        return smoothing.add_to(result, known, writer) if smoothing else result


def _lying(
    log: Iterable[NDArray[Any]], assembly: Assembly, inject: Sequence[str], seed: int
) -> Injected | None:
    """The log as lying sensors would have filled it; None where none shall lie. Raises ConfigError."""
    if not inject:
        return None
    from fusiond.demo.injecting import inject_into

    return inject_into(log, assembly, inject, seed)


class Smoothing:
    """A smoother beside a replay; a context manager. Raises ConfigError where the configuration cannot be smoothed."""

    def __init__(self, assembly: Assembly, engine: Engine) -> None:
        from fusiond.assembly.package import is_compiled
        from fusiond.assembly.retracing import injection_of, retrace_package, tracer_of
        from fusiond.recording.smoothing import Smoother

        self._assembly, self._engine = assembly, engine
        self.tracer = tracer_of(assembly)
        self.is_compiled = is_compiled(retrace_package(assembly))
        self.smoother = Smoother(self.tracer, assembly.design, injection_of(assembly), engine.track)

    def pieces(self, chunks: Iterable[NDArray[Any]]) -> Iterable[NDArray[Any]]:
        """The log in pieces so small that the smoother sees decisions about faults in time."""
        from fusiond.recording.smoothing_order import pieces

        return pieces(chunks) if self._assembly.layout.shape.cells else chunks

    def __enter__(self) -> Smoothing:
        return self

    def __exit__(self, *_: object) -> None:
        self.smoother.close()

    def add_to(
        self, result: dict[str, Any], truth: Truth | None, writer: McapWriter | None
    ) -> dict[str, Any]:
        """The result of the replay with `smoothed` beside it."""
        from fusiond.recording.smoothing_summary import summarise

        with working("smoothing"):
            followed = self.smoother.finish()
            layout = self._assembly.layout
            sums = None if truth is None else TruthSums(layout, truth, self._engine.outputs)
            estimate_hz = self._assembly.config.recording.estimate_hz
            result["smoothed"] = summarise(
                self.smoother, layout, sums=sums, writer=writer, estimate_hz=estimate_hz
            )
        if not followed:
            why = (
                "decisions about faults are taken in hindsight"
                if layout.shape.cells
                else "it could not be followed"
            )
            result["warnings"].append(f"smoothed: not bit for bit the filter's own run; {why}")
        return result
