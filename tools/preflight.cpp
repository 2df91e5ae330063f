#include "tools/preflight.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <numbers>
#include <tuple>

#include "io/srgb.h"
#include "tools/mesh_shells.h"

namespace lumicut::tools {

using nlohmann::ordered_json;

namespace {

constexpr double kPi = std::numbers::pi;
// Rays are traced among the triangles of all instances, 150 bytes each: up to so many in all, and beyond the smaller number no
// more than twice what the scene stores.
constexpr uint64_t kMostTriangles = uint64_t{1} << 25, kMostOfInstances = uint64_t{1} << 21;
constexpr const char* kLightTypes[] = {"point", "spot", "rectangle", "disk", "sun"};

double luminance(const float (&c)[3]) { return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]; }
double luminance(const Point& c) { return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]; }
double largest(const Point& c) { return std::max({c[0], c[1], c[2]}); }
Point vec(const float (&v)[3]) { return {v[0], v[1], v[2]}; }
std::string shown(const Point& p) { return fmt::format("({:.4g}, {:.4g}, {:.4g})", p[0], p[1], p[2]); }

// Mean linear colour; `spherical`: of a latitude-longitude map over the sphere.
Point texture_mean(const io::Texture& t, bool spherical) {
  std::array<double, 256> decoded{};
  for (size_t i = 0; i < 256; ++i) {
    const double s = static_cast<double>(i) / 255;
    decoded[i] = (t.flags & LUMICUT_SRGB) != 0 ? io::linear_of_srgb(s) : s;
  }
  Point sum{};
  double weights = 0;
  for (size_t y = 0; y < t.height; ++y) {
    const double weight = spherical ? std::sin(kPi * (static_cast<double>(y) + 0.5) / t.height) : 1.0;
    Point row{};
    for (size_t x = 0; x < t.width; ++x)
      for (size_t k = 0; k < 3; ++k) {
        const size_t i = (y * t.width + x) * t.channels + (t.channels >= 3 ? k : 0);
        row[k] += t.floats.empty() ? decoded[t.bytes[i]] : double{t.floats[i]};
      }
    sum = sum + row * weight;
    weights += weight * t.width;
  }
  return sum * (1.0 / weights);
}

// World triangles of all instances under the library's tracer, and the shells they belong to.
class World {
 public:
  struct Piece {
    Shell shell;
    uint32_t instance = 0;
    Box box;
  };

  World(const io::Api& api, lumicut_device device, const io::SceneData& scene, const std::vector<MeshShells>& shells)
      : api_(api), accel_(api) {
    std::vector<float> positions;
    std::vector<uint32_t> indices;
    for (uint32_t m = 0; m < scene.meshes.size(); ++m) {
      const io::Mesh& mesh = scene.meshes[m];
      for (uint32_t i = 0; i < instance_count(mesh); ++i) {
        const auto first = static_cast<uint32_t>(positions.size() / 3);
        const auto first_piece = static_cast<uint32_t>(pieces.size());
        for (const Shell& s : shells[m].shells) pieces.push_back({s, i, {}});
        for (size_t v = 0; 3 * v < mesh.positions.size(); ++v)
          for (const double x : corner(mesh, v, i)) positions.push_back(static_cast<float>(x));
        for (uint32_t t = 0; 3 * size_t{t} < mesh.indices.size(); ++t) {
          const uint32_t piece = first_piece + shells[m].shell_of[t];
          const auto& material = scene.materials[mesh.materials[t]].values;
          const bool hole = material.opacity < 0.01f && material.opacity_texture == 0;
          for (size_t k = 0; k < 3; ++k) {
            const uint32_t v = mesh.indices[3 * size_t{t} + k];
            pieces[piece].box.extend(corner(mesh, v, i));
            if (!hole) indices.push_back(first + v);
          }
          if (!hole) piece_of_.push_back(piece);
        }
      }
    }
    if (indices.empty()) return;
    lumicut_accel_desc desc{};
    desc.struct_size = sizeof(desc);
    desc.robust = 1;
    desc.positions = positions.data(), desc.position_count = positions.size() / 3;
    desc.indices = indices.data(), desc.triangle_count = indices.size() / 3;
    io::check(api, api.accel_build(device, &desc, accel_.out()), "preflight");
  }

