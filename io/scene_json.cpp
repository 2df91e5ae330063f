#include "io/scene_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <map>
#include <set>

#include "io/affine.h"
#include "io/binary_block.h"
#include "io/file_error.h"
#include "io/ies_file.h"
#include "io/json_reader.h"
#include "io/path_variables.h"
#include "io/program_json.h"
#include "io/scene_obj.h"
#include "io/sky.h"
#include "io/texture_store.h"

namespace lumicut::io {

namespace fs = std::filesystem;

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr uint64_t kMaxSceneBytes = uint64_t{1} << 30;

double radians(double degrees) { return degrees * kPi / 180.0; }

// Row-major 3x4.
using Matrix = std::array<double, 12>;
constexpr Matrix kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

Matrix multiply(const Matrix& a, const Matrix& b) {
  Matrix m{};
  for (size_t r = 0; r < 3; ++r)
    for (size_t c = 0; c < 4; ++c) {
      m[r * 4 + c] = c == 3 ? a[r * 4 + 3] : 0.0;
      for (size_t k = 0; k < 3; ++k) m[r * 4 + c] += a[r * 4 + k] * b[k * 4 + c];
    }
  return m;
}

Matrix rotation(const Vec& axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle), t = 1 - c;
  const auto [x, y, z] = axis;
  return {t * x * x + c,     t * x * y - s * z, t * x * z + s * y, 0,
          t * x * y + s * z, t * y * y + c,     t * y * z - s * x, 0,
          t * x * z - s * y, t * y * z + s * x, t * z * z + c,     0};
}

class SceneReader {
 public:
  explicit SceneReader(const std::string& path)
      : path_(path), variables_(fs::path(path).parent_path().string()), textures_(scene_.textures) {}

  SceneData read() try {
    const auto json = parse_json(read_whole_file(path_, kMaxSceneBytes), path_);
    JsonObject root(JsonValue(json, path_, ""));
    root.text("description", "");
    z_up_ = (root.has("up") ? root.need("up").choice({"y", "z"}) : 0) == 1;
    scale_ = root.number("unit_scale", 1.0, 1e-12, 1e12);
    if (auto image = root.find("image")) read_image(*image);
    read_camera(root.need("camera"));
    if (auto programs = root.find("programs")) read_programs(*programs);
    if (auto materials = root.find("materials")) read_materials(*materials);
    // Small things first: a misspelt key shall not wait for big meshes.
    const auto meshes = root.find("meshes");
    if (auto lights = root.find("lights"))
      for (const auto& light : lights->elements()) read_light(light);
    const auto environment = root.find("environment");
    root.finish();
    if (environment) read_environment(*environment);
    if (meshes)
      for (const auto& mesh : meshes->elements()) read_mesh(mesh);
    if (!scene_.environment && scene_.lights_of_catchers.empty())
      for (const Mesh& mesh : scene_.meshes)
        if (mesh.shadow_catcher)
          scene_.warnings.add(
              "shadow catchers that nothing lights", path_,
              fmt::format("{}: a shadow catcher shows no shadow where no light has \"shadow_catcher\" and there "
                          "is no environment",
                          mesh.name));
    std::move(visible_lights_.begin(), visible_lights_.end(), std::back_inserter(scene_.meshes));
    if (scene_.meshes.empty()) root.value().fail("has neither meshes nor visible lights: there is nothing to see");
    check_lit();
    scene_.file = variables_.hide(path_);
    scene_.warnings.rewrite([&](const std::string& text) { return variables_.hide(text); });
    return std::move(scene_);
  } catch (const FileError& error) {
    throw FileError(variables_.hide(error.what()));
  }

 private:
  // ---- Paths ----

  std::string resolve(const JsonValue& value) {
    return variables_.resolve(value, [&](const std::string& name) {
      if (name != "LUMICUT_SCENES") value.fail(fmt::format("the environment variable {} is not set", name));
      return default_meshes(value);
    });
  }

  // The nearest folder shared/scenes beside one of the folders that hold the scene file.
  std::string default_meshes(const JsonValue& value) const {
    std::error_code code;
    for (fs::path folder = fs::absolute(path_).lexically_normal().parent_path();; folder = folder.parent_path()) {
      if (fs::is_directory(folder / "shared/scenes", code)) return (folder / "shared/scenes").string();
      if (folder == folder.root_path()) break;
    }
    value.fail("LUMICUT_SCENES is not set, and there is no folder shared/scenes next to this project");
  }

  // ---- Small parts ----

  // Of a coordinate or a length in the file's unit.
  double largest() const { return kLargestCoordinate / scale_; }

  Vec point(const JsonValue& value) const { return value.vector3(-largest(), largest()) * scale_; }

  // Scaled like a point, but of its own length.
  Vec edge(const JsonValue& value) const {
    const Vec v = value.vector3(-largest(), largest()) * scale_;
    if (!(length(v) > 0)) value.fail_expected("a vector that is not zero");
    return v;
  }

  static Vec direction(const JsonValue& value) {
    const Vec v = value.vector3(-kLargestCoordinate, kLargestCoordinate);
    if (!(length(v) > 0)) value.fail_expected("a direction, which is not zero");
    return v * (1.0 / length(v));
  }

  static uint32_t group(JsonObject& object) { return static_cast<uint32_t>(object.integer("group", 0, 0, 65535)); }

  Matrix matrix(const JsonValue& value) const {
    const auto numbers = value.numbers(12, -kLargestCoordinate, kLargestCoordinate);
    Matrix m{};
    std::copy(numbers.begin(), numbers.end(), m.begin());
    return m;
  }

  // Twelve numbers, or { "scale", "rotate", "translate" } applied in this order.
  Matrix transform(const JsonValue& value) const {
    Matrix m = kIdentity;
    if (value.raw().is_array()) {
      m = matrix(value);
    } else {
      JsonObject object(value);
      if (auto scale = object.find("scale")) {
        const Vec s =
            scale->raw().is_number() ? Vec{scale->number(), scale->number(), scale->number()} : scale->vector3();
        for (size_t k = 0; k < 3; ++k) m[k * 5] = s[k];
      }
      if (auto rotate = object.find("rotate")) {
        JsonObject turn(*rotate);
        const Vec axis = direction(turn.need("axis"));
        m = multiply(rotation(axis, radians(turn.need("degrees").number(-36000, 36000))), m);
        turn.finish();
      }
      if (auto translate = object.find("translate")) {
        const Vec t = translate->vector3(-kLargestCoordinate, kLargestCoordinate);
        for (size_t k = 0; k < 3; ++k) m[k * 4 + 3] += t[k];
      }
      object.finish();
    }
    const auto as_float = [&](size_t k) { return static_cast<double>(static_cast<float>(m[k])); };  // as it is rendered
    const Vec x{as_float(0), as_float(4), as_float(8)}, y{as_float(1), as_float(5), as_float(9)},
        z{as_float(2), as_float(6), as_float(10)};
    if (!(std::abs(dot(cross(x, y), z)) > 0)) value.fail("the transform flattens space (its determinant is 0)");
    return m;
  }

  // ---- Image and camera ----

