"""Types of CycloneDDS made from the .msg files, so that the files themselves are what is tried on the wire."""

import dataclasses
import pathlib
import re
import types

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, sequence, uint8, uint32, uint64

MESSAGES = pathlib.Path(__file__).parent.parent / "slipbound_msgs" / "msg"
PRIMITIVES = {
    "bool": bool, "byte": uint8, "uint8": uint8, "int32": int32, "uint32": uint32, "uint64": uint64, "float64": float64, "string": str,
}
# Of other packages, as far as they are needed.
OTHERS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "lifecycle_msgs/State": "uint8 id\nstring label",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Wrench": "Vector3 force\nVector3 torque",
    "geometry_msgs/WrenchStamped": "std_msgs/Header header\nWrench wrench",
    "diagnostic_msgs/KeyValue": "string key\nstring value",
    "diagnostic_msgs/DiagnosticStatus": "byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values",
    "diagnostic_msgs/DiagnosticArray": "std_msgs/Header header\nDiagnosticStatus[] status",
}


def fields(text: str):
    """Names and types of a message, constants left out."""
    for line in text.splitlines():
        line = line.split("#")[0].strip()
        if line and "=" not in line:
            kind, name = line.split()
            yield name, kind


class Types:
    """Every message by its name, package/Name."""

    def __init__(self):
        self._made = {}

    def __call__(self, name: str):
        if name not in self._made:
            package, short = name.split("/")
            text = OTHERS[name] if name in OTHERS else (MESSAGES / f"{short}.msg").read_text()
            annotations = {field: self._type(kind, package) for field, kind in fields(text)}
            mangled = f"{package}::msg::dds_::{short}_"
            body = lambda namespace: namespace.update(__annotations__=annotations, __module__=__name__)
            self._made[name] = dataclasses.dataclass(types.new_class(short, (IdlStruct,), {"typename": mangled}, body))
        return self._made[name]

    def _type(self, kind: str, package: str):
        match = re.fullmatch(r"([\w/]+)(\[(\d*)\])?", kind)
        base, is_many, count = match.groups()
        inner = PRIMITIVES.get(base) or self(base if "/" in base else f"{package}/{base}")
        if not is_many:
            return inner
        return array[inner, int(count)] if count else sequence[inner]