  struct Ray {
    Point origin, direction;
    double near = 0, far = 1e30;
  };
  struct Hit {
    double t = -1;  // below 0: nothing
    uint32_t piece = 0;
  };
  std::vector<Hit> trace(const std::vector<Ray>& rays) const {
    std::vector<Hit> hits(rays.size());
    if (accel_.get() == nullptr || rays.empty()) return hits;
    std::vector<lumicut_rayhit> batch(rays.size());
    for (size_t i = 0; i < rays.size(); ++i) {
      lumicut_ray& r = batch[i].ray;
      r = {};
      r.org_x = static_cast<float>(rays[i].origin[0]), r.org_y = static_cast<float>(rays[i].origin[1]),
      r.org_z = static_cast<float>(rays[i].origin[2]);
      r.dir_x = static_cast<float>(rays[i].direction[0]), r.dir_y = static_cast<float>(rays[i].direction[1]),
      r.dir_z = static_cast<float>(rays[i].direction[2]);
      r.tnear = static_cast<float>(rays[i].near), r.tfar = static_cast<float>(rays[i].far);
      r.mask = ~0u;
      batch[i].hit = {};
      batch[i].hit.geom_id = batch[i].hit.inst_id = LUMICUT_NO_ID;
    }
    io::check(api_, api_.accel_intersect(accel_.get(), batch.data(), batch.size()), "preflight");
    for (size_t i = 0; i < rays.size(); ++i)
      if (batch[i].hit.geom_id != LUMICUT_NO_ID) hits[i] = {double{batch[i].ray.tfar}, piece_of_[batch[i].hit.prim_id]};
    return hits;
  }

  // Closed opaque pieces that hold the point: along three directions an odd number of walls.
  std::vector<uint32_t> around(const Point& p, double radius) const {
    static const std::array<Point, 3> kDirections = {
        Point{0.5773, 0.6113, 0.5413}, {-0.7813, 0.2371, 0.5774}, {0.1237, -0.8459, -0.5188}};
    std::map<uint32_t, int> odd;
    for (const Point& d : kDirections) {
      std::map<uint32_t, int> walls;
      Ray ray{p, d, 0, 1e30};
      for (int i = 0; i < 256; ++i) {
        const Hit hit = trace({ray})[0];
        if (hit.t < 0) break;
        ++walls[hit.piece];
        ray.near = hit.t * (1 + 1e-6) + 1e-6 * radius;
      }
      for (const auto& [piece, count] : walls)
        if (count % 2 == 1) ++odd[piece];
    }
    std::vector<uint32_t> found;
    for (const auto& [piece, count] : odd)
      if (count == 3 && pieces[piece].shell.closed && pieces[piece].shell.opaque && pieces[piece].box.contains(p))
        found.push_back(piece);
    return found;
  }

  std::vector<Piece> pieces;

 private:
  const io::Api& api_;
  io::Handle<lumicut_accel> accel_;
  std::vector<uint32_t> piece_of_;
};

class Examiner {
 public:
  Examiner(const io::Api& api, lumicut_device device, const io::SceneData& scene, const PreflightOptions& options)
      : api_(api), device_(device), scene_(scene), o_(options) {}

  Preflight run() {
    p_.approximated = scene_.warnings.lines();
    for (const auto& texture : scene_.textures)  // a program's is not known
      means_.push_back(texture.program ? Point{1, 1, 1} : texture_mean(texture, false));
    for (uint32_t m = 0; m < scene_.meshes.size(); ++m) shells_.push_back(find_shells(scene_, m));
    measure();
    count();
    lights();
    meshes();
    materials();
    scale();
    if (world_triangles_ <= std::min(kMostTriangles, std::max(kMostOfInstances, 2 * scene_.triangle_count()))) see();
    for (const auto& [key, tally] : tallies_) say(tally.kind, tally.text(tally.count));
    return std::move(p_);
  }

 private:
  void say(const char* kind, std::string text) { p_.suspicious.push_back({kind, std::move(text)}); }

  // One note a mesh and material however many pieces show the same.
  struct Tally {
    const char* kind;
    uint64_t count = 0;
    std::function<std::string(uint64_t)> text;
  };
  void tally(const char* kind, uint32_t mesh, uint32_t material, std::function<std::string(uint64_t)> text) {
    Tally& t = tallies_[{kind, mesh, material}];
    if (t.count++ == 0) t.kind = kind, t.text = std::move(text);
  }

