"""Messages that hold whatever their types allow, the worst of it more often than chance has it."""

import re
from random import Random

from dart_skill_nodes.comms.qos import message_class

NUMBERS = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    3.0,
    1e-308,
    1e9,
    -1e9,
    1e154,
    1e308,
    -1e308,
    float("nan"),
    float("inf"),
    float("-inf"),
)
TEXTS = (
    "",
    "world",
    "attractor",
    "hand",
    "default",
    "x",
    "\x1b[2J",
    "ünïcode",
    "../../x",
    "a b;c",
    "%s{}",
    "w" * 1000,
)
LENGTHS = (0, 0, 1, 2, 3, 7)
SCALAR = {"double": float, "float": float, "boolean": bool, "string": str}


def nasty(kind: type, random: Random):
    """A message, request or goal of a type with nasty content."""
    message = kind()
    for name, type_name in kind.get_fields_and_field_types().items():
        setattr(message, name, _value(type_name, random))
    return message


def _value(type_name: str, random: Random):
    if array := re.fullmatch(r"(.*)\[(\d+)\]", type_name):
        return [_value(array[1], random) for _ in range(int(array[2]))]
    if sequence := re.fullmatch(r"sequence<(.*?)(, \d+)?>", type_name):
        return [_value(sequence[1], random) for _ in range(random.choice(LENGTHS))]
    if "/" in type_name:
        package, name = type_name.split("/")
        return nasty(message_class(f"{package}/msg/{name}"), random)
    if type_name in ("double", "float"):
        number = random.choice(NUMBERS) if random.random() < 0.5 else random.uniform(-2.0, 2.0)
        return number if type_name == "double" or abs(number) < 3e38 else 1.0
    if type_name == "boolean":
        return random.random() < 0.5
    if type_name.startswith("string"):
        return random.choice(TEXTS)
    if type_name in ("octet", "byte"):
        return bytes([random.randrange(256)])
    bits, signed = int(re.sub(r"\D", "", type_name)), not type_name.startswith("u")
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return random.choice((low, high, 0, 1, 2, random.randint(low, high)))


def spoil(message, random: Random, times: int = 2):
    """The same message with a few of its values made nasty, or items of its lists lost or
    repeated.
    """
    for _ in range(times):
        _spoil_one(message, random)
    return message


def _spoil_one(message, random: Random) -> None:
    fields = message.get_fields_and_field_types()
    name = random.choice(list(fields))
    value, sequence = getattr(message, name), re.fullmatch(r"sequence<.*>", fields[name])
    if hasattr(value, "get_fields_and_field_types"):
        _spoil_one(value, random)
    elif sequence and len(value) and random.random() < 0.3:
        where = random.randrange(len(value))
        cut, gap, more = (
            value[:where],
            [*value[:where], *value[where + 1 :]],
            [*value, *value[where:]],
        )
        setattr(message, name, random.choice((cut, gap, more)))
    elif sequence and len(value) and hasattr(value[0], "get_fields_and_field_types"):
        _spoil_one(value[random.randrange(len(value))], random)
    elif sequence and len(value) and isinstance(value[0], str):
        setattr(message, name, [*value[:-1], random.choice(TEXTS)])
    elif not isinstance(value, str | bytes) and hasattr(value, "__len__") and len(value):
        value[random.randrange(len(value))] = random.choice(NUMBERS)
    else:
        setattr(message, name, _value(fields[name], random))
