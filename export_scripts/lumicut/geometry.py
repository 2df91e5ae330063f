# SPDX-License-Identifier: Apache-2.0
"""The papers' geometry from Python: lumicut_geometry.h in ctypes, arrays in and out. docs/geometry.md has examples.

Points are arrays (n, 2), disks (n, 3) with the radius last, all float64; indices come back as uint32. What needs CGAL
(epsilon_net, heaviest_unhit_disk, dnet) is in a library of its own under the GPL, which is loaded where it is first asked for.
The libraries are those beside LUMICUT_GEOMETRY_LIBRARY (a file or a folder), else the system's."""
import ctypes
import os
import pathlib
from ctypes import POINTER, byref, c_char_p, c_double, c_float, c_int, c_size_t, c_uint32, c_uint64, c_void_p

import numpy as np

NONE = 0xFFFFFFFF
STRATEGIES = ("naive", "heap", "local", "parallel")
BUILDERS = ("kd", "top-down", "insertion", "cheap-insertion", "bottom-up")
DISTANCES = ("centre", "least", "greatest")
METRICS = ("sander", "schlafman")
SEARCHES = ("containing", "intersecting", "contained")
_SIZES, _DOUBLES, _INDICES = POINTER(c_size_t), POINTER(c_double), POINTER(c_uint32)


class Error(ValueError):
    """A call was refused; the text names argument and value."""


class FaceClustersDesc(ctypes.Structure):
    _fields_ = [("struct_size", c_uint32), ("clusters", c_uint32), ("lambda_", c_double), ("geodesic", c_double), ("metric", c_uint32),
                ("random", c_uint32), ("seed", c_uint64)]


_MERGE = ctypes.CFUNCTYPE(None, c_void_p, POINTER(c_float), POINTER(c_float), POINTER(c_float))
_COST = ctypes.CFUNCTYPE(None, c_void_p, POINTER(c_float), POINTER(c_float), c_size_t, POINTER(c_float))
_ORDER = ctypes.CFUNCTYPE(None, c_void_p, POINTER(c_float), POINTER(c_float))


class Dissimilarity(ctypes.Structure):
    _fields_ = [("struct_size", c_uint32), ("features", c_uint32), ("key_features", c_uint32), ("may_decrease", c_uint32),
                ("user", c_void_p), ("merge", _MERGE), ("cost", _COST), ("order", _ORDER)]


class HittingSetInfo(ctypes.Structure):
    _fields_ = [("lower_bound", c_size_t), ("empty_disks", c_size_t), ("greedy", c_size_t)]


