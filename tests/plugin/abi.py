"""lumicut.h as data: its structures, constants and functions, read from the text."""
import os
import pathlib
import re
import typing

ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[2]))
HEADER = ROOT / "plugin/include/lumicut/lumicut.h"
SIZES = {"float": 4, "int32_t": 4, "uint32_t": 4, "double": 8, "uint64_t": 8}


class Field(typing.NamedTuple):
    name: str
    type: str  # "float", "const char*", "void (void*, int32_t, const char*)" of a callback, "lumicut_ray" of a structure within
    count: int  # of an array; 0: none


class Function(typing.NamedTuple):
    name: str
    result: str
    arguments: tuple  # types


class Abi(typing.NamedTuple):
    structures: dict  # name: [Field]
    constants: dict  # name: value
    functions: dict  # name: Function

    def size(self, name):
        """Bytes, of structures without implicit padding (a compiler checks that there is none)."""
        return sum(self.field_size(f) for f in self.structures[name])

    def field_size(self, field):
        one = 8 if field.type[-1] in "*)" else SIZES.get(field.type) or self.size(field.type)
        return one * (field.count or 1)

    def descriptors(self):
        """Names of the structures that may grow."""
        return [name for name, fields in self.structures.items() if fields[0].name == "struct_size"]


def type_of(declaration):
    """ "const lumicut_vpl** lights" -> "const lumicut_vpl**"; also without a name."""
    words = re.match(r"((?:const )?\w+)\s*(\**)", declaration.strip())
    return words[1] + words[2]


def fields_of(body):
    fields = []
    for declaration in filter(None, (part.strip() for part in body.split(";"))):
        callback = re.fullmatch(r"(\w+) \(\*(\w+)\)\((.*)\)", declaration, re.S)
        if callback:
            arguments = ", ".join(type_of(a) for a in callback[3].split(","))
            fields.append(Field(callback[2], f"{callback[1]} ({arguments})", 0))
            continue
        base, names = re.fullmatch(r"((?:const )?\w+)(\s*\*?.*)", declaration, re.S).groups()
        for name in names.split(","):
            stars, plain, count = re.fullmatch(r"\s*(\**)\s*(\w+)(?:\[(\d+)\])?\s*", name).groups()
            fields.append(Field(plain, base + stars, int(count or 0)))
    return fields


def parse(text=None):
    text = HEADER.read_text() if text is None else text
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    structures = {name: fields_of(body) for name, body in re.findall(r"typedef struct (lumicut_\w+) \{(.*?)\} \1;", text, re.S)}
    constants = {name: int(value.rstrip("u"), 0) for name, value in re.findall(r"^#define (LUMICUT_\w+) +(\w+)", text, re.M)
                 if value[0].isdigit()}
    for body in re.findall(r"enum \{(.*?)\};", text, re.S):
        constants |= {name: int(value, 0) for name, value in re.findall(r"(LUMICUT_\w+) = (\w+)", body)}
    functions = {}
    for result, name, arguments in re.findall(r"LUMICUT_API ((?:const )?\w+\s*\**)\s*(lumicut_\w+)\(([^)]*)\);", text):
        types = tuple(type_of(a) for a in arguments.split(",")) if arguments.strip() != "void" else ()
        functions[name] = Function(name, result.replace(" *", "*").strip(), types)
    if len(functions) != len(re.findall("^LUMICUT_API ", text, re.M)) or len(structures) != len(re.findall(r"typedef struct \w+ \{", text)):
        raise ValueError("lumicut.h has declarations that this parser does not read")
    return Abi(structures, constants, functions)