  std::string mesh_name(uint32_t mesh) const { return fmt::format("mesh \"{}\"", scene_.meshes[mesh].name); }
  std::string name(uint32_t mesh, uint32_t triangle) const {
    return fmt::format("mesh \"{}\" (material \"{}\")", scene_.meshes[mesh].name,
                       scene_.materials[scene_.meshes[mesh].materials[triangle]].name);
  }
  std::string light_name(size_t i) const {
    return fmt::format("{} ({})", i < scene_.light_names.size() ? scene_.light_names[i] : fmt::format("light {}", i),
                       kLightTypes[scene_.lights[i].type]);
  }
  Point textured(const float (&factor)[3], int32_t texture) const {
    Point c = vec(factor);
    if (texture > 0)
      for (size_t k = 0; k < 3; ++k) c[k] *= means_[static_cast<size_t>(texture) - 1][k];
    return c;
  }

  // Nothing is known of what a program gives.
  bool programmed(int32_t texture) const {
    return texture > 0 && scene_.textures[static_cast<size_t>(texture) - 1].program.has_value();
  }

  void measure() {
    for (const auto& mesh : scene_.meshes)
      for (size_t i = 0; i < instance_count(mesh); ++i) {
        world_triangles_ += mesh.indices.size() / 3;
        for (const uint32_t v : mesh.indices) bounds_.extend(corner(mesh, v, i));
      }
    p_.radius = bounds_.diagonal() > 0 ? 0.5 * bounds_.diagonal() : 1.0;
    p_.clamp = o_.clamp_distance > 0 ? o_.clamp_distance : o_.clamp_relative * p_.radius;
  }

  void count() {
    uint64_t instances = 0, texture_bytes = 0, emissive = 0;
    double emitted = 0;
    for (const auto& mesh : scene_.meshes) {
      instances += instance_count(mesh);
      for (size_t t = 0; 3 * t < mesh.indices.size(); ++t) {
        const auto& m = scene_.materials[mesh.materials[t]].values;
        if (!(m.emission[0] + m.emission[1] + m.emission[2] > 0)) continue;
        const double radiance = luminance(textured(m.emission, m.emission_texture));
        const double sides = (m.flags & LUMICUT_EMIT_BOTH_SIDES) != 0 ? 2 : 1;
        for (size_t i = 0; i < instance_count(mesh); ++i) {
          const uint32_t* v = &mesh.indices[3 * t];
          const Point a = corner(mesh, v[0], i);
          ++emissive;
          emitted += kPi * radiance * sides * 0.5 * length(cross(corner(mesh, v[1], i) - a, corner(mesh, v[2], i) - a));
        }
      }
    }
    for (const auto& t : scene_.textures) texture_bytes += t.bytes.size() + t.floats.size() * sizeof(float);
    std::map<std::string, uint64_t> lights;
    std::map<std::string, double> power;
    for (const auto& light : scene_.lights) {
      ++lights[kLightTypes[light.type]];
      power[kLightTypes[light.type]] += power_of(light);
    }
    ordered_json& c = p_.counts;
    c["meshes"] = scene_.meshes.size(), c["instances"] = instances, c["triangles"] = scene_.triangle_count();
    c["triangles_with_instances"] = world_triangles_;
    c["emissive_triangles"] = emissive;
    c["materials"] = scene_.materials.size();
    c["textures"] = scene_.textures.size(), c["texture_bytes"] = texture_bytes;
    c["lights"] = ordered_json::object();
    for (const auto& [type, n] : lights) c["lights"][type] = n;
    c["environment"] = "none";
    double environment = 0;
    if (scene_.environment) {
      const auto& e = *scene_.environment;
      double radiance = luminance(e.color);
      if (e.texture > 0) {
        const auto& t = scene_.textures[static_cast<size_t>(e.texture) - 1];
        const Point mean = texture_mean(t, true);
        radiance = 0.2126 * mean[0] * e.color[0] + 0.7152 * mean[1] * e.color[1] + 0.0722 * mean[2] * e.color[2];
        c["environment"] = fmt::format("image {} x {}", t.width, t.height);
      } else {
        c["environment"] = "constant";
      }
      environment = 4 * kPi * radiance * kPi * p_.radius * p_.radius;
      if (!(environment > 0)) say("zero_power_light", "environment: it is black and gives no light");
    }
    for (const auto& [type, watt] : power) p_.power[type] = watt;
    if (emissive > 0) p_.power["emissive_meshes"] = emitted;
    if (scene_.environment) p_.power["environment"] = environment;
    double total = environment + emitted;
    for (const auto& [type, watt] : power) total += watt;
    p_.power["total"] = total;
    if (!(total > 0)) say("no_light", "nothing in the scene emits: the image will be black");
  }