# name: (result, arguments). A test compares them with lumicut_geometry.h.
FUNCTIONS = {
    "geometry_error": (c_char_p, []),
    "geometry_version": (c_char_p, []),
    "geometry_fail": (c_int, [c_int, c_char_p]),
    "indices_count": (c_size_t, [c_void_p]),
    "indices_data": (_INDICES, [c_void_p]),
    "indices_release": (None, [c_void_p]),
    "indices_create": (c_int, [_INDICES, c_size_t, POINTER(c_void_p)]),
    "agglomerate": (c_int, [POINTER(c_float), c_size_t, c_int, c_int, _INDICES, POINTER(c_float)]),
    "agglomerate_by": (c_int, [POINTER(Dissimilarity), POINTER(c_float), c_size_t, c_int, _INDICES, POINTER(c_float)]),
    "balltree_create": (c_int, [_DOUBLES, _DOUBLES, c_size_t, c_int, c_int, POINTER(c_void_p)]),
    "balltree_release": (None, [c_void_p]),
    "balltree_insert": (c_int, [c_void_p, _DOUBLES, c_double, c_int, _INDICES]),
    "balltree_remove": (c_int, [c_void_p, c_uint32]),
    "balltree_measure": (c_int, [c_void_p, _SIZES, _DOUBLES, _SIZES]),
    "balltree_search": (c_int, [c_void_p, c_int, _DOUBLES, _DOUBLES, c_size_t, _SIZES, POINTER(c_void_p)]),
    "balltree_nearest": (c_int, [c_void_p, _DOUBLES, c_size_t, c_size_t, _INDICES]),
    "balltree_nearest_by": (c_int, [c_void_p, c_int, _DOUBLES, c_size_t, c_size_t, _INDICES]),
    "balltree_best_mate": (c_int, [c_void_p, _DOUBLES, _DOUBLES, c_size_t, _INDICES]),
    "hull_create": (c_int, [c_int, POINTER(c_void_p)]),
    "hull_release": (None, [c_void_p]),
    "hull_push": (c_int, [c_void_p, _DOUBLES, c_size_t]),
    "hull_pop": (c_int, [c_void_p, c_size_t]),
    "hull_size": (c_int, [c_void_p, _SIZES, _SIZES]),
    "hull_vertices": (c_int, [c_void_p, _DOUBLES]),
    "hitting_set": (c_int, [_DOUBLES, c_size_t, _DOUBLES, c_size_t, c_int, POINTER(c_void_p), POINTER(HittingSetInfo)]),
    "hitting_set_greedy": (c_int, [_DOUBLES, c_size_t, _DOUBLES, c_size_t, c_int, POINTER(c_void_p)]),
    "hitting_set_improve": (c_int, [_DOUBLES, c_size_t, _DOUBLES, c_size_t, _INDICES, c_size_t, c_int, POINTER(c_void_p)]),
    "hitting_set_of_ranges": (c_int, [c_size_t, _SIZES, _INDICES, c_size_t, c_int, _INDICES, c_size_t, c_int, POINTER(c_void_p),
                                      POINTER(HittingSetInfo)]),
    "points_in_copies": (c_int, [_DOUBLES, c_size_t, _DOUBLES, c_size_t, _DOUBLES, c_size_t, _SIZES, POINTER(c_void_p)]),
    "tight_instance": (c_int, [c_int, _DOUBLES, _DOUBLES]),
    "independent_disks": (c_int, [_DOUBLES, c_size_t, c_int, _INDICES, c_size_t, POINTER(c_void_p)]),
    "face_clusters_create": (c_int, [_DOUBLES, c_size_t, _INDICES, c_size_t, POINTER(FaceClustersDesc), POINTER(c_void_p)]),
    "face_clusters_release": (None, [c_void_p]),
    "face_clusters_run": (c_int, [c_void_p, c_size_t, _SIZES]),
    "face_clusters_move": (c_int, [c_void_p, _DOUBLES]),
    "face_clusters_refine": (c_int, [c_void_p, c_double, c_size_t]),
    "face_clusters_read": (c_int, [c_void_p, _INDICES, _SIZES, _DOUBLES]),
    "face_tree_create": (c_int, [_DOUBLES, c_size_t, _INDICES, c_size_t, _DOUBLES, POINTER(c_void_p)]),
    "face_tree_release": (None, [c_void_p]),
    "face_tree_set_weights": (c_int, [c_void_p, _DOUBLES]),
    "face_tree_set_weight": (c_int, [c_void_p, c_uint32, c_double]),
    "texture_atlas": (c_int, [_DOUBLES, c_size_t, _INDICES, c_size_t, _INDICES, c_double, _DOUBLES, _SIZES]),
    "face_tree_read": (c_int, [c_void_p, c_int, _INDICES, _DOUBLES]),
}
CGAL_FUNCTIONS = {
    "epsilon_net": (c_int, [_DOUBLES, _DOUBLES, c_size_t, c_double, c_int, c_double, c_uint64, POINTER(c_void_p)]),
    "heaviest_unhit_disk": (c_int, [_DOUBLES, _DOUBLES, c_size_t, _INDICES, c_size_t, _DOUBLES]),
    "hitting_set_dnet": (c_int, [_DOUBLES, c_size_t, _DOUBLES, c_size_t, c_int, c_uint64, POINTER(c_void_p)]),
}
_loaded = {}


