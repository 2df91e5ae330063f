// What decides an image is told apart in each of its fields: every leaf of every struct is changed, alone.
#include <gtest/gtest.h>

#include <set>

#include "render/frame.h"
#include "render/identity.h"
#include "scene/light_profile.h"

namespace {

using namespace lumicut;

// Changes the `leaf`-th number that it meets.
class ChangeOne {
 public:
  explicit ChangeOne(size_t leaf) : left_(leaf) {}

  // Name of what was changed; empty: there are fewer leaves.
  const std::string& changed() const { return changed_; }

  template <typename T>
  void operator()(std::string_view name, T& value) {
    if (!changed_.empty()) return;
    if constexpr (HasFields<T>) {
      for_each_field(value, *this);
      if (!changed_.empty()) changed_ = std::string(name) + "." + changed_;
    } else if constexpr (std::is_array_v<T>) {
      for (auto& v : value) (*this)(name, v);
    } else if constexpr (requires { value.use_count(); }) {
      // Shared content has a test of its own.
    } else if constexpr (requires { value.front(); }) {
      // A list: one more, and another last element.
      if (take(name)) return value.push_back({});
      if (!value.empty()) (*this)(name, value.back());
    } else if constexpr (requires { value.x; }) {
      (*this)(name, value.x), (*this)(name, value.y);
      if constexpr (requires { value.z; }) (*this)(name, value.z);
    } else if constexpr (requires { value.m; }) {
      (*this)(name, value.m);
    } else if constexpr (requires { value.has_value(); }) {
      if (!value) {
        if (take(name)) value.emplace();
      } else {
        (*this)(name, *value);
      }
    } else if (take(name)) {
      if constexpr (std::is_same_v<T, bool>)
        value = !value;
      else if constexpr (std::is_enum_v<T>)
        value = static_cast<T>(static_cast<int>(value) + 1);
      else
        value = static_cast<T>(value == T{} ? T{1} : T{});
    }
  }

 private:
  bool take(std::string_view name) {
    if (left_-- > 0) return false;
    changed_ = name;
    return true;
  }