  // ∫ values dω of a profile: linear in the angle times its sine.
  static double solid_angle(const io::Profile& p) {
    double sum = 0;
    const size_t n = p.vertical.size(), columns = std::max<size_t>(2, p.horizontal.size()) - 1;
    for (size_t column = 0; column < columns; ++column) {
      const size_t other = p.horizontal.size() == 1 ? 0 : column + 1;
      const double width = p.horizontal.size() == 1 ? 2 * kPi : double{p.horizontal[other]} - p.horizontal[column];
      for (size_t i = 0; i + 1 < n; ++i) {
        const double a = 0.5 * (double{p.values[column * n + i]} + p.values[other * n + i]);
        const double b = 0.5 * (double{p.values[column * n + i + 1]} + p.values[other * n + i + 1]);
        const double t0 = p.vertical[i], t1 = p.vertical[i + 1];
        sum += width * (a * std::cos(t0) - b * std::cos(t1) + (b - a) / (t1 - t0) * (std::sin(t1) - std::sin(t0)));
      }
    }
    return sum;
  }

  double power_of(const lumicut_light& l) const {
    const double value = double{l.value} * luminance(l.color);
    const bool watt = l.unit == LUMICUT_WATT;
    if (l.profile > 0) return value * solid_angle(scene_.profiles[l.profile - 1]) / (watt ? 4 * kPi : 1.0);
    switch (l.type) {
      case LUMICUT_POINT:
        return watt ? value : 4 * kPi * value;
      case LUMICUT_SPOT: {
        double solid_angle = 0;  // of its profile, by the midpoint rule over the cosine
        const double least = std::cos(0.5 * l.angle), step = (1 - least) / 1024;
        for (int i = 0; i < 1024; ++i) {
          const double c = least + (i + 0.5) * step;
          double x = l.blend > 0 ? std::min(1.0, (c - least) / ((1 - least) * l.blend)) : 1.0;
          x = x * x * (3 - 2 * x);
          solid_angle += 2 * kPi * step * x * (l.spot_cosine != 0 ? std::max(0.0, c) : 1.0);
        }
        return value * solid_angle / (watt ? 4 * kPi : 1.0);
      }
      case LUMICUT_SUN:
        return value * kPi * p_.radius * p_.radius;
      default: {
        const double area = length(cross(vec(l.u), vec(l.v))) * (l.type == LUMICUT_DISK ? kPi / 4 : 1.0);
        return watt ? kPi / 4 * value : kPi * area * value;
      }
    }
  }

  void lights() {
    for (size_t i = 0; i < scene_.lights.size(); ++i) {
      const auto& l = scene_.lights[i];
      if (!(double{l.value} * largest(vec(l.color)) > 0))
        say("zero_power_light",
            fmt::format("{}: gives no light ({} is 0)", light_name(i), l.value > 0 ? "color" : "value"));
    }
    for (const auto& m : scene_.materials) {
      const auto& v = m.values;
      if (v.emission[0] + v.emission[1] + v.emission[2] > 0 && !(largest(textured(v.emission, v.emission_texture)) > 0))
        say("zero_power_light", fmt::format("material \"{}\": its emission texture is black", m.name));
    }
  }

