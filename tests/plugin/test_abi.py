"""lumicut.h is told once. All else that lists its structures, constants or functions is compared with it."""
import ctypes
import importlib.util
import re
import sys
import types
import unittest

import abi

ROOT = abi.ROOT
DESCRIPTORS, MAP = "plugin/descriptors.h", "plugin/lumicut.map"
WRAPPER, PYTHON, PAGE = "plugin/include/lumicut/lumicut.hpp", "export_scripts/lumicut/library.py", "docs/c_abi.md"
SCALARS = {"float": ctypes.c_float, "double": ctypes.c_double, "int32_t": ctypes.c_int32, "uint32_t": ctypes.c_uint32,
           "uint64_t": ctypes.c_uint64, "lumicut_result": ctypes.c_int32, "void": None}


def text_of(path):
    return (ROOT / path).read_text()


def differences(where, what, found, wanted):
    """What of `wanted` is missing, what of `found` is too much, and what is out of order or twice."""
    lines = [f"{where}: lacks {what}{name}" for name in wanted if name not in found]
    lines += [f"{where}: has {what}{name}, which lumicut.h has not" for name in found if name not in wanted]
    return lines


def of_descriptors(header, text):
    known = {name: re.findall(r"F\((\w+)\)", body)
             for name, body in re.findall(r"^LUMICUT_DESCRIPTOR\((\w+),(.*?)\);", text, re.M | re.S)}
    lines = differences(DESCRIPTORS, "", known, header.descriptors())
    for name in filter(known.get, header.descriptors()):
        fields = [f.name for f in header.structures[name]]
        lines += differences(DESCRIPTORS, name + ".", known[name], fields)
        if sorted(known[name]) == sorted(fields) and known[name] != fields:
            lines.append(f"{DESCRIPTORS}: {name} has its fields in another order")
    return lines


def of_map(header, text):
    return differences(MAP, "", re.findall(r"^\s+(lumicut_\w+);", text, re.M), header.functions)


def of_wrapper(header, text):
    """Its table has every function, and its classes call each."""
    table = re.search(r"#define LUMICUT_FOR_ALL_FUNCTIONS\(X\)(.*?[^\\])\n", text, re.S)
    listed = ["lumicut_" + name for name in re.findall(r"X\((\w+)\)", table[1])]
    lines = differences(f"{WRAPPER}: LUMICUT_FOR_ALL_FUNCTIONS", "", listed, header.functions)
    lines += [f"{WRAPPER}: LUMICUT_FOR_ALL_FUNCTIONS has {name} twice" for name in set(listed) if listed.count(name) > 1]
    called = set(re.findall(r"(?:\.|->)(\w+)\(", text[table.end():]))
    return lines + [f"{WRAPPER}: nothing in it calls {name}" for name in header.functions if name[len("lumicut_"):] not in called]


def of_page(header, text):
    return [f"{PAGE}: lacks `{name}`" for name in header.functions if f"`{name}`" not in text]