def _library(name, functions):
    if name not in _loaded:
        place, file = os.environ.get("LUMICUT_GEOMETRY_LIBRARY"), f"liblumicut_{name}.so.1"
        if place:
            folder = pathlib.Path(place) if pathlib.Path(place).is_dir() else pathlib.Path(place).parent
            file = str(folder / file) if (folder / file).exists() else str(folder / file.removesuffix(".1"))
        dll = ctypes.CDLL(file)
        for function, (result, arguments) in functions.items():
            found = getattr(dll, "lumicut_" + function)
            found.restype, found.argtypes = result, arguments
        _loaded[name] = dll
    return _loaded[name]


def _geometry():
    return _library("geometry", FUNCTIONS)


def _cgal():
    _geometry()
    return _library("geometry_cgal", CGAL_FUNCTIONS)


def version():
    return _geometry().lumicut_geometry_version().decode()


def _check(code):
    if code == 0:
        return
    text = _geometry().lumicut_geometry_error().decode(errors="replace")
    raise MemoryError(text) if code == 4 else Error(text)


def _rows(values, width, name, kind=np.float64):
    array = np.ascontiguousarray(values, kind)
    if array.size == 0:
        return array.reshape(0, width)
    if array.ndim != 2 or array.shape[1] != width:
        raise Error(f"{name}: an array (n, {width}) is wanted, not {array.shape}")
    return array


def _numbers(values, count, name, kind=np.float64):
    """One for each of `count` things; None stays."""
    if values is None:
        return None
    array = np.ascontiguousarray(values, kind)
    if array.shape != (count,):
        raise Error(f"{name}: {count} numbers are wanted, not an array {array.shape}")
    return array


def _whole(values, name):
    """Indices, as they are: one that is negative or beyond 32 bits is not turned into another."""
    array = np.asarray(values)
    if array.size and (not np.issubdtype(array.dtype, np.integer) or array.min() < 0 or array.max() >= NONE):
        raise Error(f"{name}: indices from 0 to {NONE - 1} are wanted")
    return np.ascontiguousarray(array, np.uint32)


def _pointer(array, kind=c_double):
    return None if array is None else array.ctypes.data_as(POINTER(kind))


def _taken(handle):
    """The indices of a list, which is released."""
    dll = _geometry()
    try:
        count = dll.lumicut_indices_count(handle)
        return np.ctypeslib.as_array(dll.lumicut_indices_data(handle), (count,)).copy() if count else np.empty(0, np.uint32)
    finally:
        dll.lumicut_indices_release(handle)


def agglomerate(items, radii=None, strategy="local"):
    """(merges, costs) of bottom-up clustering: of boxes, rows of least and greatest corner (n, 6), by the area of joint boxes; or,
    with `radii`, of balls at `items` (n, dimension), by their radius. merges (n - 1, 2): numbers from n on are results of merges."""
    array = np.ascontiguousarray(items, np.float32)
    if array.ndim != 2 or (radii is None and array.shape[1] != 6):
        raise Error(f"items: an array (n, 6), or with radii (n, dimension), is wanted, not {array.shape}")
    dimension = 0
    if radii is not None:
        dimension = array.shape[1]
        array = np.ascontiguousarray(np.column_stack([array, _numbers(radii, len(array), "radii", np.float32)]))
    count = max(0, len(array) - 1)
    merges, costs = np.empty((count, 2), np.uint32), np.empty(count, np.float32)
    _check(_geometry().lumicut_agglomerate(_pointer(array, c_float), len(array), dimension, _choice(strategy, STRATEGIES, "strategy"),
                                           _pointer(merges, c_uint32), _pointer(costs, c_float)))
    return merges, costs