  void meshes() {
    for (uint32_t m = 0; m < scene_.meshes.size(); ++m) {
      if (shells_[m].degenerate > 0)
        say("degenerate_triangles",
            fmt::format("{}: {} of {} triangles have no area; the first is number {}", mesh_name(m),
                        shells_[m].degenerate, scene_.meshes[m].indices.size() / 3, shells_[m].first_degenerate));
      flipped_normals(m);
    }
    const auto duplicates = find_duplicates(scene_);
    std::map<std::pair<uint32_t, uint32_t>, std::pair<uint64_t, Duplicate>> pairs;
    for (const Duplicate& d : duplicates) {
      auto& entry = pairs[{d.mesh, d.other_mesh}];
      if (entry.first++ == 0) entry.second = d;
    }
    for (const auto& [key, entry] : pairs) {
      const Duplicate& d = entry.second;
      say("duplicate_faces",
          fmt::format("{}: {} triangles lie exactly on triangles of {}; the first is number {} on number {}",
                      name(d.mesh, d.triangle), entry.first,
                      d.mesh == d.other_mesh ? "its own" : name(d.other_mesh, d.other_triangle), d.triangle,
                      d.other_triangle));
    }
  }

  // Shading normals that oppose the geometric ones in most corners of a material.
  void flipped_normals(uint32_t m) {
    const io::Mesh& mesh = scene_.meshes[m];
    if (mesh.normals.empty()) return;
    struct Corners {
      uint64_t all = 0, opposed = 0;
      uint32_t first = 0;
    };
    std::map<uint32_t, Corners> by_material;
    for (uint32_t t = 0; 3 * size_t{t} < mesh.indices.size(); ++t) {
      const uint32_t* v = &mesh.indices[3 * size_t{t}];
      const auto at = [&](uint32_t i) {
        return Point{mesh.positions[3 * size_t{i}], mesh.positions[3 * size_t{i} + 1],
                     mesh.positions[3 * size_t{i} + 2]};
      };
      const Point a = at(v[0]), n = cross(at(v[1]) - a, at(v[2]) - a);
      Corners& c = by_material[mesh.materials[t]];
      for (size_t k = 0; k < 3; ++k) {
        const float* s = &mesh.normals[3 * size_t{v[k]}];
        const double d = n[0] * s[0] + n[1] * s[1] + n[2] * s[2];
        if (d != 0) ++c.all;
        if (d < 0 && c.opposed++ == 0) c.first = t;
      }
    }
    for (const auto& [material, c] : by_material)
      if (2 * c.opposed > c.all)
        say("flipped_normals",
            fmt::format("{}: in {:.0f} % of the corners the shading normal opposes the winding of the triangle",
                        name(m, c.first), 100.0 * static_cast<double>(c.opposed) / static_cast<double>(c.all)));
  }

  void materials() {
    std::vector<double> area(scene_.materials.size());
    for (const auto& mesh : scene_.meshes)
      for (size_t i = 0; i < instance_count(mesh); ++i)
        for (size_t t = 0; 3 * t < mesh.indices.size(); ++t) {
          const uint32_t* v = &mesh.indices[3 * t];
          const Point a = corner(mesh, v[0], i);
          area[mesh.materials[t]] += 0.5 * length(cross(corner(mesh, v[1], i) - a, corner(mesh, v[2], i) - a));
        }
    double reflected = 0, total = 0;
    for (size_t m = 0; m < area.size(); ++m) {
      const auto& v = scene_.materials[m].values;
      if (programmed(v.diffuse_texture) || programmed(v.specular_texture) || programmed(v.translucency_texture))
        continue;
      Point albedo = textured(v.diffuse, v.diffuse_texture) + textured(v.translucency, v.translucency_texture);
      // With Fresnel's curve it is a factor of what a coat reflects, which leaves the rest to what is beneath.
      const bool coated = (v.flags & LUMICUT_GGX) != 0 && (v.flags & LUMICUT_NO_FRESNEL) == 0;
      if (!coated) albedo = albedo + textured(v.specular, v.specular_texture);
      if (area[m] > 0 && largest(albedo) > 1.0 + 1e-4)
        say("albedo_above_one",
            fmt::format("material \"{}\": diffuse, specular and translucency together give back {:.3g} of the light",
                        scene_.materials[m].name, largest(albedo)));
      reflected += area[m] * std::min(1.0, luminance(albedo)), total += area[m];
    }
    if (total > 0 && reflected / total > 0.93)
      say("albedo_near_one",
          fmt::format(
              "surfaces reflect {:.1f} % of the light on the average: light paths hardly end, and what max_depth "
              "and clamp cut off is seen",
              100 * reflected / total));
  }

