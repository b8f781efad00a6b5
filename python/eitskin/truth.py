"""Attach the truth of a simulated scene to a session. Sessions with real boards import neither
scenes nor scores; this module imports them if the skin is simulated."""

from contextlib import suppress

from eitskin.device.recordings.recording import recorded_options
from eitskin.device.wire.link_table import Stream
from eitskin.errors import EitskinError
from eitskin.session.observer import Observer
from eitskin.session.session import Session


def observe_scene(session: Session) -> Observer | None:
    """Return the observer that ``Session(observe=)`` needs: the truth of the scene of a simulated
    skin, or of the scene that a recorded board saw if it can still be found, or None for a real
    skin.

    Raises:
        FileError, ConfigError, GeometryError, ProtocolError: the scene cannot be read.
    """
    scene = session.capabilities.scene
    if scene is None or (scene.recorded and not session.mode & ~Stream.RAW):
        return None
    from eitskin.scoring.observer import TruthObserver
    from eitskin.scoring.scene_truth import truth_of

    if not scene.recorded:
        return TruthObserver(truth_of(scene, session.settings.solver.sign or "increase"))
    solver = recorded_options(session.name)
    with suppress(EitskinError):  # the scene was a file that no longer exists
        return TruthObserver(truth_of(scene, "increase" if solver is None else solver.sign))
    return None