def agglomerate_by(leaves, merge, cost, may_decrease=False, key_features=0, strategy="local"):
    """(merges, costs) by a dissimilarity of your own. leaves (n, features), float32. merge(a, b) gives the features of both together, none
    below those of a or b; cost(a, others) one number for each row of others, which must not fall when a feature rises, nor (unless
    may_decrease, with strategies naive and heap) as clusters grow. Called some hundred times a leaf: for thousands, not millions."""
    leaves = np.ascontiguousarray(leaves, np.float32)
    if leaves.ndim != 2 or not 1 <= leaves.shape[1] <= 64:
        raise Error(f"leaves: an array (n, features) of 1 to 64 features is wanted, not {leaves.shape}")
    count, width, raised = len(leaves), leaves.shape[1], []

    def shielded(function):
        def call(*arguments):
            try:
                if not raised:  # the first one ends it: what follows is NaN
                    return function(*arguments)
            except BaseException as error:
                raised.append(error)
            arguments[-1][0] = float("nan")
        return call

    def row(pointer, rows=None):
        return np.ctypeslib.as_array(pointer, (width,) if rows is None else (rows, width))

    def merged(_, a, b, joint):
        row(joint)[:] = merge(row(a), row(b))

    def costs_of(_, a, others, n, out):
        np.ctypeslib.as_array(out, (n,))[:] = cost(row(a), row(others, n))

    by = Dissimilarity(ctypes.sizeof(Dissimilarity), width, key_features, may_decrease, None, _MERGE(shielded(merged)), _COST(shielded(costs_of)),
                       _ORDER())
    merges, costs = np.empty((max(0, count - 1), 2), np.uint32), np.empty(max(0, count - 1), np.float32)
    code = _geometry().lumicut_agglomerate_by(byref(by), _pointer(leaves, c_float), count, _choice(strategy, STRATEGIES, "strategy"),
                                              _pointer(merges, c_uint32), _pointer(costs, c_float))
    if raised:
        raise raised[0]
    _check(code)
    return merges, costs


def _choice(value, names, what):
    if value not in names:
        raise Error(f"{what}: {value!r} is none of {', '.join(names)}")
    return names.index(value)


class _Object:
    """A handle that is released once."""

    _release = ""

    def __init__(self):
        self._handle = c_void_p()

    def close(self):
        if self._handle:
            getattr(_geometry(), self._release)(self._handle)
            self._handle = c_void_p()

    def __del__(self):
        if getattr(self, "_handle", None):
            self.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class BallTree(_Object):
    """Balls at `centres` (n, dimension) with `radii` (None: points). Leaf i is ball i."""

    _release = "lumicut_balltree_release"

    def __init__(self, centres, radii=None, builder="bottom-up"):
        super().__init__()
        centres = np.asarray(centres, np.float64)
        if centres.ndim != 2:
            raise Error(f"centres: an array (n, dimension) is wanted, not {centres.shape}")
        self.dimension = centres.shape[1]
        centres, radii = _rows(centres, self.dimension, "centres"), _numbers(radii, len(centres), "radii")
        _check(_geometry().lumicut_balltree_create(_pointer(centres), _pointer(radii), len(centres), self.dimension,
                                                   _choice(builder, BUILDERS, "builder"), byref(self._handle)))

    def insert(self, centre, radius=0.0, cheap=False):
        """The new leaf; numbers of leaves that were removed are used again."""
        leaf = c_uint32()
        _check(_geometry().lumicut_balltree_insert(self._handle, _pointer(_rows([centre], self.dimension, "centre")), radius, cheap, byref(leaf)))
        return leaf.value

    def remove(self, leaf):
        _check(_geometry().lumicut_balltree_remove(self._handle, leaf))

    def _measure(self):
        leaves, volume, depth = c_size_t(), c_double(), c_size_t()
        _check(_geometry().lumicut_balltree_measure(self._handle, byref(leaves), byref(volume), byref(depth)))
        return leaves.value, volume.value, depth.value

    def __len__(self):
        return self._measure()[0]

    @property
    def volume(self):
        """The sum of radius^dimension over inner balls."""
        return self._measure()[1]

    @property
    def depth(self):
        return self._measure()[2]

    def search(self, kind, centres, radii=None):
        """For each ball (None: point) a list of the leaves that hold it (containing), touch it (intersecting) or lie in it (contained)."""
        centres = _rows(centres, self.dimension, "centres")
        radii = _numbers(radii, len(centres), "radii")
        offsets, found = np.empty(len(centres) + 1, np.uintp), c_void_p()
        _check(_geometry().lumicut_balltree_search(self._handle, _choice(kind, SEARCHES, "kind"), _pointer(centres), _pointer(radii),
                                                   len(centres), offsets.ctypes.data_as(_SIZES), byref(found)))
        return np.split(_taken(found), offsets[1:-1].astype(np.intp)) if len(centres) else []

    def best_mate(self, centres, radii=None):
        """For each ball (None: point) the leaf whose joint ball with it is least."""
        centres = _rows(centres, self.dimension, "centres")
        radii, leaves = _numbers(radii, len(centres), "radii"), np.empty(len(centres), np.uint32)
        _check(_geometry().lumicut_balltree_best_mate(self._handle, _pointer(centres), _pointer(radii), len(centres), _pointer(leaves, c_uint32)))
        return leaves

    def nearest(self, points, count=1, by="centre"):
        """The nearest leaves (n, count), nearest first; NONE fills up. by: distance to their centre, their least or their greatest."""
        points = _rows(points, self.dimension, "points")
        leaves = np.empty((len(points), count), np.uint32)
        _check(_geometry().lumicut_balltree_nearest_by(self._handle, _choice(by, DISTANCES, "by"), _pointer(points), len(points), count, _pointer(leaves, c_uint32)))
        return leaves


