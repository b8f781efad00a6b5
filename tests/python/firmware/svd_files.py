"""Registers and fields from CMSIS-SVD files, as far as the tests of the register header need
them."""

import io
import zipfile
from dataclasses import dataclass
from importlib import resources
from xml.etree import ElementTree


@dataclass(frozen=True)
class Register:
    """Offset in its peripheral; ``fields``: name to (lowest bit, width)."""

    offset: int
    fields: dict[str, tuple[int, int]]


@dataclass(frozen=True)
class Peripheral:
    base: int
    registers: dict[str, Register]


@dataclass(frozen=True)
class Device:
    peripherals: dict[str, Peripheral]
    interrupts: dict[str, int]


def _number(element: ElementTree.Element, name: str) -> int:
    text = element.findtext(name)
    assert text is not None, f"{element.findtext('name')} has no {name}"
    return int(text, 0)


def _register(element: ElementTree.Element) -> Register:
    fields = {
        str(one.findtext("name")): (_number(one, "bitOffset"), _number(one, "bitWidth"))
        for one in element.iter("field")
    }
    return Register(_number(element, "addressOffset"), fields)


def load_svd(name: str) -> Device:
    """The SVD file ``name`` of those that pyOCD ships."""
    packed = resources.files("pyocd.debug.svd").joinpath("svd_data.zip").read_bytes()
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        root = ElementTree.fromstring(archive.read(name))
    elements = {str(one.findtext("name")): one for one in root.iter("peripheral")}
    peripherals = {}
    for key, element in elements.items():
        source = (
            elements[element.attrib["derivedFrom"]] if "derivedFrom" in element.attrib else element
        )
        registers = {str(one.findtext("name")): _register(one) for one in source.iter("register")}
        peripherals[key] = Peripheral(_number(element, "baseAddress"), registers)
    return Device(
        peripherals,
        {str(one.findtext("name")): _number(one, "value") for one in root.iter("interrupt")},
    )