  void read_image(const JsonValue& value) {
    JsonObject image(value);
    if (auto size = image.find("size")) {
      const auto elements = size->elements();
      if (elements.size() != 2) size->fail_expected("[width, height]");
      scene_.width = static_cast<uint32_t>(elements[0].integer(1, 65536));
      scene_.height = static_cast<uint32_t>(elements[1].integer(1, 65536));
    }
    scene_.samples = static_cast<uint32_t>(image.integer("samples", 1, 1, 65536));
    if (auto filter = image.find("filter"))
      scene_.filter = static_cast<uint32_t>(filter->choice({"box", "gaussian", "blackman_harris"}));
    if (scene_.filter != LUMICUT_BOX)
      scene_.filter_width = static_cast<float>(image.number("filter_width", 1.5, 0.01, 10));
    image.finish();
  }

  static void read_panorama(JsonObject& object, lumicut_camera& camera) {
    const auto angles = [&](const char* key, float* out, double most) {
      const auto given = object.find(key);
      const auto pair = given ? given->numbers(2, -most, most) : std::vector<double>{-most, most};
      out[0] = static_cast<float>(radians(pair[0])), out[1] = static_cast<float>(radians(pair[1]));
    };
    if (camera.panorama == LUMICUT_EQUIRECTANGULAR) {
      angles("longitude", camera.longitude, 180);
      angles("latitude", camera.latitude, 90);
      return;
    }
    if (camera.panorama == LUMICUT_MIRROR_BALL || camera.panorama == LUMICUT_EQUIANGULAR_CUBE) return;
    camera.fisheye_fov = static_cast<float>(radians(object.need("fov").number(0.1, 360)));
    if (camera.panorama == LUMICUT_FISHEYE_EQUIDISTANT) return;
    camera.fisheye_lens = static_cast<float>(object.need("lens").number(1e-6, 1e6));
    const auto sensor = object.need("sensor").numbers(2, 1e-6, 1e6);
    camera.sensor[0] = static_cast<float>(sensor[0]), camera.sensor[1] = static_cast<float>(sensor[1]);
  }

  void read_camera(const JsonValue& value) {
    JsonObject object(value);
    lumicut_camera& camera = scene_.camera;
    camera.struct_size = sizeof(camera);
    const size_t type =
        object.has("type")
            ? object.need("type").choice({"perspective", "orthographic", "equirectangular", "fisheye_equidistant",
                                          "fisheye_equisolid", "mirror_ball", "equiangular_cube"})
            : 0;
    camera.orthographic = type == 1;
    camera.panorama = type < 2 ? 0 : static_cast<uint32_t>(type - 1);
    Matrix m{};
    if (auto given = object.find("matrix")) {
      m = matrix(*given);
      for (const size_t k : {3u, 7u, 11u}) m[k] = checked(*given, m[k] * scale_);
      const Vec x{m[0], m[4], m[8]}, y{m[1], m[5], m[9]}, z{m[2], m[6], m[10]};
      if (!(std::abs(dot(cross(x, y), z)) > 0))
        given->fail("the camera's axes lie in one plane (the determinant is 0)");
      if (object.has("eye") || object.has("at") || object.has("up"))
        value.fail("give either \"matrix\" or \"eye\", \"at\", \"up\"");
    } else {
      const Vec eye = point(object.need("eye")), at = point(object.need("at"));
      const Vec up = object.has("up") ? direction(object.need("up")) : (z_up_ ? Vec{0, 0, 1} : Vec{0, 1, 0});
      const Vec back = eye - at;
      if (!(length(back) > 0)) object.need("at").fail("is the same point as \"eye\"");
      const Vec z = back * (1.0 / length(back));
      Vec x = cross(up, z);
      if (!(length(x) > 1e-6)) value.fail("looks along its own \"up\"; give another \"up\"");
      x = x * (1.0 / length(x));
      const Vec y = cross(z, x);
      m = {x[0], y[0], z[0], eye[0], x[1], y[1], z[1], eye[1], x[2], y[2], z[2], eye[2]};
    }
    for (size_t k = 0; k < 12; ++k) camera.to_world[k] = static_cast<float>(m[k]);
    if (camera.orthographic) {
      camera.height = static_cast<float>(object.need("height").number(1e-20 / scale_, largest()) * scale_);
    } else if (camera.panorama != 0) {
      read_panorama(object, camera);
    } else {
      camera.fov_y = static_cast<float>(radians(object.need("fov_y").number(0.01, 179.0)));
    }
    if (auto shift = object.find("shift")) {
      const auto s = shift->numbers(2, -100, 100);
      camera.shift[0] = static_cast<float>(s[0]), camera.shift[1] = static_cast<float>(s[1]);
    }
    camera.near_clip = static_cast<float>(object.number("near", 0, 0, largest()) * scale_);
    camera.far_clip = static_cast<float>(object.number("far", 0, 0, largest()) * scale_);
    if (camera.far_clip != 0 && camera.far_clip <= camera.near_clip)
      value.fail("\"far\" must be beyond \"near\" (or 0: no limit)");
    if (camera.panorama != 0) return object.finish();
    camera.pixel_aspect = static_cast<float>(object.number("pixel_aspect", 1, 0.01, 100));
    camera.lens_radius = static_cast<float>(object.number("lens_radius", 0, 0, largest()) * scale_);
    camera.focus_distance = static_cast<float>(object.number("focus_distance", 0, 0, largest()) * scale_);
    if (camera.lens_radius > 0 && !(camera.focus_distance > 0))
      value.fail("a \"lens_radius\" needs a \"focus_distance\"");
    object.finish();
  }

  // ---- Materials ----

