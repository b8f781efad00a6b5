"""Files that commands write: whole or not at all, links followed, modes kept, devices left in
place."""

import os
import stat
import threading
from pathlib import Path

import pytest

from eitskin.errors import FileError
from eitskin.fileio import write_beside, write_bytes


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_a_link_is_followed_and_stays_a_link(tmp_path):
    (tmp_path / "far").mkdir()
    target, link = tmp_path / "far" / "out.npz", tmp_path / "out.npz"
    link.symlink_to(target)
    for content in (b"first", b"second"):  # first the link points to nothing
        write_bytes(link, content)
        assert link.is_symlink() and target.read_bytes() == content
    assert [path.name for path in (tmp_path / "far").iterdir()] == ["out.npz"]


def test_links_in_a_circle_are_refused(tmp_path):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(FileError, match="links form a circle"):
        write_bytes(tmp_path / "a", b"")


def test_a_pipe_behind_a_link_is_written_into(tmp_path):
    """As /dev/stdout is, which leads to a name that no file has."""
    read, write = os.pipe()
    (tmp_path / "stdout").symlink_to(f"/proc/self/fd/{write}")
    write_bytes(tmp_path / "stdout", b"content")
    os.close(write)
    with os.fdopen(read, "rb") as stream:
        assert stream.read() == b"content"


def test_long_names(tmp_path):
    write_bytes(tmp_path / ("a" * 251 + ".npz"), b"content")
    with pytest.raises(FileError, match="File name too long"):
        write_bytes(tmp_path / ("a" * 252 + ".npz"), b"")


@pytest.mark.parametrize("kept", [0o600, 0o664, 0o755])
def test_a_file_keeps_its_mode(tmp_path, kept):
    path = tmp_path / "out"
    path.write_bytes(b"old")
    path.chmod(kept)
    write_bytes(path, b"new")
    assert mode(path) == kept and path.read_bytes() == b"new"


def test_a_new_file_has_the_mode_that_the_umask_leaves(tmp_path):
    before = os.umask(0o027)
    try:
        write_bytes(tmp_path / "out", b"")
    finally:
        os.umask(before)
    assert mode(tmp_path / "out") == 0o640


def test_a_fifo_gets_the_content_and_stays_a_fifo(tmp_path):
    fifo, read = tmp_path / "pipe.csv", []
    os.mkfifo(fifo)
    reader = threading.Thread(target=lambda: read.append(fifo.read_bytes()))
    reader.start()
    write_bytes(fifo, b"content")
    reader.join(10)
    assert read == [b"content"] and stat.S_ISFIFO(fifo.stat().st_mode)
    assert list(tmp_path.iterdir()) == [fifo]


def test_a_device_is_not_replaced():
    before = Path("/dev/null").stat()
    write_bytes("/dev/null", b"content")
    after = Path("/dev/null").stat()
    assert (after.st_ino, after.st_mode) == (before.st_ino, before.st_mode)


def test_file_and_folder_are_on_the_disk_before_it_is_done(tmp_path, monkeypatch):
    synced = []

    def note(handle: int) -> None:
        synced.append(stat.S_IFMT(os.fstat(handle).st_mode))

    monkeypatch.setattr("eitskin.fileio.os.fsync", note)
    write_bytes(tmp_path / "out", b"content")
    assert synced == [stat.S_IFREG, stat.S_IFDIR]


def test_what_fails_leaves_the_old_file(tmp_path):
    path = tmp_path / "out"
    path.write_bytes(b"old")
    with pytest.raises(RuntimeError), write_beside(path) as temporary:
        temporary.write_bytes(b"half")
        raise RuntimeError
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]