  void scale() {
    if (bounds_.empty()) return;
    const Point centre = (bounds_.lo + bounds_.hi) * 0.5;
    if (length(centre) > 2e3 * p_.radius)
      say("far_from_origin",
          fmt::format(
              "the scene's centre {} is {:.3g} times its radius {:.4g} from the origin: positions lose precision",
              shown(centre), length(centre) / p_.radius, p_.radius));
    if (o_.clamp_distance > 0 && (o_.clamp_distance > p_.radius || o_.clamp_distance < 1e-6 * p_.radius))
      say("clamp", fmt::format("clamp_distance {:.4g} is {} next to the scene's radius {:.4g}", o_.clamp_distance,
                               o_.clamp_distance > p_.radius ? "huge" : "tiny", p_.radius));
  }

  std::vector<World::Ray> camera_rays(uint32_t across, uint32_t down) const {
    const auto& c = scene_.camera;
    const auto column = [&](size_t k) {
      const Point v{c.to_world[k], c.to_world[4 + k], c.to_world[8 + k]};
      return k == 3 ? v : v * (1.0 / std::max(1e-300, length(v)));
    };
    const Point right = column(0), up = column(1), back = column(2), eye = column(3);
    const double aspect = o_.height > 0 ? static_cast<double>(o_.width) / o_.height : 1.0;
    std::vector<World::Ray> rays;
    for (uint32_t j = 0; j < down; ++j)
      for (uint32_t i = 0; i < across; ++i) {
        const double x = ((i + 0.5) / across - 0.5) * aspect * (c.pixel_aspect > 0 ? c.pixel_aspect : 1) + c.shift[0];
        const double y = 0.5 - (j + 0.5) / down + c.shift[1];
        World::Ray ray{eye, back * -1.0, c.near_clip, c.far_clip > 0 ? c.far_clip : 1e30};
        if (c.orthographic != 0) {
          ray.origin = eye + (right * x + up * y) * c.height;
        } else {
          ray.direction = ray.direction + (right * x + up * y) * (2 * std::tan(0.5 * c.fov_y));
        }
        rays.push_back(ray);  // not of unit length: t is the depth along the axis
      }
    return rays;
  }

  // What only rays tell.
  void see() {
    const World world(api_, device_, scene_, shells_);
    const auto& c = scene_.camera;
    const Point eye{c.to_world[3], c.to_world[7], c.to_world[11]};
    const auto hits = world.trace(camera_rays(48, 32));
    std::vector<double> depths;
    for (const auto& hit : hits)
      if (hit.t >= 0) depths.push_back(hit.t);
    std::sort(depths.begin(), depths.end());
    if (depths.empty()) {
      say("camera_sees_nothing", fmt::format("camera: from {} it sees no surface at all", shown(eye)));
    } else {
      const double median = depths[depths.size() / 2], ninth = depths[depths.size() * 9 / 10];
      if (depths.size() * 10 >= hits.size() * 9 && ninth < 0.003 * p_.radius)
        say("camera_blocked",
            fmt::format("camera: nearly all it sees is within {:.3g}, {:.2g} % of the scene's radius: "
                        "it stands right behind a surface",
                        ninth, 100 * ninth / p_.radius));
      else if (p_.clamp > 0.5 * median)
        say("clamp", fmt::format("the clamp distance {:.4g} is more than half of the median distance {:.4g} the camera "
                                 "sees: light near surfaces and corners goes lost; set clamp_distance",
                                 p_.clamp, median));
    }
    const auto around_camera = world.around(eye, p_.radius);
    for (const uint32_t piece : around_camera) {
      const auto& p = world.pieces[piece];
      if (p.shell.oriented && p.shell.volume > 0 && p.box.diagonal() < p_.radius)
        say("camera_inside", fmt::format("camera: {} is inside {}, a closed body whose front looks outwards",
                                         shown(eye), name(p.shell.mesh, p.shell.first_triangle)));
    }
    lights_inside(world, around_camera);
    emission(world, eye);
  }