  // Changes of `m` that the object's keys ask for.
  void change_material(JsonObject& object, lumicut_material& m, const std::string& name) {
    const auto colour = [&](const char* key, float* out, double maximum) {
      if (auto value = object.find(key)) store(out, value->vector3(0, maximum));
    };
    // A texture's factor may be above 1: the product is cut, place by place.
    const auto most = [&](const char* key, int32_t inherited) {
      const auto given = object.find(key);
      return (given ? !given->raw().is_null() : inherited > 0) ? 1e6 : 1.0;
    };
    colour("diffuse", m.diffuse, most("diffuse_texture", m.diffuse_texture));
    colour("specular", m.specular, most("specular_texture", m.specular_texture));
    colour("translucency", m.translucency, most("translucency_texture", m.translucency_texture));
    colour("emission", m.emission, 1e15);
    if (auto opacity = object.find("opacity")) m.opacity = std::max(kHole, static_cast<float>(opacity->number(0, 1)));
    if (auto model = object.find("model")) {
      constexpr uint32_t kFlags[] = {0, LUMICUT_PHONG, LUMICUT_GGX};
      const uint32_t before = m.flags;
      m.flags = (m.flags & ~uint32_t{LUMICUT_PHONG | LUMICUT_GGX}) | kFlags[model->choice({"blinn", "phong", "ggx"})];
      // Of another meaning there: a multiple of the reflectance that the index of refraction gives.
      if ((m.flags & ~before & LUMICUT_GGX) != 0 && !object.has("specular"))
        for (float& c : m.specular) c = 1.0f;
      if (((m.flags ^ before) & LUMICUT_GGX) != 0) m.flags &= ~uint32_t{LUMICUT_FACETS_ONCE};  // of another meaning too
    }
    const bool ggx = (m.flags & LUMICUT_GGX) != 0;
    const auto number = [&](const char* key, float& out, double low, double high, bool of_model,
                            const char* models = "the model \"ggx\"") {
      const auto value = object.find(key);
      if (!value) return;
      if (!of_model) value->fail(ggx ? "is not of the model \"ggx\"" : fmt::format("is of {} alone", models));
      out = static_cast<float>(value->number(low, high));
    };
    const auto set_flag = [&](uint32_t flag, bool on) { m.flags = on ? m.flags | flag : m.flags & ~flag; };
    if (auto fresnel = object.find("fresnel")) {
      if (!ggx) fresnel->fail("is of the model \"ggx\" alone");
      set_flag(LUMICUT_NO_FRESNEL, !fresnel->boolean());
    }
    if (auto burley = object.find("burley")) {
      if (!ggx) burley->fail("is of the model \"ggx\" alone");
      set_flag(LUMICUT_BURLEY, burley->boolean());
      if ((m.flags & LUMICUT_BURLEY) != 0 && (m.flags & LUMICUT_NO_FRESNEL) != 0)
        burley->fail("must be false where \"fresnel\" is");
    }
    const auto shadows = object.find("shadows_pass");
    if (shadows) {
      if (!ggx) shadows->fail("is of the model \"ggx\" alone");
      set_flag(LUMICUT_SHADOWS_PASS, shadows->boolean());
    }
    const auto open = object.find("open_glass");
    if (open) {
      if (!ggx) open->fail("is of the model \"ggx\" alone");
      set_flag(LUMICUT_OPEN_GLASS, open->boolean());
    }
    if (auto facets = object.find("diffuse_facets")) {
      if (!ggx) facets->fail("is of the model \"ggx\" alone");
      set_flag(LUMICUT_DIFFUSE_ONCE, facets->choice({"often", "once"}) == 1);
    }
    if (!ggx) m.flags &= ~uint32_t{LUMICUT_NO_FRESNEL | LUMICUT_BURLEY | LUMICUT_SHADOWS_PASS | LUMICUT_DIFFUSE_ONCE};
    if (auto tint = object.find("specular_tint")) {
      if (!ggx) tint->fail("is of the model \"ggx\" alone");
      store(m.specular_tint, tint->vector3(1e-6, 1));
    }
    if (auto absorption = object.find("absorption")) {
      if (!ggx) absorption->fail("is of the model \"ggx\" alone");
      store(m.absorption, absorption->vector3(0, 1e9) * (1.0 / scale_));
    }
    if (auto oren_nayar = object.find("oren_nayar")) {
      if (ggx) oren_nayar->fail("is not of the model \"ggx\"");
      constexpr uint32_t kOnce = LUMICUT_OREN_NAYAR | LUMICUT_FACETS_ONCE, kFlags[] = {0, kOnce, LUMICUT_OREN_NAYAR};
      m.flags = (m.flags & ~kOnce) | kFlags[oren_nayar->choice({"none", "once", "often"})];
    }
    if (auto again = object.find("multiple_scattering")) {
      if (!ggx) again->fail("is of the model \"ggx\" alone");
      constexpr uint32_t kFlags[] = {0, LUMICUT_BRIGHT_LOBE, LUMICUT_FACETS_ONCE};
      m.flags = (m.flags & ~(kFlags[1] | kFlags[2])) | kFlags[again->choice({"even", "lobe", "none"})];
    }
    if (ggx)
      m.flags &= ~uint32_t{LUMICUT_OREN_NAYAR};
    else
      m.flags &= ~uint32_t{LUMICUT_BRIGHT_LOBE};
    if ((m.flags & (LUMICUT_GGX | LUMICUT_OREN_NAYAR)) == 0) m.flags &= ~uint32_t{LUMICUT_FACETS_ONCE};
    number("shininess", m.shininess, 0, 1e6, !ggx);
    number("roughness", m.roughness, 0, 1, ggx || (m.flags & LUMICUT_OREN_NAYAR) != 0,
           "the model \"ggx\" and of \"oren_nayar\" surfaces");
    number("diffuse_roughness", m.diffuse_roughness, 0, 1, ggx);
    if ((m.flags & LUMICUT_BURLEY) != 0 && m.diffuse_roughness > 0) {
      if (auto given = object.find("diffuse_roughness")) given->fail("must be 0 where \"burley\" is true");
      object.need("burley").fail("must be false where \"diffuse_roughness\" is above 0");
    }
    number("metallic", m.metallic, 0, 1, ggx);
    number("transmission", m.transmission, 0, 1, ggx);
    if ((m.flags & LUMICUT_NO_FRESNEL) != 0)
      for (const char* key : {"metallic", "transmission"})
        if (auto given = object.find(key); given && given->number(0, 1) > 0)
          given->fail("must be 0 where \"fresnel\" is false");
    if ((m.flags & LUMICUT_SHADOWS_PASS) != 0 && !(m.transmission > 0.0f)) {
      if (shadows) shadows->fail("needs a \"transmission\" above 0");
      m.flags &= ~uint32_t{LUMICUT_SHADOWS_PASS};  // of the material that this one changes
    }
    if ((m.flags & LUMICUT_OPEN_GLASS) != 0 && (m.flags & LUMICUT_SHADOWS_PASS) == 0) {
      if (open) open->fail("needs \"shadows_pass\"");
      m.flags &= ~uint32_t{LUMICUT_OPEN_GLASS};
    }
    if ((m.flags & LUMICUT_OPEN_GLASS) != 0 && *std::max_element(m.absorption, m.absorption + 3) > 0) {
      if (auto given = object.find("absorption")) given->fail("must be 0 where \"open_glass\" is true");
      object.need("open_glass").fail("must be false where \"absorption\" is above 0");
    }
    number("ior", m.ior, 0.1, 10, ggx);
    number("coat", m.coat, 0, 1, ggx);
    number("coat_roughness", m.coat_roughness, 0, 1, ggx);
    number("coat_ior", m.coat_ior, 1, 10, ggx);
    if (auto both = object.find("emit_both_sides")) set_flag(LUMICUT_EMIT_BOTH_SIDES, both->boolean());
    if (auto holdout = object.find("holdout")) set_flag(LUMICUT_HOLDOUT, holdout->boolean());
    if (auto bumps = object.find("bump_shadows")) set_flag(LUMICUT_BUMP_SHADOWS, bumps->boolean());
    const auto texture = [&](const char* key, int32_t& out, TextureUse use, bool by_view = false) {
      const auto value = object.find(key);
      if (!value) return;
      const auto user = fmt::format("material \"{}\" ({}: {})", name, path_, value->path());
      if (value->raw().is_null()) {
        out = 0;
      } else if (value->raw().is_object()) {
        JsonObject keys(*value);
        if (const auto program = keys.find("program")) {
          out = program_number(*program);
          keys.finish();
          return;
        }
        const auto file = keys.need("file");
        uint32_t flags = 0;
        const auto flag = [&](const char* word, uint32_t bit) {
          if (auto given = keys.find(word); given && given->boolean()) flags |= bit;
        };
        flag("clamp", LUMICUT_CLAMP);
        flag("nearest", LUMICUT_NEAREST);
        flag("blend_stored", LUMICUT_BLEND_STORED);
        flag("by_view", LUMICUT_BY_VIEW);
        if (auto given = keys.find("by_view"); given && given->boolean() && !by_view)
          given->fail(
              "is for diffuse, specular, translucency, roughness, diffuse_roughness and metallic textures alone");
        keys.finish();
        out = textures_.get(resolve(file), use, flags, user);
      } else {
        out = textures_.get(resolve(*value), use, 0, user);
      }
    };
    texture("diffuse_texture", m.diffuse_texture, TextureUse::colour, true);
    texture("specular_texture", m.specular_texture, TextureUse::colour, true);
    texture("opacity_texture", m.opacity_texture, TextureUse::mask);
    texture("emission_texture", m.emission_texture, TextureUse::colour);
    texture("translucency_texture", m.translucency_texture, TextureUse::colour, true);
    texture("normal_texture", m.normal_texture, TextureUse::vectors);
    if (auto strength = object.find("normal_strength"))
      m.normal_strength = static_cast<float>(strength->number(1e-3, 10));
    texture("height_texture", m.height_texture, TextureUse::numbers);
    if (auto distance = object.find("bump_distance")) {
      m.bump_distance = static_cast<float>(distance->number(-1e6, 1e6) * scale_);
      if (m.bump_distance == 0.0f) distance->fail("is 0: leave \"height_texture\" out instead");
    } else if (m.height_texture != 0 && m.bump_distance == 0.0f) {
      m.bump_distance = static_cast<float>(scale_);
    }
    if (auto strength = object.find("bump_strength")) m.bump_strength = static_cast<float>(strength->number(1e-3, 10));
    for (const char* key : {"roughness_texture", "metallic_texture", "diffuse_roughness_texture"})
      if (auto given = object.find(key); given && !ggx && !given->raw().is_null())
        given->fail("is of the model \"ggx\" alone");
    texture("roughness_texture", m.roughness_texture, TextureUse::numbers, true);
    texture("metallic_texture", m.metallic_texture, TextureUse::numbers, true);
    texture("diffuse_roughness_texture", m.diffuse_roughness_texture, TextureUse::numbers, true);
  }