class Hull(_Object):
    """Convex hull of a window that slides along a simple chain."""

    _release = "lumicut_hull_release"

    def __init__(self, check_simple=False):
        super().__init__()
        _check(_geometry().lumicut_hull_create(check_simple, byref(self._handle)))

    def push(self, points):
        """The chain's newest points, one after the other."""
        points = _rows(points, 2, "points")
        _check(_geometry().lumicut_hull_push(self._handle, _pointer(points), len(points)))

    def pop(self, count=1):
        """Forgets the oldest points."""
        _check(_geometry().lumicut_hull_pop(self._handle, count))

    def __len__(self):
        return self._size()[0]

    def _size(self):
        points, vertices = c_size_t(), c_size_t()
        _check(_geometry().lumicut_hull_size(self._handle, byref(points), byref(vertices)))
        return points.value, vertices.value

    def vertices(self):
        """(n, 2), counter-clockwise and strictly convex."""
        out = np.empty((self._size()[1], 2))
        _check(_geometry().lumicut_hull_vertices(self._handle, _pointer(out)))
        return out


def hitting_set(points, disks, method="default", drop_empty=False, start=None, exchange=3, seed=0):
    """(indices of points that hit every disk, what is known of them). Methods: default; greedy; pruned; local (search alone, from
    `start` or pruned greedy); dnet (needs CGAL)."""
    _choice(method, ("default", "greedy", "pruned", "local", "dnet"), "method")
    points, disks = _rows(points, 2, "points"), _rows(disks, 3, "disks")
    instance, chosen, info = (_pointer(points), len(points), _pointer(disks), len(disks)), c_void_p(), HittingSetInfo()
    if method == "default":
        _check(_geometry().lumicut_hitting_set(*instance, drop_empty, byref(chosen), byref(info)))
        return _taken(chosen), {"lower_bound": info.lower_bound, "empty_disks": info.empty_disks, "greedy": info.greedy}
    if method == "dnet":
        _check(_cgal().lumicut_hitting_set_dnet(*instance, drop_empty, seed, byref(chosen)))
        return _taken(chosen), {}
    if drop_empty:
        raise Error(f"drop_empty: not with method {method!r}")
    if method == "local":
        begin = _whole(hitting_set(points, disks, "pruned")[0] if start is None else start, "start")
        _check(_geometry().lumicut_hitting_set_improve(*instance, _pointer(begin, c_uint32), len(begin), exchange, byref(chosen)))
    else:
        _check(_geometry().lumicut_hitting_set_greedy(*instance, method == "pruned", byref(chosen)))
    return _taken(chosen), {}


