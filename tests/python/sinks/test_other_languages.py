"""Receivers in other languages: types from the messages' schema, and the example, before a real
stream. ``test_generated_tables.py`` notices types that are older than the schema."""

import re
import socket
import subprocess
from pathlib import Path

import pytest
from ports import free_port
from swipe_frames import Swipe

from eitskin.session.message import encoded, schema
from eitskin.sinks.outputs import Outputs

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "examples"
TYPES = EXAMPLES / "types"
SUMMARY = {"frames": 40}
READER = """
#include "eitskin_message.hpp"
#include <iostream>
#include <nlohmann/json.hpp>

int main()
{
    for (std::string line; std::getline(std::cin, line);) {
        const auto json = nlohmann::json::parse(line);
        if (json.at("type") != "frame")
            continue;
        const auto frame = json.get<eitskin::Frame>();
        std::cout << frame.frame << ' ' << frame.touches.has_value() << ' '
                  << frame.time_unix_s.has_value();
        for (const auto &touch : *frame.touches)
            std::cout << ' ' << touch.id << ' ' << touch.x_mm << ' ' << touch.force_n.has_value();
        std::cout << '\\n';
    }
}
"""


def ran(command: list[str], text: str = "") -> str:
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_javascript_prints_the_touches_of_a_stream(swipe: Swipe):
    """A datagram goes when the one before was printed, so that none is lost on a busy machine."""
    port, ids = free_port(socket.SOCK_DGRAM), set[int]()
    command = ["node", str(EXAMPLES / "javascript" / "touches.mjs"), str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "listening\n"
        with Outputs([f"udp://127.0.0.1:{port}"], swipe.source) as outputs:
            for frame in swipe.frames:
                outputs.put(frame)
                now = {touch.id for touch in frame.touches}
                for touch in frame.touches:
                    what = "moves" if touch.id in ids else "comes"
                    found = re.match(
                        rf"touch {touch.id} {what} (\S+) (\S+) mm", program.stdout.readline()
                    )
                    assert found
                    place = [float(found[1]), float(found[2])]
                    assert place == pytest.approx([touch.x_mm, touch.y_mm], abs=0.06)
                gone = {program.stdout.readline() for _ in ids - now}
                assert gone == {f"touch {one} goes\n" for one in ids - now}
                ids = now
            outputs.end(SUMMARY)
        assert program.wait(timeout=20) == 0
    assert sum(map(len, swipe.touches)) > 30


def test_typescript_has_every_member_of_every_message():
    """The compiler is asked in long runs; here each member of the schema is found in its type."""
    text = (TYPES / "eitskin_message.d.ts").read_text(encoding="utf-8")
    for name in ("touch", "frame", "report", "notice", "summary", "reconstruction", "gesture"):
        (body,) = re.findall(rf"export interface {name.capitalize()} \{{\n(.*?)\n\}}", text, re.S)
        members = dict(re.findall(r"^  (\w+)(\??): ", body, re.M))
        described = schema()["$defs"][name]
        assert set(members) == set(described["properties"])
        assert {one for one, mark in members.items() if not mark} == set(described["required"])


@pytest.mark.long("the members of every type")
def test_typescript_accepts_the_example(tmp_path):
    ran(["tsc", "--noEmit", "--strict", str(TYPES / "eitskin_message.d.ts")])
    (tmp_path / "use.ts").write_text(
        f'import type {{ Message }} from "{TYPES / "eitskin_message"}";\n'
        "export function first(message: Message): number | null {\n"
        '  if (message.type !== "frame" || message.touches === null) return null;\n'
        "  return message.touches[0].x_mm;\n"
        "}\n"
    )
    ran(["tsc", "--noEmit", "--strict", str(tmp_path / "use.ts")])


def test_the_cpp_header_compiles(tmp_path):
    (tmp_path / "use.cpp").write_text(
        '#include "eitskin_message.hpp"\neitskin::Frame frame;\neitskin::Report report;\n'
    )
    options = ["-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    ran(["g++", *options, f"-I{TYPES}", str(tmp_path / "use.cpp")])


@pytest.mark.long("the header alone")
def test_cpp_reads_the_messages_of_a_stream(swipe: Swipe, tmp_path):
    (tmp_path / "read.cpp").write_text(READER)
    program = str(tmp_path / "read")
    ran(["g++", "-std=c++17", "-O0", f"-I{TYPES}", str(tmp_path / "read.cpp"), "-o", program])
    messages = [frame.message() for frame in swipe.frames]
    printed = ran([program], "\n".join(map(encoded, messages)) + "\n").splitlines()
    assert len(printed) == len(messages)
    for line, message in zip(printed, messages, strict=True):
        number, asked, on_the_host, *touches = line.split()
        assert (int(number), asked) == (message["frame"], "1")
        assert int(on_the_host) == (message["time_unix_s"] is not None)
        wanted = [(t["id"], t["x_mm"], t["force_n"] is not None) for t in message["touches"]]
        read = [float(one) for one in touches]
        assert len(read) == 3 * len(wanted)
        for k, (touch_id, x_mm, has_force) in enumerate(wanted):
            assert read[3 * k : 3 * k + 3] == [touch_id, pytest.approx(x_mm, rel=1e-4), has_force]
