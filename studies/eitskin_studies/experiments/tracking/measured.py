"""Streams measured with noise and reconstructed by the core: what is reported in each frame, by
each way of tracking."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.results import Options
from eitskin.model.model import Model
from eitskin.model.options import default_options, tracking
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.compiler import compile_scene
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.scene.simulate import Measurement, measure
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.experiments.experiment import Workspace
from eitskin_studies.experiments.tracking.counted import TrackCount, count_stream
from eitskin_studies.experiments.tracking.streams import ELEMENTS, TouchStream
from eitskin_studies.harness.sessions import converter_for
from eitskin_studies.harness.snr import noise_deviation_v


@dataclass(frozen=True)
class Way:
    """A way of tracking: the core's ``options``."""

    name: str
    options: Options


def ways(model: Model) -> tuple[Way, ...]:
    """Tracking off, its parts, all of it."""
    off = default_options(model)
    whole = tracking(off)
    low = replace(off, detection_factor=whole.detection_factor)
    return (
        Way("off", off),
        Way("starts confirmed", replace(off, track_confirm=whole.track_confirm)),
        Way("ids held", replace(off, track_hold=whole.track_hold)),
        Way("places smoothed", replace(off, track_smooth=whole.track_smooth)),
        Way("lower threshold alone", low),
        Way("lower threshold, starts confirmed", replace(low, track_confirm=whole.track_confirm)),
        Way("all, usual threshold", replace(whole, detection_factor=off.detection_factor)),
        Way("all", whole),
    )


def choices(model: Model) -> tuple[Way, ...]:
    """All, and each part chosen otherwise."""
    whole = tracking(default_options(model))
    gate = default_options(model).detection_factor
    return (
        Way("as chosen", whole),
        *(Way(f"confirm {n}", replace(whole, track_confirm=n)) for n in (1, 3, 4)),
        *(Way(f"hold {n}", replace(whole, track_hold=n)) for n in (0, 1, 4)),
        *(
            Way(f"smooth {pixels:g}", replace(whole, track_smooth=pixels))
            for pixels in (0.0, 0.33, 1.32)
        ),
        *(
            Way(f"threshold {share:g}", replace(whole, detection_factor=share * gate))
            for share in (1.0, 0.87, 0.6)
        ),
    )


class Measurer:
    """Solves, measures and reconstructs streams; everything is kept at the workspace."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self.model, blob = load_prebuilt()
        self._skin = Reconstructor(self.model, blob=blob)
        self._bench = MeshCache()

    def count(self, stream: TouchStream, snr_db: float, way: Way) -> TrackCount:
        """The core's own tracking."""
        facts = {
            "what": "tracking",
            "stream": stream.facts(),
            "snr_db": snr_db,
            "options": vars(way.options),
        }

        def make() -> dict[str, object]:
            reported, macs = self.reported(stream, snr_db, way.options)
            return count_stream(stream, reported, macs).as_dict()

        return TrackCount(**self.workspace.kept(facts, make))

    def reported(
        self, stream: TouchStream, snr_db: float, options: Options
    ) -> tuple[list[tuple[Touch, ...]], int]:
        """The touches of each frame, and the MACs of all."""
        frames_v = self._start(stream, snr_db, options)
        results = [self._skin.reconstruct(frame) for frame in frames_v]
        return [one.touches for one in results], sum(
            one.info.macs + one.info.touch_macs for one in results
        )

    def _start(self, stream: TouchStream, snr_db: float, options: Options) -> FloatArray:
        """Take the reference; returns the frames (f, m) V."""
        exact_v, how = self._exact_v(stream), converter_for(snr_db)
        noise_v = noise_deviation_v(exact_v[0], snr_db)
        span_v = how.adc_headroom * float(np.abs(exact_v[0]).max())
        assert how.adc_bits is not None
        converter = (noise_v, 2 * span_v / 2**how.adc_bits, span_v, self.workspace.settings.seed)
        untouched_v, _ = measure(
            np.tile(exact_v[0], (Measurement.quiet_frames, 1)), *converter, f"quiet {stream.name}"
        )
        frames_v, _ = measure(exact_v[1:], *converter, f"frame {stream.name}")
        self._skin.set_options(options)
        self._skin.tare(untouched_v)
        self._skin.forget()
        return frames_v

    def _exact_v(self, stream: TouchStream) -> FloatArray:
        """The untouched frame, then those of the stream, without noise: (1 + f, m)."""

        def make() -> dict[str, FloatArray]:
            return {
                "voltage_v": (
                    simulate_frames(compile_scene(stream.scene(), mesh_cache=self._bench)).voltage_v
                )
            }

        return self.workspace.kept_arrays(
            {"what": "stream", "stream": stream.facts(), "elements": ELEMENTS}, make
        )["voltage_v"]


def counts(
    measurer: Measurer, streams: Sequence[TouchStream], snr_db: float, way: Way, what: str
) -> list[TrackCount]:
    """Return the counts of each stream."""
    return [measurer.count(one, snr_db, way) for one in measurer.workspace.progress(streams, what)]