def hitting_set_of_ranges(point_count, ranges, method="default", drop_empty=False, start=None, exchange=3):
    """The same for ranges of any kind, lists of indices of their points (points_in_copies makes some): methods default and local. What is
    proven of local search holds for pseudodisks."""
    _choice(method, ("default", "local"), "method")
    offsets = np.concatenate([[0], np.cumsum([len(r) for r in ranges])]).astype(np.uintp)
    members = _whole(np.concatenate([np.asarray(r) for r in ranges if len(r)]) if offsets[-1] else np.empty(0, np.uint32), "ranges")
    lists, chosen, info = (point_count, offsets.ctypes.data_as(_SIZES), _pointer(members, c_uint32), len(ranges)), c_void_p(), HittingSetInfo()
    if method == "default" or start is None:
        _check(_geometry().lumicut_hitting_set_of_ranges(*lists, drop_empty, None, 0, 0, byref(chosen), byref(info)))
        start, known = _taken(chosen), {"lower_bound": info.lower_bound, "empty_disks": info.empty_disks, "greedy": info.greedy}
        if method == "default":
            return start, known
    begin = _whole(start, "start")
    _check(_geometry().lumicut_hitting_set_of_ranges(*lists, drop_empty, _pointer(begin, c_uint32), len(begin), exchange, byref(chosen), None))
    return _taken(chosen), {}


def points_in_copies(points, shape, copies):
    """A list of indices for each copy (x, y, size) of a convex polygon, its corners (n, 2) counter-clockwise around the origin."""
    points, shape, copies = _rows(points, 2, "points"), _rows(shape, 2, "shape"), _rows(copies, 3, "copies")
    offsets, members = np.empty(len(copies) + 1, np.uintp), c_void_p()
    _check(_geometry().lumicut_points_in_copies(_pointer(points), len(points), _pointer(shape), len(shape), _pointer(copies), len(copies),
                                                offsets.ctypes.data_as(_SIZES), byref(members)))
    return np.split(_taken(members), offsets[1:-1].astype(np.intp)) if len(copies) else []


def tight_instance(side):
    """(points, disks, start): `start` hits all disks, local search with exchange=3 cannot improve it, and the points before it do too,
    of which there are nearly eight times fewer where `side` is large (1 to 300)."""
    small = (side + 1) * (side + 2) // 2
    points, disks = np.empty((max(0, small + 4 * side * side), 2)), np.empty((9 * side * side, 3))
    _check(_geometry().lumicut_tight_instance(side, _pointer(points), _pointer(disks)))
    return points, disks, np.arange(small, len(points), dtype=np.uint32)


def independent_disks(disks, exchange=3, start=None):
    """Indices of many disks that do not touch each other, from small ones first or from `start`, by local search."""
    disks, begin, chosen = _rows(disks, 3, "disks"), _whole([] if start is None else start, "start"), c_void_p()
    _check(_geometry().lumicut_independent_disks(_pointer(disks), len(disks), exchange, _pointer(begin, c_uint32), len(begin), byref(chosen)))
    return _taken(chosen)


def epsilon_net(points, epsilon, weights=None, thesis=False, c0=0.0, seed=0):
    """Indices of points in every disk that holds `epsilon` of the weight. Needs CGAL."""
    points, chosen = _rows(points, 2, "points"), c_void_p()
    weights = _numbers(weights, len(points), "weights")
    _check(_cgal().lumicut_epsilon_net(_pointer(points), _pointer(weights), len(points), epsilon, thesis, c0, seed, byref(chosen)))
    return _taken(chosen)


def heaviest_unhit_disk(points, net, weights=None):
    """The weight of the heaviest disk without a point of `net`. Needs CGAL."""
    points, net, weight = _rows(points, 2, "points"), _whole(net, "net"), c_double()
    weights = _numbers(weights, len(points), "weights")
    _check(_cgal().lumicut_heaviest_unhit_disk(_pointer(points), _pointer(weights), len(points), _pointer(net, c_uint32), len(net), byref(weight)))
    return weight.value


class _OfMesh(_Object):
    def __init__(self, vertices, faces):
        super().__init__()
        self._vertices, self._faces = _rows(vertices, 3, "vertices"), _whole(_rows(faces, 3, "faces", None), "faces")
        self._mesh = (_pointer(self._vertices), len(self._vertices), _pointer(self._faces, c_uint32), len(self._faces))


