"""``ros2:``: publish to ROS 2 over DDS, without a ROS installation.

The topics, types and qualities of service are those by which ROS 2 finds them: /contacts, /poses
and /markers in metres, and the others of ``mcap:``. ``ros2:?domain=7`` chooses a domain; else it is
ROS_DOMAIN_ID, or 0. An std_msgs/Empty on /tare takes the reference again, and so does the service
/tare (std_srvs/Trigger) for clients on rmw_cyclonedds. ROS 2 has no common form of services on
DDS: clients on other middleware publish on the topic.
"""

import os
import re
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import Any

from eitskin.config import plain_whole
from eitskin.errors import EitskinError, SinkError, UsageError, missing_extra
from eitskin.sinks.ros2_topics import RosTopics, definitions, topics_of
from eitskin.sinks.sink import OutgoingMessage, Sink, TouchSource, setting

MAX_DOMAIN = 232  # its ports are UDP's last
DEPTH = 10  # messages that DDS keeps for a reader, as ROS does
BLOCK_MS = 100  # how long a reader that is behind may hold the sink
POLL_S = 0.2
TARE_S = 10.0
BAR = "=" * 80
SERVICE_HEADER = "uint64 client\nint64 sequence\n"  # of rmw_cyclonedds
REQUEST = SERVICE_HEADER + "uint8 structure_needs_at_least_one_member\n"
REPLY = SERVICE_HEADER + "bool success\nstring message\n"
EMPTY = "uint8 structure_needs_at_least_one_member\n"


def dds_name(kind: str) -> str:
    """Return the type's name on DDS: "std_msgs/Header" and "std_msgs/msg/Header" are
    "std_msgs::msg::dds_::Header_"."""
    package, *middle, name = kind.split("/")
    return f"{package}::{middle[0] if middle else 'msg'}::dds_::{name}_"


def dds_type(kind: str, definition: str) -> Any:
    """Return a class for messages of the type ``kind``, whose ``definition`` has the format of
    ros2msg files."""
    from cyclonedds.idl import make_idl_struct, types

    first, *others = re.split(rf"{BAR}\nMSG: ", definition)
    texts = {kind: first, **dict(one.split("\n", 1) for one in others)}
    known: dict[str, Any] = {"string": str, "bool": bool, "byte": types.uint8}
    for name in ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"):
        known[name] = getattr(types, name)
    known |= {"float32": types.float32, "float64": types.float64}

    def field(written: str) -> Any:
        plain, _, size = written.removesuffix("]").partition("[")
        one, lists = made(plain), vars(types)  # whose brackets are no types to mypy
        if "[" not in written:
            return one
        return lists["array"][one, int(size)] if size else lists["sequence"][one]

    def made(name: str) -> Any:
        if name not in known:
            lines = re.findall(r"^([\w/]+(?:\[\d*\])?) (\w+) *(?:#.*)?$", texts[name], re.M)
            fields = {member: field(written) for written, member in lines}
            known[name] = make_idl_struct(dds_name(name).replace("::", "_"), dds_name(name), fields)
        return known[name]

    return made(kind)


def filled(kind: Any, table: dict[str, Any]) -> Any:
    """Return the message of the class ``kind`` with the values of ``table``."""
    return kind(
        **{
            name: _value(annotation, table[name])
            for name, annotation in kind.__annotations__.items()
        }
    )


def _value(annotation: Any, value: Any) -> Any:
    if isinstance(value, dict):
        return filled(annotation, value)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        inner = annotation.__metadata__[0].subtype  # of the sequence
        return [filled(inner, one) for one in value]
    return list(value) if isinstance(value, bytes) else value