  // ---- Programs ----

  uint32_t attribute_number(const std::string& name) {
    return attributes_.emplace(name, static_cast<uint32_t>(attributes_.size())).first->second;
  }

  void read_programs(const JsonValue& value) {
    for (const auto& element : value.elements()) {
      JsonObject object(element);
      const std::string name = object.need("name").text();
      if (programs_.count(name)) object.need("name").fail(fmt::format("a program \"{}\" stands here already", name));
      Texture texture;
      texture.file = fmt::format("program \"{}\"", name);
      texture.program = read_program(
          object.need("steps"), [&](const std::string& attribute) { return attribute_number(attribute); },
          [&](const JsonValue& image) { return program_image(image, name); });
      object.finish();
      scene_.textures.push_back(std::move(texture));
      programs_[name] = static_cast<int32_t>(scene_.textures.size());
    }
  }

  // An image that a program looks up: { "file", "use", "clamp", "nearest", "blend_stored" }.
  int32_t program_image(const JsonValue& value, const std::string& program) {
    JsonObject keys(value);
    const auto file = keys.need("file");
    const TextureUse use = keys.has("use") && keys.need("use").choice({"color", "numbers"}) == 1 ? TextureUse::numbers
                                                                                                 : TextureUse::colour;
    uint32_t flags = 0;
    if (keys.boolean("clamp", false)) flags |= LUMICUT_CLAMP;
    if (keys.boolean("nearest", false)) flags |= LUMICUT_NEAREST;
    if (keys.boolean("blend_stored", false)) flags |= LUMICUT_BLEND_STORED;
    keys.finish();
    return textures_.get(resolve(file), use, flags, fmt::format("program \"{}\" ({})", program, path_));
  }

  int32_t program_number(const JsonValue& value) const {
    const auto found = programs_.find(value.text());
    if (found != programs_.end()) return found->second;
    std::vector<std::string> names;
    for (const auto& [known, index] : programs_) names.push_back(known);
    const std::string near = nearest_word(value.text(), names);
    value.fail(fmt::format("no program \"{}\" in \"programs\"{}", value.text(),
                           near.empty() ? "" : "; did you mean \"" + near + "\"?"));
  }

  void read_materials(const JsonValue& value) {
    for (const auto& element : value.elements()) {
      JsonObject object(element);
      const std::string name = object.need("name").text();
      if (by_name_.count(name)) object.need("name").fail(fmt::format("a material \"{}\" stands here already", name));
      lumicut_material m = default_material();
      change_material(object, m, name);
      object.finish();
      by_name_[name] = add_material(name, m);
    }
  }

  uint32_t add_material(const std::string& name, const lumicut_material& values) {
    scene_.materials.push_back({name, values});
    return static_cast<uint32_t>(scene_.materials.size() - 1);
  }

  uint32_t material(const JsonValue& value) const {
    const std::string name = value.text();
    const auto found = by_name_.find(name);
    if (found != by_name_.end()) return found->second;
    std::vector<std::string> names;
    for (const auto& [known, index] : by_name_) names.push_back(known);
    const std::string near = nearest_word(name, names);
    value.fail(fmt::format("no material \"{}\" in \"materials\"{}", name,
                           near.empty() ? "" : "; did you mean \"" + near + "\"?"));
  }

  // ---- Meshes ----

  void read_mesh(const JsonValue& value) {
    JsonObject object(value);
    const std::string name = object.text("name", "");
    const Matrix base = object.has("transform") ? transform(object.need("transform")) : kIdentity;
    std::vector<Matrix> placed;
    if (auto instances = object.find("instances")) {
      for (const auto& instance : instances->elements()) placed.push_back(multiply(transform(instance), base));
      if (placed.empty()) instances->fail("is empty: leave it out for one instance");
    } else {
      placed.push_back(base);
    }
    // As the library has them, an only one too.
    const auto transforms = object.find("transforms");
    std::vector<float> kept;
    if (transforms) {
      if (object.has("transform") || object.has("instances"))
        transforms->fail("stands beside \"transform\" or \"instances\"");
      kept = read_transforms(*transforms);
    }
    const uint32_t light_group = group(object), mask = ray_mask(object);
    const uint32_t not_lit_by = sets(object, "not_lit_by", kReceiverSets),
                   not_blocking = sets(object, "not_blocking", kBlockerSets),
                   receivers = set_of(object, "receivers", kReceiverSets),
                   blockers = set_of(object, "blockers", kBlockerSets);
    const bool catcher = object.boolean("shadow_catcher", false);
    const auto attributes = object.find("attributes");
    const size_t first = scene_.meshes.size();
    if (object.has("obj")) {
      read_obj_mesh(object);
    } else if (object.has("positions")) {
      read_inline_mesh(object);
    } else {
      value.fail("needs either \"obj\" (a file) or \"positions\" (with \"triangles\" or \"quads\")");
    }
    object.finish();
    if (attributes) {
      if (scene_.meshes.size() != first + 1) attributes->fail("needs a file of one object");
      scene_.meshes[first].attributes = read_attributes(
          *attributes, scene_.meshes[first], transforms ? kept.size() / 12 : placed.size(),
          [&](const std::string& attribute) { return attribute_number(attribute); },
          [&](const JsonValue& file) { return resolve(file); });
    }
    for (size_t i = first; i < scene_.meshes.size(); ++i) {
      Mesh& mesh = scene_.meshes[i];
      mesh.name = name.empty() ? value.path() : name;
      mesh.group = light_group;
      mesh.mask = mask;
      mesh.not_lit_by = not_lit_by, mesh.not_blocking = not_blocking;
      mesh.receivers = receivers, mesh.blockers = blockers;
      mesh.shadow_catcher = catcher;
      mesh.transforms = kept;
      place(value, mesh, placed);
    }
  }