  size_t left_;
  std::string changed_;
};

// Of a struct as it is: all leaves give keys of their own. Returns how many there are.
template <typename T>
size_t expect_every_field_counts(const T& value) {
  std::set<uint64_t> keys{hash_value(0, value)};
  EXPECT_EQ(hash_value(0, T(value)), *keys.begin());
  for (size_t leaf = 0;; ++leaf) {
    T other = value;
    ChangeOne change(leaf);
    for_each_field(other, change);
    if (change.changed().empty()) return leaf;
    EXPECT_TRUE(keys.insert(hash_value(0, other)).second) << change.changed();
  }
}

TEST(Identity, EveryFieldOfAMaterialCounts) { EXPECT_EQ(expect_every_field_counts(Material{}), 53u); }
TEST(Identity, EveryFieldOfALightCounts) { EXPECT_EQ(expect_every_field_counts(Light{}), 32u); }
TEST(Identity, EveryFieldOfAnEnvironmentCounts) { EXPECT_EQ(expect_every_field_counts(Environment{}), 18u); }
TEST(Identity, EveryFieldOfACameraCounts) { EXPECT_EQ(expect_every_field_counts(Camera{}), 31u); }
TEST(Identity, EveryFieldOfAVirtualLightCounts) { EXPECT_EQ(expect_every_field_counts(Vpl{}), 31u); }
TEST(Identity, EveryFieldOfAFrameCounts) {
  EXPECT_EQ(expect_every_field_counts(FrameOptions{}), 17u);
  FrameOptions frame;
  frame.camera_samples = {0, 0};
  EXPECT_EQ(expect_every_field_counts(frame), 18u);
}
TEST(Identity, EveryFieldOfAMeshCounts) {
  EXPECT_EQ(expect_every_field_counts(Mesh{}), 14u);
  Mesh mesh;
  mesh.positions.resize(2), mesh.normals.resize(1), mesh.uvs.resize(1), mesh.instances.resize(1);
  mesh.indices = {1}, mesh.triangle_materials = {2};
  MeshAttribute attribute;
  attribute.values = {1};
  mesh.attributes = {attribute};
  EXPECT_EQ(expect_every_field_counts(mesh), 14u + 3 + 3 + 2 + 1 + 1 + 12 + 5);
}
TEST(Identity, EveryFieldOfATextureCounts) {
  const uint8_t bytes[] = {1, 2};
  const float floats[] = {1, 2};
  EXPECT_EQ(expect_every_field_counts(Texture(2, 1, 1, Texture::Format::uint8, {}, bytes)), 12u);
  EXPECT_EQ(expect_every_field_counts(Texture(2, 1, 1, Texture::Format::float32, {}, floats)), 12u);
}
TEST(Identity, EveryFieldOfATextureProgramCounts) {
  ProgramInstruction position;
  position.op = static_cast<uint32_t>(ProgramOp::position);
  // Of an instruction its operation, mode, eight inputs, data and count; constants, the table, what bumps need.
  EXPECT_EQ(expect_every_field_counts(TextureProgram({position}, {{}}, {0})), 1u + 12 + 1 + 3 + 1 + 1 + 1);
}
TEST(Identity, TexturesCountByTheirProgram) {
  const auto hash = [](ProgramOp op) {
    ProgramInstruction in;
    in.op = static_cast<uint32_t>(op);
    return hash_value(0, Texture(TextureProgram({in}, {}, {})));
  };
  EXPECT_EQ(hash(ProgramOp::uv), hash(ProgramOp::uv));
  EXPECT_NE(hash(ProgramOp::uv), hash(ProgramOp::position));
}
TEST(Identity, EveryFieldOfLightTracingCounts) { EXPECT_EQ(expect_every_field_counts(VplOptions{}), 6u); }
TEST(Identity, EveryFieldOfALightProfileCounts) {
  EXPECT_EQ(expect_every_field_counts(LightProfile({0, 1, 2}, {0}, {1, 2, 1})), 11u);
}
TEST(Identity, LightProfilesCountByTheirContent) {
  const auto hash = [](float value) {
    LightProfiles profiles;
    profiles.add(
        std::make_shared<LightProfile>(std::vector<float>{0, 1}, std::vector<float>{0}, std::vector<float>{1, value}));
    return hash_value(0, profiles);
  };
  EXPECT_EQ(hash(0.5f), hash(0.5f));
  EXPECT_NE(hash(0.5f), hash(0.6f));
  EXPECT_NE(hash(0.5f), hash_value(0, LightProfiles{}));
}
TEST(Identity, EveryFieldOfASetOfVirtualLightsCounts) {
  EXPECT_EQ(expect_every_field_counts(VplSet{{Vpl{}, Vpl{}}, 3, 1, 0, 1, 1, {}, {}, {}}), 40u);
}
TEST(Identity, EveryFieldOfAScenesConfigurationCounts) { EXPECT_GE(expect_every_field_counts(Scene::Config{}), 3u); }

// Arrays whose elements go from one to the next are others.
TEST(Identity, NeighbouringListsAreToldApart) {
  Mesh a, b;
  a.indices = {1, 2}, a.triangle_materials = {3};
  b.indices = {1}, b.triangle_materials = {2, 3};
  EXPECT_NE(hash_value(0, a), hash_value(0, b));
}

TEST(Identity, NamesWhatDiffersFirst) {
  const auto text = [](const std::string& a, const std::string& b) {
    const auto d = difference(a, b);
    return d ? d->text() : "";
  };
  EXPECT_EQ(text("a=1\nb=#2\n", "a=1\nb=#2\n"), "");
  EXPECT_EQ(text("a=1\nb=#2\n", "a=3\nb=#4\n"), "a=1 instead of 3");
  EXPECT_EQ(text("a=1\nb=#2\n", "a=1\nb=#4\n"), "other b");
  // From another version, or made by hand.
  for (const char* saved : {"", "a=1\n", "a=1\nc=2\n", "a=1\nb=#2\nc=3\n", "\n\n", "a=1\nb"})
    EXPECT_NE(text(saved, "a=1\nb=#2\n"), "") << saved;
}

}  // namespace