class Ctypes:
    """The add-on's module beside the header."""

    def __init__(self, header, module):
        self.header, self.module = header, module

    def structure(self, name):
        return getattr(self.module, "".join(word.capitalize() for word in name.split("_")[1:]), None)

    def argument(self, kind):
        """As ctypes has an argument or a result."""
        plain, stars = kind.removeprefix("const ").rstrip("*"), kind.count("*")
        if plain == "char":
            return ctypes.c_char_p
        if plain in ("void", "float") and stars:  # arrays, which come from numpy
            pointed = ctypes.c_void_p
            stars -= 1
        elif plain in SCALARS:
            pointed = SCALARS[plain]
        elif plain in self.header.structures:
            pointed = self.structure(plain)
        else:
            pointed = ctypes.c_void_p  # a handle
        for _ in range(stars if pointed is not None else 0):
            pointed = ctypes.POINTER(pointed)
        return pointed

    def field_fits(self, field, found):
        if field.type.endswith(")"):
            result, arguments = re.fullmatch(r"(\w+) \((.*)\)", field.type).groups()
            return (getattr(found, "_restype_", 0) is SCALARS[result] and
                    list(found._argtypes_) == [self.argument(a) for a in arguments.split(", ")])
        if field.type.endswith("*"):
            return found is (ctypes.c_char_p if "char" in field.type else ctypes.c_void_p)
        one = SCALARS.get(field.type) or self.structure(field.type)
        return found is one if not field.count else found == one * field.count

    def lines(self):
        lines, header, module = [], self.header, self.module
        for name, fields in header.structures.items():
            cls = self.structure(name)
            if cls is None:
                lines.append(f"{PYTHON}: lacks the structure {name}")
                continue
            found = dict(cls._fields_)
            lines += differences(PYTHON, name + ".", found, [f.name for f in fields])
            lines += [f"{PYTHON}: {name}.{f.name} has another type than {f.type}{f'[{f.count}]' if f.count else ''}"
                      for f in fields if f.name in found and not self.field_fits(f, found[f.name])]
            if sorted(found) == sorted(f.name for f in fields) and list(found) != [f.name for f in fields]:
                lines.append(f"{PYTHON}: {name} has its fields in another order")
            if not module.SIZES.get(cls) == ctypes.sizeof(cls) == header.size(name):
                lines.append(f"{PYTHON}: {name} has {header.size(name)} bytes; SIZES says {module.SIZES.get(cls)}, ctypes "
                             f"{ctypes.sizeof(cls)}")
        for name, value in header.constants.items():
            found = getattr(module, name.removeprefix("LUMICUT_"), None)
            if found != value:
                lines.append(f"{PYTHON}: " + (f"lacks {name}" if found is None else f"{name} is {found} instead of {value}"))
        lines += differences(PYTHON, "", ["lumicut_" + name for name in module.FUNCTIONS], header.functions)
        for name, function in header.functions.items():
            declared = module.FUNCTIONS.get(name.removeprefix("lumicut_"))
            if declared and (declared[0] != self.argument(function.result) or
                             declared[1] != [self.argument(a) for a in function.arguments]):
                lines.append(f"{PYTHON}: {name} has other types than {function.result} ({', '.join(function.arguments)})")
        return lines


def python_module():
    try:
        import numpy
    except ImportError:
        numpy = sys.modules["numpy"] = types.ModuleType("numpy")  # declarations need none of it but these names
        numpy.dtype, numpy.ndarray = lambda structure: structure, object
    spec = importlib.util.spec_from_file_location("lumicut_library", ROOT / PYTHON)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def all_differences(header, module):
    return (of_descriptors(header, text_of(DESCRIPTORS)) + of_map(header, text_of(MAP)) +
            of_wrapper(header, text_of(WRAPPER)) + of_page(header, text_of(PAGE)) + Ctypes(header, module).lines())