class FaceClusters(_OfMesh):
    """Compact clusters of the faces (n, 3) of a mesh, kept up as it moves. metric: sander (Eq. 8, by normals of clusters, lambda_ 1 or
    more) or schlafman (Eq. 9, by angles between faces, lambda_ 0 to 1). random_seeds: a number, in place of bisection."""

    _release = "lumicut_face_clusters_release"

    def __init__(self, vertices, faces, clusters=256, lambda_=1.0, geodesic=1e-3, metric="sander", random_seeds=None):
        super().__init__(vertices, faces)
        desc = FaceClustersDesc(ctypes.sizeof(FaceClustersDesc), clusters, lambda_, geodesic, _choice(metric, METRICS, "metric"),
                                random_seeds is not None, random_seeds or 0)
        _check(_geometry().lumicut_face_clusters_create(*self._mesh, byref(desc), byref(self._handle)))

    def run(self, limit=1000):
        """Iterations until nothing changes; how many."""
        made = c_size_t()
        _check(_geometry().lumicut_face_clusters_run(self._handle, limit, byref(made)))
        return made.value

    def move(self, vertices):
        vertices = _rows(vertices, 3, "vertices")
        if len(vertices) != len(self._vertices):
            raise Error(f"vertices: {len(self._vertices)} are wanted, not {len(vertices)}")
        _check(_geometry().lumicut_face_clusters_move(self._handle, _pointer(vertices)))

    def refine(self, error, most=NONE):
        """Splits clusters until the error is at most `error`, or there are `most`."""
        _check(_geometry().lumicut_face_clusters_refine(self._handle, error, most))

    def _read(self):
        labels, count, error = np.empty(len(self._faces), np.uint32), c_size_t(), c_double()
        _check(_geometry().lumicut_face_clusters_read(self._handle, _pointer(labels, c_uint32), byref(count), byref(error)))
        return labels, count.value, error.value

    @property
    def labels(self):
        return self._read()[0]

    def __len__(self):
        return self._read()[1]

    @property
    def error(self):
        """Area times (1 - cosine to the cluster's normal), over all faces."""
        return self._read()[2]


class FaceTree(_OfMesh):
    """A binary tree of compact face clusters, balanced by `weights` (None: areas)."""

    _release = "lumicut_face_tree_release"

    def __init__(self, vertices, faces, weights=None):
        super().__init__(vertices, faces)
        weights = _numbers(weights, len(self._faces), "weights")
        _check(_geometry().lumicut_face_tree_create(*self._mesh, _pointer(weights), byref(self._handle)))

    def set_weights(self, weights):
        _check(_geometry().lumicut_face_tree_set_weights(self._handle, _pointer(_numbers(weights, len(self._faces), "weights"))))

    def set_weight(self, face, weight):
        """One face's: its ancestors alone rebalance."""
        _check(_geometry().lumicut_face_tree_set_weight(self._handle, face, weight))

    def labels(self, level):
        """Clusters of a level; the root is level 0."""
        labels = np.empty(len(self._faces), np.uint32)
        _check(_geometry().lumicut_face_tree_read(self._handle, level, _pointer(labels, c_uint32), None))
        return labels

    @property
    def imbalance(self):
        value = c_double()
        _check(_geometry().lumicut_face_tree_read(self._handle, 0, None, byref(value)))
        return value.value


def texture_atlas(vertices, faces, labels, gap=1 / 512):
    """Texture coordinates (n, 3, 2) of the corners of faces, in the unit square: a chart for each label, projected along its mean normal;
    and how many faces look away from their chart."""
    mesh = _OfMesh(vertices, faces)
    labels = _whole(labels, "labels")
    if labels.shape != (len(mesh._faces),):
        raise Error(f"labels: {len(mesh._faces)} are wanted, not an array {labels.shape}")
    corners, turned_away = np.empty((len(labels), 3, 2)), c_size_t()
    _check(_geometry().lumicut_texture_atlas(*mesh._mesh, _pointer(labels, c_uint32), gap, _pointer(corners), byref(turned_away)))
    return corners, turned_away.value
