// A tree as bytes, and back: what a host saves and loads.
#include <cstring>
#include <string>

#include "integrators/wspd/wspd_tree.h"
#include "lights/falloff.h"

namespace lumicut {

namespace {

template <typename T>
size_t bytes_of(const std::vector<T>& v) {
  return v.size() * sizeof(T);
}

template <typename T>
void write_value(std::vector<uint8_t>& out, const T& value) {
  const auto* bytes = reinterpret_cast<const uint8_t*>(&value);
  out.insert(out.end(), bytes, bytes + sizeof(T));
}

template <typename T>
void write_array(std::vector<uint8_t>& out, const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  write_value(out, uint64_t{values.size()});
  const auto* bytes = reinterpret_cast<const uint8_t*>(values.data());
  out.insert(out.end(), bytes, bytes + bytes_of(values));
}

class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  template <typename T>
  void value(T& out) {
    if (bytes_.size() < sizeof(T)) fail_argument("wspd state: it ends too early");
    std::memcpy(static_cast<void*>(&out), bytes_.data(), sizeof(T));
    bytes_ = bytes_.subspan(sizeof(T));
  }
  template <typename T>
  void array(std::vector<T>& out) {
    uint64_t count = 0;
    value(count);
    if (count > bytes_.size() / sizeof(T)) fail_argument("wspd state: it ends too early");
    out.resize(count);
    if (count > 0) std::memcpy(static_cast<void*>(out.data()), bytes_.data(), count * sizeof(T));
    bytes_ = bytes_.subspan(count * sizeof(T));
  }
  void end() const {
    if (!bytes_.empty()) fail_argument("wspd state: bytes follow its end");
  }

 private:
  std::span<const uint8_t> bytes_;
};

}  // namespace

size_t WspdTree::bytes() const {
  return bytes_of(lights_) + bytes_of(codes_) + bytes_of(leaf_) + bytes_of(nodes_) + bytes_of(pair_begin_) +
         bytes_of(pairs_) + bytes_of(groups_) + bytes_of(cubemaps_) + bytes_of(distant_);
}

void WspdTree::save(std::vector<uint8_t>& out) const {
  out.reserve(out.size() + bytes() + 256);
  write_value(out, cube_.lower), write_value(out, cube_.side), write_value(out, cube_.shift), write_value(out, root_);
  write_array(out, lights_), write_array(out, codes_), write_array(out, leaf_), write_array(out, nodes_);
  write_array(out, pair_begin_), write_array(out, pairs_), write_array(out, groups_), write_array(out, cubemaps_);
  write_array(out, distant_);
}

WspdTree WspdTree::load(std::span<const uint8_t> bytes, const LightProfiles& profiles) {
  WspdTree t;
  Reader in(bytes);
  in.value(t.cube_.lower), in.value(t.cube_.side), in.value(t.cube_.shift), in.value(t.root_);
  in.array(t.lights_), in.array(t.codes_), in.array(t.leaf_), in.array(t.nodes_);
  in.array(t.pair_begin_), in.array(t.pairs_), in.array(t.groups_), in.array(t.cubemaps_);
  in.array(t.distant_);
  in.end();
  t.check(profiles);
  return t;
}

// All that following an index, choosing a cell and shading rely on.
void WspdTree::check(const LightProfiles& profiles) const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) fail_argument(std::string("wspd state: ") + what + " make no sense");
  };
  const size_t n = nodes_.size();
  const auto positive = [](float x) { return std::isfinite(x) && x >= 0.0f; };
  const auto light = [&](const Vpl& v) {
    return static_cast<uint32_t>(v.kind) < kVplKinds && is_finite(v.position) && is_finite(v.normal) &&
           positive(v.intensity.x) && positive(v.intensity.y) && positive(v.intensity.z) &&
           std::isfinite(v.edge_or_radius) && std::isfinite(v.blend_cosine) && std::isfinite(v.spot_cosine) &&
           std::isfinite(v.spread_tan) && std::isfinite(v.again) && std::isfinite(v.retro) && std::isfinite(v.dim) &&
           std::isfinite(v.falloff) && (v.profile == 0 || profiles.find(v.profile) != nullptr);
  };
  require(is_finite(cube_.lower) && positive(cube_.side) && cube_.side > 0.0f, "bounds");
  for (const double s : cube_.shift) require(s >= 0.0 && s <= 1.0, "bounds");
  require(root_ == WspdNode::kNone ? codes_.empty() : root_ < n && !codes_.empty(), "roots");
  require(codes_.size() == leaf_.size() && codes_.size() <= lights_.size(), "lights");
  for (const Vpl& v : lights_) require(light(v), "lights");
  for (const Vpl& v : groups_) require(light(v), "subgroups");
  for (uint32_t leaf : leaf_) require(leaf < n, "leaves");
  for (size_t i = 0; i < n; ++i) {
    const WspdNode& node = nodes_[i];
    require(is_finite(node.center) && positive(node.radius) && positive(node.power) && positive(node.largest_sphere),
            "nodes");
    require(node.first < node.last && node.last <= lights_.size(), "nodes");
    require(node.child_count <= 8 && uint64_t{node.first_child} + node.child_count <= n, "nodes");
    require(node.leaf() || node.first_child > i, "nodes");  // so that no walk goes round
    require(node.parent == WspdNode::kNone || node.parent < i, "nodes");
    require(uint64_t{node.first_group} + node.group_count <= groups_.size(), "subgroups");
    require(node.cubemap == WspdNode::kNone || node.cubemap < cubemaps_.size(), "cubemaps");
  }
  require(pair_begin_.size() == n + 1 && pair_begin_[0] == 0 && pair_begin_[n] == pairs_.size(), "pairs");
  for (size_t i = 0; i < n; ++i) require(pair_begin_[i] <= pair_begin_[i + 1], "pairs");
  // Whatever a point may take for a cluster, or split one into, has something to be lit from.
  for (uint32_t p : pairs_) require(p < n && nodes_[p].group_count > 0, "pairs");
  for (uint32_t d : distant_) require(d < n && nodes_[d].group_count > 0, "distant lights");
  for (const WspdNode& node : nodes_) {
    require(!node.leaf() || node.group_count > 0, "subgroups");
    for (uint32_t c = 0; c < node.child_count && node.group_count > 0; ++c)
      require(nodes_[node.first_child + c].group_count > 0, "subgroups");
  }
}

}  // namespace lumicut