class OneList(unittest.TestCase):
    maxDiff = None

    @classmethod
    def setUpClass(cls):
        cls.text, cls.module = abi.HEADER.read_text(), python_module()

    def test_what_lists_the_abi_agrees_with_the_header(self):
        header = abi.parse(self.text)
        self.assertGreater(len(header.functions), 40)
        self.assertGreater(len(header.structures), 20)
        self.assertEqual(all_differences(header, self.module), [])

    def test_every_list_of_operations_is_that_of_the_header(self):
        text = text_of("plugin/include/lumicut/lumicut_programs.h")
        names = [name.lower() for name, _ in re.findall(r"LUMICUT_OP_(\w+) = (\d+)", text)]
        self.assertEqual([int(n) for _, n in re.findall(r"LUMICUT_OP_(\w+) = (\d+)", text)], list(range(len(names))))
        inside = re.findall(r"^  X\((\w+), (\d+), (\d+), \w+\)", text_of("scene/texture_program.h"), re.M)
        self.assertEqual([name for name, _, _ in inside], names)
        self.assertEqual(list(self.module.PROGRAM_OPS), names)
        self.assertEqual(list(self.module.PROGRAM_INPUTS), [int(n) for _, n, _ in inside])
        files = re.search(r"kOps = \{(.*?)\};", text_of("io/program_json.cpp"), re.S)[1]
        self.assertEqual(re.findall(r'"(\w+)", (\d+), (\d+)', files), inside)
        for name, size in (("Program", 40), ("Attribute", 24)):
            self.assertEqual(ctypes.sizeof(getattr(self.module, name)), size)

    def of(self, old, new):
        """What is found where the header alone is changed."""
        self.assertEqual(self.text.count(old), 1, old)
        return all_differences(abi.parse(self.text.replace(old, new)), self.module)

    def test_a_field_in_the_header_alone_is_missed_everywhere(self):
        lines = self.of("} lumicut_light;", "float dim;\n} lumicut_light;")
        self.assertIn(f"{DESCRIPTORS}: lacks lumicut_light.dim", lines)
        self.assertIn(f"{PYTHON}: lacks lumicut_light.dim", lines)
        self.assertIn(f"{PYTHON}: lacks lumicut_point.dim", self.of("} lumicut_point;", "float dim;\n} lumicut_point;"))

    def test_a_function_in_the_header_alone_is_missed_everywhere(self):
        lines = self.of("LUMICUT_API void lumicut_retain(", "LUMICUT_API void lumicut_dim(void* handle);\nLUMICUT_API void lumicut_retain(")
        self.assertEqual(lines, [f"{MAP}: lacks lumicut_dim", f"{WRAPPER}: LUMICUT_FOR_ALL_FUNCTIONS: lacks lumicut_dim",
                                 f"{WRAPPER}: nothing in it calls lumicut_dim", f"{PAGE}: lacks `lumicut_dim`",
                                 f"{PYTHON}: lacks lumicut_dim"])

    def test_a_structure_or_constant_in_the_header_alone_is_missed(self):
        lines = self.of("typedef struct lumicut_tile {", "typedef struct lumicut_dim {\n  uint32_t struct_size;\n} lumicut_dim;\n\ntypedef struct lumicut_tile {")
        self.assertEqual(lines, [f"{DESCRIPTORS}: lacks lumicut_dim", f"{PYTHON}: lacks the structure lumicut_dim"])
        self.assertEqual(self.of("LUMICUT_WATT = 1", "LUMICUT_WATT = 1, LUMICUT_DIM = 2"), [f"{PYTHON}: lacks LUMICUT_DIM"])

    def test_another_type_length_order_or_value_is_told(self):
        for old, new, told in (
                ("float fov_y;", "int32_t fov_y;", "lumicut_camera.fov_y has another type than int32_t"),
                ("float to_world[12];", "float to_world[16];", "lumicut_camera.to_world has another type than float[16]"),
                ("uint32_t width, height;\n  uint32_t channels;", "uint32_t height, width;\n  uint32_t channels;",
                 "lumicut_texture has its fields in another order"),
                ("LUMICUT_SUN = 4", "LUMICUT_SUN = 5", "LUMICUT_SUN is 4 instead of 5"),
                ("lumicut_render_wait(lumicut_render render, uint32_t milliseconds",
                 "lumicut_render_wait(lumicut_render render, uint64_t milliseconds", "lumicut_render_wait has other types")):
            with self.subTest(new):
                self.assertTrue(any(told in line for line in self.of(old, new)), self.of(old, new))

    def test_sources_state_one_minor_version(self):
        minor = abi.parse(self.text).constants["LUMICUT_ABI_MINOR"]
        self.assertIn(f"Version 1.{minor} ", text_of(PAGE), "what the version brought")


if __name__ == "__main__":
    unittest.main()
