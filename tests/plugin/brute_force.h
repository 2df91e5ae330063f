// Every ray against every triangle, in double: the oracle, and the tracer of a host that has none.
#pragma once

#include <cmath>
#include <limits>

#include "box_scene.h"

namespace brute_force {

// [Möller & Trumbore 1997]. Closest hit over the geometry shifted by `offset`; geom and inst ids are given by the
// caller.
inline void intersect(const box::Geometry& g, lumicut_rayhit& r, const float (&offset)[3] = {0, 0, 0},
                      uint32_t geom = 0, uint32_t inst = LUMICUT_NO_ID) {
  const double o[3] = {r.ray.org_x, r.ray.org_y, r.ray.org_z}, d[3] = {r.ray.dir_x, r.ray.dir_y, r.ray.dir_z};
  const auto cross = [](const double(&a)[3], const double(&b)[3], double(&out)[3]) {
    for (int k = 0; k < 3; ++k) out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
  };
  const auto dot = [](const double(&a)[3], const double(&b)[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  for (uint32_t t = 0; t < g.indices.size() / 3; ++t) {
    double e1[3], e2[3], s[3], p[3], q[3];
    for (int k = 0; k < 3; ++k) {
      const double a = g.positions[3 * g.indices[3 * t] + k] + offset[k];
      e1[k] = g.positions[3 * g.indices[3 * t + 1] + k] + offset[k] - a;
      e2[k] = g.positions[3 * g.indices[3 * t + 2] + k] + offset[k] - a;
      s[k] = o[k] - a;
    }
    cross(d, e2, p);
    const double det = dot(e1, p);
    if (std::abs(det) < 1e-12) continue;
    const double u = dot(s, p) / det;
    cross(s, e1, q);
    const double v = dot(d, q) / det, distance = dot(e2, q) / det;
    if (u < 0 || v < 0 || u + v > 1 || distance <= r.ray.tnear || distance >= r.ray.tfar) continue;
    r.ray.tfar = static_cast<float>(distance);
    r.hit.u = static_cast<float>(u), r.hit.v = static_cast<float>(v);
    r.hit.prim_id = t, r.hit.geom_id = geom, r.hit.inst_id = inst;
  }
}

}  // namespace brute_force