  void lights_inside(const World& world, const std::vector<uint32_t>& around_camera) {
    constexpr size_t kMostLights = 1024;
    for (size_t i = 0, tried = 0; i < scene_.lights.size() && tried < kMostLights; ++i) {
      const auto& l = scene_.lights[i];
      if (l.type == LUMICUT_SUN) continue;
      ++tried;
      Point from = vec(l.position);
      if (l.type == LUMICUT_RECTANGLE || l.type == LUMICUT_DISK) {  // off its plane: it often lies on a surface
        const Point n = cross(vec(l.u), vec(l.v));
        from = from + n * (1e-4 * p_.radius / length(n));
      }
      for (const uint32_t piece : world.around(from, p_.radius)) {
        if (std::find(around_camera.begin(), around_camera.end(), piece) != around_camera.end()) continue;
        const auto& p = world.pieces[piece];
        say("light_inside", fmt::format("{}: stands inside {}, which is closed and lets no light out to the camera",
                                        light_name(i), name(p.shell.mesh, p.shell.first_triangle)));
      }
    }
  }

  Point centre(const Shell& s, uint32_t triangle, uint32_t instance, Point& normal) const {
    const io::Mesh& mesh = scene_.meshes[s.mesh];
    const uint32_t* v = &mesh.indices[3 * size_t{triangle}];
    const Point a = corner(mesh, v[0], instance), b = corner(mesh, v[1], instance), c = corner(mesh, v[2], instance);
    normal = cross(b - a, c - a);
    if (!mesh.transforms.empty()) {  // a mirror turns the winding over; the front stays the front
      const float* m = &mesh.transforms[12 * size_t{instance}];
      const Point x{m[0], m[4], m[8]}, y{m[1], m[5], m[9]}, z{m[2], m[6], m[10]};
      if (dot(cross(x, y), z) < 0) normal = normal * -1.0;
    }
    normal = normal * (1.0 / std::max(1e-300, length(normal)));
    return (a + b + c) * (1.0 / 3);
  }

  // Emissive pieces that shine into themselves, out of the scene, or at a wall right before them.
  void emission(const World& world, const Point& eye) {
    constexpr size_t kMostPieces = 4096;
    size_t tried = 0;
    for (const auto& p : world.pieces) {
      const Shell& s = p.shell;
      if (s.emissive == 0) continue;
      const uint32_t material = scene_.meshes[s.mesh].materials[s.emitter];
      Point normal;
      const Point place = centre(s, s.emitter, p.instance, normal);
      const std::string named = name(s.mesh, s.emitter), at = shown(place);
      const bool around_all = p.box.diagonal() > p_.radius || p.box.contains(eye);
      const double size = p.box.diagonal();
      if (s.oriented && std::abs(s.volume) > 1e-9 * size * size * size) {
        if (s.volume < 0 && !around_all)
          tally("emits_inwards", s.mesh, material, [named, at](uint64_t n) {
            return fmt::format("{}: {} emits into its own inside (its fronts look inwards); the first at {}", named,
                               n == 1 ? "a closed body" : fmt::format("{} closed bodies", n), at);
          });
        if (s.volume > 0 && s.emissive == s.triangles && p.box.contains(eye) && around_all)
          tally("emits_outwards", s.mesh, material, [named](uint64_t) {
            return fmt::format("{}: closed around the camera, but it emits outwards", named);
          });
        continue;
      }
      if (++tried > kMostPieces) continue;
      // A few rays from a few triangles to the front and to the back.
      std::vector<World::Ray> rays;
      const io::Mesh& mesh = scene_.meshes[s.mesh];
      const uint64_t step = std::max<uint64_t>(1, s.emissive / 8);
      uint64_t seen = 0;
      for (uint32_t t = s.emitter; 3 * size_t{t} < mesh.indices.size() && seen < s.emissive; ++t) {
        const auto& v = scene_.materials[mesh.materials[t]].values;
        if (shells_[s.mesh].shell_of[t] != shells_[s.mesh].shell_of[s.emitter] ||
            !(v.emission[0] + v.emission[1] + v.emission[2] > 0))
          continue;
        if (seen++ % step != 0) continue;
        const Point from = centre(s, t, p.instance, normal);
        const Point side = std::abs(normal[0]) < 0.7 ? Point{1, 0, 0} : Point{0, 1, 0};
        const Point x = cross(normal, side), y = cross(normal, x);
        for (const double facing : {1.0, -1.0})
          for (const Point& tilt :
               {Point{0, 0, 1}, Point{0.6, 0, 0.8}, Point{-0.6, 0, 0.8}, Point{0, 0.6, 0.8}, Point{0, -0.6, 0.8}})
            rays.push_back({from, x * tilt[0] + y * tilt[1] + normal * (tilt[2] * facing), 2e-5 * p_.radius, 1e30});
      }
      const auto hits = world.trace(rays);
      size_t useful[2] = {}, all[2] = {};
      for (size_t i = 0; i < hits.size(); ++i) {
        const size_t back = i / 5 % 2;
        ++all[back];
        if (hits[i].t > 0.004 * p_.radius) ++useful[back];
      }
      if (useful[0] == 0 && 2 * useful[1] >= all[1] && all[1] > 0)
        tally("emits_away", s.mesh, material, [named, at](uint64_t n) {
          return fmt::format("{}: {} emits away from the scene, which lies behind it; the first at {}", named,
                             n == 1 ? "a surface" : fmt::format("{} surfaces", n), at);
        });
    }
  }