  std::vector<float> read_transforms(const JsonValue& value) {
    std::vector<float> out = block<float>(value, 12);
    if (out.empty()) value.fail("is empty");
    check_coordinates(value, out);
    for (size_t t = 0; t < out.size(); t += 12) {
      const float* m = &out[t];
      const Vec x{m[0], m[4], m[8]}, y{m[1], m[5], m[9]}, z{m[2], m[6], m[10]};
      if (!(std::abs(dot(cross(x, y), z)) > 0)) value.fail(fmt::format("transform {} flattens space", t / 12));
      for (const size_t k : {3u, 7u, 11u}) out[t + k] = checked(value, double{m[k]} * scale_);
    }
    return out;
  }

  // Light linking: the number of a set, or a bit for each of several.
  static uint32_t set_of(JsonObject& object, const char* key, uint32_t most) {
    const auto set = object.find(key);
    return set ? static_cast<uint32_t>(set->integer(1, most)) : 0;
  }
  static uint32_t sets(JsonObject& object, const char* key, uint32_t most) {
    uint32_t bits = 0;
    if (const auto list = object.find(key))
      for (const auto& set : list->elements()) bits |= uint32_t{1} << (set.integer(1, most) - 1);
    return bits;
  }

  // Of a mesh that some kinds of rays do not see. 0: all do.
  static uint32_t ray_mask(JsonObject& object) {
    const auto hidden = object.find("hidden_from");
    if (!hidden) return 0;
    uint32_t mask = ~uint32_t{0};
    for (const auto& kind : hidden->elements()) {
      const std::string name = kind.text();
      const auto* known = std::ranges::find(kRayKinds, name);
      if (known == std::end(kRayKinds))
        kind.fail(fmt::format(
            "is \"{}\", but must be \"camera\", \"diffuse\", \"glossy\", \"transmission\" or \"shadow\"", name));
      mask &= ~(uint32_t{1} << (known - std::begin(kRayKinds)));
    }
    return mask;
  }

  // One instance is baked into the vertices; more become the mesh's transforms. `unit_scale` goes into the vertices.
  void place(const JsonValue& value, Mesh& mesh, std::vector<Matrix> placed) {
    if (!mesh.transforms.empty()) {
      // Placed by them.
    } else if (placed.size() == 1) {
      if (placed[0] != kIdentity) bake(value, mesh, placed[0]);
    } else {
      for (auto& m : placed) {
        for (const size_t k : {3u, 7u, 11u}) m[k] *= scale_;
        for (const double number : m) mesh.transforms.push_back(checked(value, number));
      }
    }
    if (scale_ != 1.0)
      for (float& x : mesh.positions) x = checked(value, double{x} * scale_);
  }

  static float checked(const JsonValue& value, double number) {
    const auto result = static_cast<float>(number);
    if (!(std::abs(result) <= static_cast<float>(kLargestCoordinate)))
      value.fail(fmt::format("a coordinate becomes {:g} by transform and \"unit_scale\", beyond {:g}", number,
                             kLargestCoordinate));
    return result;
  }

  static void bake(const JsonValue& value, Mesh& mesh, const Matrix& m) {
    const auto apply = [&](const std::array<double, 9>& r, const Vec& t, float* p) {
      const Vec v{p[0], p[1], p[2]};
      for (size_t k = 0; k < 3; ++k)
        p[k] = checked(value, r[k * 3] * v[0] + r[k * 3 + 1] * v[1] + r[k * 3 + 2] * v[2] + t[k]);
    };
    for (size_t i = 0; i + 2 < mesh.positions.size(); i += 3)
      apply({m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, {m[3], m[7], m[11]}, &mesh.positions[i]);
    // Normals map by the inverse transpose, which is the cofactor matrix up to the determinant; a mirror flips the
    // winding.
    const Vec c0{m[0], m[4], m[8]}, c1{m[1], m[5], m[9]}, c2{m[2], m[6], m[10]};
    const double determinant = dot(cross(c0, c1), c2);
    const double sign = determinant < 0 ? -1 : 1;
    const Vec n0 = cross(c1, c2) * sign, n1 = cross(c2, c0) * sign, n2 = cross(c0, c1) * sign;
    for (size_t i = 0; i + 2 < mesh.normals.size(); i += 3) {
      float* n = &mesh.normals[i];
      const Vec turned = n0 * double{n[0]} + n1 * double{n[1]} + n2 * double{n[2]};
      const double l = length(turned);
      if (l > 0) store(n, turned * (1.0 / l));
    }
    if (determinant < 0)
      for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) std::swap(mesh.indices[i + 1], mesh.indices[i + 2]);
  }

  void read_obj_mesh(JsonObject& object) {
    const std::string file = resolve(object.need("obj"));
    const auto one = object.find("material");
    const auto changes = object.find("materials");
    if (one && changes) object.value().fail("give either \"material\" (for all) or \"materials\" (by name)");
    ObjModel model = read_obj(file, {.read_materials = !one}, textures_, scene_.warnings);
    std::vector<uint32_t> numbers;
    if (one) {
      numbers.push_back(material(*one));
    } else {
      numbers = obj_materials(model, changes, file);
    }
    for (auto& mesh : model.meshes) {
      for (auto& m : mesh.materials) m = numbers[m];
      scene_.meshes.push_back(std::move(mesh));
    }
  }

  std::vector<uint32_t> obj_materials(const ObjModel& model, const std::optional<JsonValue>& changes,
                                      const std::string& file) {
    std::optional<JsonObject> object;
    if (changes) object.emplace(*changes);
    std::vector<uint32_t> numbers;
    std::vector<std::string> names;
    for (const auto& m : model.materials) names.push_back(m.name);
    const std::set<std::string> known(names.begin(), names.end());
    if (object)
      for (const auto& item : changes->raw().items())
        if (known.count(item.key()) == 0) {
          const std::string near = nearest_word(item.key(), names);
          changes->fail(fmt::format("{} has no material \"{}\"{}", file, item.key(),
                                    near.empty() ? "" : "; did you mean \"" + near + "\"?"));
        }
    for (const auto& m : model.materials) {
      const auto change = object && !m.name.empty() ? object->find(m.name) : std::nullopt;
      if (change && change->raw().is_string()) {
        numbers.push_back(material(*change));
        continue;
      }
      lumicut_material values = m.values;
      if (change) {
        JsonObject keys(*change);
        change_material(keys, values, m.name);
        keys.finish();
      }
      numbers.push_back(add_material(m.name, values));
    }
    return numbers;
  }

  // A list in the scene file, or a part of a file.
  template <typename T>
  std::vector<T> block(const JsonValue& value, size_t width) {
    return read_block<T>(value, width, [&](const JsonValue& file) { return resolve(file); });
  }
  static void check_coordinates(const JsonValue& value, const std::vector<float>& numbers) {
    for (size_t i = 0; i < numbers.size(); ++i)
      if (!(std::abs(numbers[i]) <= static_cast<float>(kLargestCoordinate)))
        value.fail(fmt::format("its number {} is {}, not finite or beyond {:g}", i, numbers[i], kLargestCoordinate));
  }

