"""A recorded robot: a folder with a recording per skin and a robot file that names them, so that it
replays as any robot."""

import json
from collections.abc import Mapping
from pathlib import Path

from eitskin.errors import FileError
from eitskin.fileio import read_bytes, write_bytes
from eitskin.kinematics.pose import quaternion_xyzw
from eitskin.robot.description import Robot, RobotSkin

FILE = "robot.toml"


def skin_file(folder: Path, name: str, part: int = 1) -> Path:
    """The recording of a skin; ``part`` counts how often its board was opened."""
    return folder / (f"{name}.eits" if part == 1 else f"{name}-{part}.eits")


def check_folder(folder: Path, overwrite: bool) -> None:
    """Reject a folder in which a robot cannot be recorded.

    Raises:
        FileError: it is a file, its parent does not exist, or it holds something already.
    """
    if not folder.parent.is_dir():
        raise FileError(f"{folder}: the folder {folder.parent} does not exist; make it first")
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder}: is a file; a robot is recorded in a folder, so name one")
    if folder.is_dir() and any(folder.iterdir()) and not overwrite:
        raise FileError(
            f"{folder}: holds files already; name another folder, or overwrite them with "
            " --overwrite"
        )


def begin_folder(robot: Robot, folder: Path) -> None:
    """Make the folder with the robot file, and copies of the models and the URDF.

    Raises:
        FileError: it cannot be written, or a model cannot be read.
    """
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder}: cannot be made ({error.strerror}); name another") from None
    for skin in robot.skins:
        if skin.model is not None:
            write_bytes(folder / f"{skin.name}.eitm", read_bytes(skin.model, "model"))
    if robot.urdf is not None:
        write_bytes(folder / "robot.urdf", read_bytes(robot.urdf, "URDF"))
    write_recorded(robot, folder, {})


def write_recorded(robot: Robot, folder: Path, starts_s: Mapping[str, float]) -> None:
    """Write the robot file; ``starts_s`` says when each skin's first frame came, where that is
    known yet."""
    lines = ["[robot]", f"name = {_text(robot.name)}"]
    if robot.urdf is not None:
        lines.append('urdf = "robot.urdf"')
    for skin in robot.skins:
        lines += ["", "[[skin]]", *_skin(skin, folder, starts_s.get(skin.name, 0.0))]
    write_bytes(folder / FILE, ("\n".join(lines) + "\n").encode())


def _skin(skin: RobotSkin, folder: Path, starts_s: float) -> list[str]:
    lines = [
        f"name = {_text(skin.name)}",
        f"device = {_text(f'file:{skin_file(folder, skin.name).name}')}",
        f"xyz_m = {skin.pose.translation_m.tolist()}",
        f"quaternion_xyzw = {list(quaternion_xyzw(skin.pose.rotation))}",
        f"starts_s = {starts_s:.6f}",
    ]
    if skin.link is not None:
        lines.append(f"link = {_text(skin.link)}")
    if skin.model is not None:
        lines.append(f"model = {_text(f'{skin.name}.eitm')}")
    return lines


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)