class Ros2Sink:
    """A participant with a writer per topic, made when its first message comes.

    Raises:
        MissingExtraError: cyclonedds is not installed.
        Exception: DDS has no network, for example.
    """

    def __init__(self, source: TouchSource, domain: int) -> None:
        try:
            from cyclonedds import core, pub, sub, topic, util
            from cyclonedds import domain as domains
        except ImportError:
            raise missing_extra("ros2", "cyclonedds") from None
        self._dds = (pub, sub, topic)
        policy = core.Policy
        self._quality = core.Qos(
            policy.Reliability.Reliable(util.duration(milliseconds=BLOCK_MS)),
            policy.Durability.Volatile,
            policy.History.KeepLast(DEPTH),
            policy.DataRepresentation(use_cdrv0_representation=True),
        )
        self._participant = domains.DomainParticipant(domain)
        self._topics, self._definitions = RosTopics(source), definitions()
        self._types: dict[str, Any] = {}
        self._writers: dict[str, Any] = {}
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        tares = {topics_of(one): one.tare for one in source.each.values() if one.tare is not None}
        if tares:
            self._listen(tares)

    def write(self, outgoing: OutgoingMessage) -> None:
        for name, kind, table in self._topics.of(outgoing):
            if kind not in self._types:
                self._types[kind] = dds_type(kind, self._definitions[kind])
            if name not in self._writers:
                self._writers[name] = self._writer(f"rt{name}", self._types[kind])
            self._writers[name].write(filled(self._types[kind], table))

    def close(self) -> None:
        self._ending.set()
        if self._thread is not None:
            self._thread.join(TARE_S)
        self._writers.clear()
        del self._participant

    def _writer(self, name: str, kind: Any) -> Any:
        pub, _, topic = self._dds
        on = topic.Topic(self._participant, name, kind, qos=self._quality)
        return pub.DataWriter(self._participant, on, qos=self._quality)

    def _listen(self, tares: dict[str, Callable[[], "Future[None]"]]) -> None:
        """Take references that topics or services ask for, in a thread; ``tares`` by the beginning
        of the topics."""
        _, sub, topic = self._dds
        empty = dds_type("std_msgs/msg/Empty", EMPTY)
        request = dds_type("std_srvs/srv/Trigger_Request", REQUEST)
        reply = dds_type("std_srvs/srv/Trigger_Response", REPLY)

        def reader(name: str, kind: Any) -> Any:
            on = topic.Topic(self._participant, name, kind, qos=self._quality)
            return sub.DataReader(self._participant, on, qos=self._quality)

        skins = [
            (
                tare,
                reader(f"rt{prefix}/tare", empty),
                reader(f"rq{prefix}/tareRequest", request),
                self._writer(f"rr{prefix}/tareReply", reply),
            )
            for prefix, tare in tares.items()
        ]

        def serve() -> None:
            while not self._ending.wait(POLL_S):
                for tare, asked, requests, replies in skins:
                    if _valid(asked.take(DEPTH)):
                        _tared(tare)
                    for one in _valid(requests.take(DEPTH)):
                        said = _tared(tare)
                        text = said or "the reference was taken"
                        replies.write(reply(one.client, one.sequence, said is None, text))

        self._thread = threading.Thread(target=serve, name="eitskin ros2 tare", daemon=True)
        self._thread.start()


def _valid(samples: list[Any]) -> list[Any]:
    """Return those that are no notices of a writer that left."""
    return [one for one in samples if type(one).__name__ != "InvalidSample"]


def _tared(tare: Callable[[], "Future[None]"]) -> str | None:
    """Take the reference; return what was wrong, or None."""
    try:
        tare().result(TARE_S)
    except EitskinError as error:
        return str(error)
    except TimeoutError:
        return f"the board did not answer within {TARE_S:g} s"
    return None


def open_sink(url: str, source: TouchSource) -> Sink:
    """Open the sink of the module's docstring."""
    rest = url.removeprefix("ros2:")
    path, _, query = rest.partition("?")
    if path:
        raise UsageError(f"--to {url}: write  ros2: or ros2:?domain=7")
    usual = 0
    with suppress(ValueError):
        usual = plain_whole(os.environ.get("ROS_DOMAIN_ID") or "0")
    domain = setting(url, query, "domain", 0, MAX_DOMAIN, usual)
    try:
        return Ros2Sink(source, domain)
    except EitskinError:
        raise
    except Exception as error:  # DDS raises its own kinds
        raise SinkError(
            f"--to {url}: DDS does not start ({error}); check CYCLONEDDS_URI and the network"
        ) from None