  void read_inline_mesh(JsonObject& object) {
    Mesh mesh;
    const auto append = [&](const JsonValue& list, std::vector<float>& out, size_t count) {
      if (list.raw().is_object()) {
        out = block<float>(list, count);
        check_coordinates(list, out);
        return true;
      }
      for (const auto& element : list.elements())
        for (const double x : element.numbers(count, -kLargestCoordinate, kLargestCoordinate))
          out.push_back(static_cast<float>(x));
      return false;
    };
    append(object.need("positions"), mesh.positions, 3);
    const auto vertices = static_cast<int64_t>(mesh.positions.size() / 3);
    if (vertices == 0) object.need("positions").fail("is empty");
    const auto per_vertex = [&](const char* key, std::vector<float>& out, size_t count) {
      const auto list = object.find(key);
      if (!list) return false;
      const bool as_it_is = append(*list, out, count);
      if (static_cast<int64_t>(out.size() / count) != vertices)
        list->fail(fmt::format("has {} entries for {} positions", out.size() / count, vertices));
      return as_it_is;
    };
    const bool as_they_are = per_vertex("normals", mesh.normals, 3);
    per_vertex("uvs", mesh.uvs, 2);
    for (size_t i = 0; i + 2 < mesh.normals.size() && !as_they_are; i += 3) {
      const Vec n{mesh.normals[i], mesh.normals[i + 1], mesh.normals[i + 2]};
      if (!(length(n) > 0)) object.need("normals").fail(fmt::format("[{}] is zero", i / 3));
      store(&mesh.normals[i], n * (1.0 / length(n)));
    }
    const auto faces = [&](const char* key, size_t corners) {
      const auto list = object.find(key);
      if (!list) return;
      if (corners == 3 && list->raw().is_object()) {
        mesh.indices = block<uint32_t>(*list, 3);
        for (const uint32_t i : mesh.indices)
          if (i >= vertices) list->fail(fmt::format("names vertex {} of {}", i, vertices));
        return;
      }
      for (const auto& face : list->elements()) {
        const auto elements = face.elements();
        if (elements.size() != corners) face.fail_expected(fmt::format("an array of {} vertex numbers", corners));
        std::array<uint32_t, 4> v{};
        for (size_t k = 0; k < corners; ++k) v[k] = static_cast<uint32_t>(elements[k].integer(0, vertices - 1));
        mesh.indices.insert(mesh.indices.end(), {v[0], v[1], v[2]});
        if (corners == 4) mesh.indices.insert(mesh.indices.end(), {v[0], v[2], v[3]});
      }
    };
    faces("triangles", 3);
    faces("quads", 4);
    if (mesh.indices.empty()) object.value().fail("has no \"triangles\" and no \"quads\"");
    read_mesh_materials(object, mesh);
    scene_.meshes.push_back(std::move(mesh));
  }

  // One for all triangles, or a list, and each triangle's number in it.
  void read_mesh_materials(JsonObject& object, Mesh& mesh) {
    const size_t triangles = mesh.indices.size() / 3;
    const auto given = object.need("material");
    if (!given.raw().is_array()) {
      mesh.materials.assign(triangles, material(given));
      return;
    }
    std::vector<uint32_t> list;
    for (const auto& name : given.elements()) list.push_back(material(name));
    const auto of_triangles = object.need("triangle_materials");
    if (of_triangles.raw().is_object()) {
      mesh.materials = block<uint32_t>(of_triangles, 1);
    } else {
      for (const auto& number : of_triangles.elements())
        mesh.materials.push_back(static_cast<uint32_t>(number.integer(0, int64_t{1} << 31)));
    }
    if (mesh.materials.size() != triangles)
      of_triangles.fail(fmt::format("has {} entries for {} triangles", mesh.materials.size(), triangles));
    for (uint32_t& m : mesh.materials) {
      if (m >= list.size()) of_triangles.fail(fmt::format("names material {} of {}", m, list.size()));
      m = list[m];
    }
  }

  // ---- Lights ----

  void read_light(const JsonValue& value) {
    JsonObject object(value);
    lumicut_light light{};
    light.struct_size = sizeof(light);
    light.type = static_cast<uint32_t>(object.need("type").choice({"point", "spot", "rectangle", "disk", "sun"}));
    light.unit = static_cast<uint32_t>(object.has("unit") ? object.need("unit").choice({"radiometric", "watt"}) : 0);
    light.group = group(object);
    store(light.color, object.vector3("color", {1, 1, 1}, 0, 1e15));
    light.value = static_cast<float>(object.need("value").number(0, 1e20));
    if (!object.boolean("shadows", true)) light.flags |= LUMICUT_NO_SHADOWS;
    read_reach(object, light);
    if (const auto catcher = object.find("shadow_catcher"); catcher && catcher->boolean()) {
      if (object.boolean("visible", false)) catcher->fail("is not for a visible light, which is a mesh");
      scene_.lights_of_catchers.insert(scene_.lights.size());
    }
    if (light.type == LUMICUT_SUN) {
      store(light.direction, direction(object.need("direction")));
      light.radius = static_cast<float>(radians(object.number("angular_radius", 0, 0, 90)));
    } else if (light.type == LUMICUT_POINT || light.type == LUMICUT_SPOT) {
      store(light.position, point(object.need("position")));
      light.radius = static_cast<float>(object.number("radius", 0, 0, largest()) * scale_);
      if (const auto facing = object.find("facing_disk"); facing && facing->boolean()) {
        if (!(light.radius > 0.0f)) facing->fail("needs a \"radius\" above 0");
        light.flags |= LUMICUT_FACING_DISK;
      }
      if (light.type == LUMICUT_SPOT) {
        store(light.direction, direction(object.need("direction")));
        light.angle = static_cast<float>(radians(object.need("angle").number(0.12, 180)));
        light.blend = static_cast<float>(object.number("blend", 0, 0, 1));
        light.spot_cosine = object.boolean("cosine", false);
      }
      if (auto file = object.find("ies")) read_profile(object, *file, light);
      if (auto given = object.find("profile")) read_plain_profile(object, *given, light);
    } else {
      read_area_light(object, light);
      return;
    }
    object.finish();
    add_light(value, light);
  }

  static void read_reach(JsonObject& object, lumicut_light& light) {
    if (auto hidden = object.find("hidden_from")) {
      if (object.boolean("visible", false)) hidden->fail("is not for a visible light, which is a mesh");
      light.mask = ray_mask(object) & (LUMICUT_CAMERA_RAYS | LUMICUT_DIFFUSE_RAYS | LUMICUT_GLOSSY_RAYS |
                                       LUMICUT_TRANSMISSION_RAYS | LUMICUT_SHADOW_RAYS);
      if (light.mask == 0) hidden->fail("names every kind of ray: leave the light out");
    }
    light.receivers = set_of(object, "receivers", kReceiverSets);
    light.blockers = set_of(object, "blockers", kBlockerSets);
  }