  const io::Api& api_;
  lumicut_device device_;
  const io::SceneData& scene_;
  const PreflightOptions& o_;
  Preflight p_;
  std::vector<Point> means_;
  std::vector<MeshShells> shells_;
  std::map<std::tuple<std::string, uint32_t, uint32_t>, Tally> tallies_;
  Box bounds_;
  uint64_t world_triangles_ = 0;
};

}  // namespace

PreflightOptions preflight_options(const io::Api& api, lumicut_integrator integrator, uint32_t width, uint32_t height) {
  PreflightOptions o;
  o.width = width, o.height = height;
  const auto number = [&](const char* parameter, double otherwise) {
    const char* text = api.integrator_get(integrator, parameter);
    return text != nullptr ? std::strtod(text, nullptr) : otherwise;
  };
  o.clamp_distance = number("clamp_distance", o.clamp_distance);
  o.clamp_relative = number("clamp_relative", o.clamp_relative);
  return o;
}

Preflight preflight(const io::Api& api, lumicut_device device, const io::SceneData& scene,
                    const PreflightOptions& options) {
  return Examiner(api, device, scene, options).run();
}

std::vector<std::string> preflight_lines(const Preflight& p) {
  const ordered_json& c = p.counts;
  const auto n = [&](const char* key) { return c[key].get<uint64_t>(); };
  std::vector<std::string> lights;
  for (const auto& [type, count] : c["lights"].items()) lights.push_back(fmt::format("{} {}", count.dump(), type));
  std::vector<std::string> power;
  for (const auto& [kind, watt] : p.power.items())
    if (kind != "total") power.push_back(fmt::format("{} {:.4g} W", kind, watt.get<double>()));
  std::vector<std::string> lines = {
      fmt::format("{} meshes, {} instances, {} triangles ({} with instances), {} materials", n("meshes"),
                  n("instances"), n("triangles"), n("triangles_with_instances"), n("materials")),
      fmt::format("{} textures, {:.1f} MB", n("textures"), static_cast<double>(n("texture_bytes")) / 1e6),
      fmt::format("lights: {}; {} emissive triangles; environment: {}",
                  lights.empty() ? "none" : fmt::format("{}", fmt::join(lights, ", ")), n("emissive_triangles"),
                  c["environment"].get<std::string>()),
      fmt::format("emitted: {:.4g} W in all{}", p.power["total"].get<double>(),
                  power.empty() ? "" : fmt::format(" ({})", fmt::join(power, ", "))),
      fmt::format("radius {:.4g}, clamp distance {:.4g}", p.radius, p.clamp)};
  for (const auto& text : p.approximated) lines.push_back("approximated: " + text);
  for (const auto& s : p.suspicious) lines.push_back(fmt::format("suspicious: {}: {}", s.kind, s.text));
  return lines;
}

ordered_json preflight_json(const Preflight& p) {
  ordered_json all = {{"counts", p.counts}, {"power", p.power}, {"radius", p.radius}, {"clamp_distance", p.clamp}};
  all["approximated"] = p.approximated;
  all["suspicious"] = ordered_json::array();
  for (const auto& s : p.suspicious) all["suspicious"].push_back({{"kind", s.kind}, {"text", s.text}});
  return all;
}

}  // namespace lumicut::tools