  // A point light with the file's intensities; a spot cuts its cone out of them.
  void read_profile(JsonObject& object, const JsonValue& file, lumicut_light& light) {
    if (light.radius > 0) object.need("radius").fail("a light with \"ies\" is a point: leave \"radius\" out");
    const Vec axis = direction(object.need("direction"));
    store(light.direction, axis);
    // Horizontal angle 0 lies towards x; `rotation` turns it the way horizontal angles go.
    Vec zero = Vec{1, 0, 0} - axis * axis[0];
    if (!(length(zero) > 1e-3)) zero = (z_up_ ? Vec{0, 1, 0} : Vec{0, 0, -1}) - axis * (z_up_ ? axis[1] : -axis[2]);
    zero = zero * (1.0 / length(zero));
    const double turn = radians(object.number("rotation", 0, -36000, 36000));
    store(light.tangent, zero * std::cos(turn) + cross(zero, axis) * std::sin(turn));

    const std::string path = resolve(file);
    IesProfile ies = read_ies(path, scene_.warnings);
    Profile profile;
    profile.file = path;
    if (light.type == LUMICUT_SPOT) cut_cone(ies, light);
    for (const double angle : ies.vertical) profile.vertical.push_back(static_cast<float>(radians(angle)));
    for (const double angle : ies.horizontal) profile.horizontal.push_back(static_cast<float>(radians(angle)));
    for (const double candela : ies.candela) profile.values.push_back(static_cast<float>(candela / 683.0));
    if (!(*std::max_element(profile.values.begin(), profile.values.end()) > 0))
      file.fail(fmt::format("{} gives no light within the spot's cone", path));
    const auto same = std::find_if(scene_.profiles.begin(), scene_.profiles.end(), [&](const Profile& p) {
      return p.vertical == profile.vertical && p.horizontal == profile.horizontal && p.values == profile.values;
    });
    light.profile = static_cast<uint32_t>(same - scene_.profiles.begin()) + 1;
    if (same == scene_.profiles.end()) scene_.profiles.push_back(std::move(profile));
    light.type = LUMICUT_POINT;
    light.angle = light.blend = 0, light.spot_cosine = 0;
  }

  // The table itself, in W/sr; angles in degrees.
  void read_plain_profile(JsonObject& object, const JsonValue& value, lumicut_light& light) {
    if (light.type != LUMICUT_POINT || light.radius > 0 || object.has("ies"))
      value.fail("is of a point light without \"radius\" and \"ies\"");
    store(light.direction, direction(object.need("direction")));
    JsonObject keys(value);
    Profile profile;
    profile.file = value.path();
    const auto list = [&](const char* key, std::vector<float>& out, double most, double unit) {
      for (const auto& number : keys.need(key).elements())
        out.push_back(static_cast<float>(number.number(0, most) * unit));
    };
    list("vertical", profile.vertical, 180.001, kPi / 180), list("horizontal", profile.horizontal, 360.001, kPi / 180);
    list("values", profile.values, 1e20, 1);
    const auto tangent = keys.need("tangent").numbers(3, -kLargestCoordinate, kLargestCoordinate);
    for (size_t k = 0; k < 3; ++k) light.tangent[k] = static_cast<float>(tangent[k]);
    keys.finish();
    if (profile.values.empty() || profile.values.size() != profile.vertical.size() * profile.horizontal.size())
      value.fail(fmt::format("has {} values for {} by {} angles", profile.values.size(), profile.vertical.size(),
                             profile.horizontal.size()));
    scene_.profiles.push_back(std::move(profile));
    light.profile = static_cast<uint32_t>(scene_.profiles.size());
  }

  // The table times the spot's falloff, at its own angles and, where the edge is, at finer ones.
  static void cut_cone(IesProfile& ies, const lumicut_light& spot) {
    const double half = 0.5 * double{spot.angle}, outer = std::cos(half), width = (1 - outer) * double{spot.blend};
    std::vector<double> angles = ies.vertical;
    const double degree = 180 / kPi, soft = std::acos(std::min(1.0, outer + width)) * degree;
    for (int i = 0; i <= 64; ++i) angles.push_back(soft + (half * degree - soft) * i / 64);
    for (double a = 1; a < half * degree; a += 1) angles.push_back(a);
    angles.push_back(std::max(0.0, half * degree - 1e-3));
    std::sort(angles.begin(), angles.end());
    std::vector<double> kept;
    for (const double a : angles)
      if (a >= ies.vertical.front() && a <= std::min(half * degree, ies.vertical.back()) &&
          (kept.empty() || a > kept.back() + 5e-4))
        kept.push_back(a);
    if (kept.size() < 2) kept = {ies.vertical.front(), ies.vertical.front() + 1e-2};
    std::vector<double> values;
    for (size_t h = 0; h < ies.horizontal.size(); ++h)
      for (const double a : kept) {
        const double* row = &ies.candela[h * ies.vertical.size()];
        const auto above = std::upper_bound(ies.vertical.begin(), ies.vertical.end() - 1, a) - ies.vertical.begin();
        const auto i = static_cast<size_t>(std::max<std::ptrdiff_t>(1, above));
        const double t = (a - ies.vertical[i - 1]) / (ies.vertical[i] - ies.vertical[i - 1]);
        const double c = std::cos(a / degree);
        double x = width > 0 ? std::clamp((c - outer) / width, 0.0, 1.0) : (a < half * degree - 5e-4 ? 1.0 : 0.0);
        x = x * x * (3 - 2 * x) * (spot.spot_cosine != 0 ? std::max(0.0, c) : 1.0);
        values.push_back((row[i - 1] * (1 - t) + row[i] * t) * x);
      }
    ies.vertical = std::move(kept), ies.candela = std::move(values);
  }

  void add_light(const JsonValue& value, const lumicut_light& light) {
    scene_.lights.push_back(light);
    scene_.light_names.push_back(value.path());
  }

  void read_area_light(JsonObject& object, lumicut_light& light) {
    const Vec u = edge(object.need("u")), v = edge(object.need("v"));
    const double area = length(cross(u, v));
    if (!(area > 1e-9 * length(u) * length(v))) object.need("v").fail("is parallel to \"u\"");
    Vec centre{};
    if (auto corner = light.type == LUMICUT_RECTANGLE ? object.find("corner") : std::nullopt) {
      if (object.has("position")) corner->fail("give either \"position\" (the centre) or \"corner\"");
      centre = point(*corner) + (u + v) * 0.5;
    } else {
      centre = point(object.need("position"));
    }
    store(light.position, centre), store(light.u, u), store(light.v, v);
    const auto spread = object.find("spread");
    light.spread = spread ? static_cast<float>(radians(spread->number(0.12, 180))) : 0.0f;
    const bool visible = object.boolean("visible", false);
    if (visible && spread && light.spread < static_cast<float>(kPi) - 1e-6f)
      spread->fail("a visible light is Lambertian: leave \"spread\" out");
    if (auto image = object.find("texture")) {
      if (visible) image->fail("is not for a visible light, which is a mesh");
      light.texture = textures_.get(resolve(*image), TextureUse::radiance, LUMICUT_CLAMP,
                                    fmt::format("{} ({})", image->path(), path_));
    }
    object.finish();
    if (visible) {
      add_visible_light(object, light, centre, u, v);
    } else {
      add_light(object.value(), light);
    }
  }

  // A mesh that emits from its front, blocks light and reflects nothing.
  void add_visible_light(JsonObject& object, const lumicut_light& light, const Vec& centre, const Vec& u,
                         const Vec& v) {
    Mesh mesh;
    mesh.name = object.value().path();
    mesh.group = light.group;
    const auto add = [&](const Vec& p) {
      for (const double x : p) mesh.positions.push_back(checked(object.value(), x));
    };
    double area = length(cross(u, v));
    if (light.type == LUMICUT_RECTANGLE) {
      const Vec corner = centre - (u + v) * 0.5;
      add(corner), add(corner + u), add(corner + u + v), add(corner + v);
      mesh.indices = {0, 1, 2, 0, 2, 3};
    } else {  // a polygon of the ellipse's area
      constexpr uint32_t kCorners = 64;
      const double step = 2 * kPi / kCorners;
      area *= kPi / 4;
      const double grow = std::sqrt(step / std::sin(step));
      for (uint32_t i = 0; i < kCorners; ++i)
        add(centre + (u * std::cos(i * step) + v * std::sin(i * step)) * (0.5 * grow));
      for (uint32_t i = 1; i + 1 < kCorners; ++i) mesh.indices.insert(mesh.indices.end(), {0, i, i + 1});
    }
    lumicut_material m = default_material();
    const double radiance = double{light.value} * (light.unit == LUMICUT_WATT ? 1.0 / (kPi * area) : 1.0);
    for (int c = 0; c < 3; ++c) {
      m.diffuse[c] = 0;
      m.emission[c] = static_cast<float>(double{light.color[c]} * radiance);
    }
    mesh.materials.assign(mesh.indices.size() / 3, add_material("light " + mesh.name, m));
    visible_lights_.push_back(std::move(mesh));
  }

  void read_environment(const JsonValue& value) {
    JsonObject object(value);
    lumicut_environment environment{};
    environment.struct_size = sizeof(environment);
    environment.group = group(object);
    const double strength = object.number("strength", 1, 0, 1e15);
    store(environment.color, object.vector3("color", {1, 1, 1}, 0, 1e15) * strength);
    if (auto sky = object.find("sky"); sky && object.has("image")) sky->fail("give either \"image\" or \"sky\"");
    if (auto image = object.find("image"))
      environment.texture =
          textures_.get(resolve(*image), TextureUse::radiance, 0, fmt::format("the environment ({})", path_));
    if (auto sky = object.find("sky")) read_sky(*sky, value, environment, strength);
    // World to map: its up axis becomes z; with y up, x stays x, and -z becomes y.
    const double angle = radians(object.number("rotation", 0, -36000, 36000));
    const double c = std::cos(angle), s = std::sin(angle);
    const std::array<double, 9> turn = {c, s, 0, -s, c,
                                        0, 0, 0, 1};  // the map turns by `angle`, so the world by minus it
    const std::array<double, 9> stand =
        z_up_ ? std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1} : std::array<double, 9>{1, 0, 0, 0, 0, -1, 0, 1, 0};
    for (size_t i = 0; i < 3; ++i)
      for (size_t j = 0; j < 3; ++j) {
        double sum = 0;
        for (size_t k = 0; k < 3; ++k) sum += turn[i * 3 + k] * stand[k * 3 + j];
        environment.world_to_map[i * 3 + j] = static_cast<float>(sum);
      }
    if (auto given = object.find("world_to_map")) {
      if (object.has("rotation")) value.fail("give either \"rotation\" or \"world_to_map\"");
      const auto numbers = given->numbers(9, -1.001, 1.001);
      std::transform(numbers.begin(), numbers.end(), environment.world_to_map,
                     [](double x) { return static_cast<float>(x); });
    }
    if (auto hidden = object.find("hidden"); hidden && hidden->boolean()) environment.flags |= LUMICUT_HIDDEN;
    if (object.has("hidden_from")) {
      const uint32_t mask = ray_mask(object),
                     all = LUMICUT_DIFFUSE_RAYS | LUMICUT_GLOSSY_RAYS | LUMICUT_TRANSMISSION_RAYS;
      if ((mask & LUMICUT_CAMERA_RAYS) == 0) environment.flags |= LUMICUT_HIDDEN;
      if ((mask & all) != all) environment.mask = (mask & all) | LUMICUT_CAMERA_RAYS;
    }
    object.finish();
    scene_.environment = environment;
  }

  // A map of the sky and a light for the sun.
  void read_sky(const JsonValue& value, const JsonValue& owner, lumicut_environment& environment, double strength) {
    for (const char* key : {"rotation", "world_to_map"})
      if (owner.raw().contains(key)) value.fail(fmt::format("a sky turns by \"sun_rotation\": leave \"{}\" out", key));
    JsonObject object(value);
    Sky sky;
    const auto elevation = object.need("sun_elevation");
    sky.sun_elevation = elevation.number(-90, 90);
    if (!(sky.sun_elevation > 0)) elevation.fail_expected("above 0: the model has no sun below the horizon");
    sky.sun_azimuth = object.number("sun_rotation", 0, -36000, 36000);
    sky.turbidity = object.number("turbidity", 3, 1.9, 10);
    const double radius = object.number("sun_angular_radius", 0.2666, 0, 45);
    const bool sun = object.boolean("sun", true);
    const Vec ground = object.vector3("ground", {0, 0, 0}, 0, 1);
    const auto height = static_cast<uint32_t>(object.integer("resolution", 256, 16, 4096));
    object.finish();
    Texture texture;
    texture.file = "sky";
    texture.width = 2 * height, texture.height = height, texture.channels = 3;
    texture.floats = sky.map(height, ground, sun);
    scene_.textures.push_back(std::move(texture));
    environment.texture = static_cast<int32_t>(scene_.textures.size());
    if (!sun) return;
    lumicut_light light{};
    light.struct_size = sizeof(light);
    light.type = LUMICUT_SUN;
    light.group = environment.group;
    light.value = static_cast<float>(strength);
    const Vec irradiance = sky.sun_irradiance(), towards = sky.sun_direction();
    for (size_t k = 0; k < 3; ++k)
      light.color[k] =
          static_cast<float>(irradiance[k] * (strength > 0 ? double{environment.color[k]} / strength : 0.0));
    store(light.direction, (z_up_ ? towards : Vec{towards[0], towards[2], -towards[1]}) * -1.0);
    light.radius = static_cast<float>(radians(radius));
    add_light(value, light);
  }

  // A scene without light renders black, which is legal and seldom meant.
  void check_lit() {
    bool lit = !scene_.lights.empty() || scene_.environment.has_value();
    for (const auto& m : scene_.materials)
      lit = lit || m.values.emission[0] + m.values.emission[1] + m.values.emission[2] > 0;
    if (!lit) scene_.warnings.add("scenes without light", path_, "has no light at all; the image will be black");
  }

  std::string path_;
  PathVariables variables_;
  SceneData scene_;
  TextureStore textures_;
  std::map<std::string, int32_t> programs_;     // 1 + index into the textures
  std::map<std::string, uint32_t> attributes_;  // numbers of names
  std::map<std::string, uint32_t> by_name_;
  std::vector<Mesh> visible_lights_;  // after all other meshes
  bool z_up_ = false;
  double scale_ = 1;
};

}  // namespace

SceneData read_scene(const std::string& path) { return SceneReader(path).read(); }

}  // namespace lumicut::io
