// What every command that renders asks for, and how the library is given it.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/library.h"
#include "io/scene_data.h"
#include "io/warnings.h"

namespace CLI {
class App;
class Validator;
}  // namespace CLI

namespace lumicut::tools {

class InterruptWatcher;

inline constexpr const char* kUsualIntegrator = "lightcuts";

inline constexpr const char* kSceneHelp =
    "Scene: JSON, glTF, OBJ, FBX, COLLADA, PLY, pbrt or Mitsuba (docs/formats.md)";

struct RenderSetup {
  std::string integrator, accel = "bvh", builder, rays = "robust";
  std::vector<std::string> parameters;  // name=value
  std::optional<uint64_t> vpls, seed;
  int threads = 0;
  bool strict = false;
};

// -i, -p, --vpls, --seed, --threads, --accel, --builder, --rays, --strict.
void add_setup_options(CLI::App& command, RenderSetup& setup);

// Of a whole frame. What the command line leaves open, a preset fills.
struct FrameSetup : RenderSetup {
  std::string preset;
  uint32_t samples = 0;            // a pixel; 0: the scene's
  std::optional<uint32_t> passes;  // 0: until the other two stop them
  double seconds = 0, target_error = 0;
  std::optional<bool> denoise;
};
// Those above, --preset, --spp and --denoise.
void add_frame_options(CLI::App& command, FrameSetup& setup);
// Fills what is open by --preset; without it, by the usual one where neither an integrator nor its parameters were chosen
// and the frame is not `plain`, else by one pass of kUsualIntegrator. Throws UsageError where there is no such preset.
void apply_preset(const io::Api& api, FrameSetup& setup, bool plain);

// io::read_scene_file, which Ctrl-C ends at once.
io::SceneData read_scene_file(const std::string& path);

// Where shadow catchers are ordinary objects to this command: a warning.
void warn_of_catchers(io::SceneData& data, const std::string& command);

// Prints on standard error what was noticed while the scene of that file was read; throws FileError when `strict` and
// there is anything.
void tell_warnings(const io::Warnings& warnings, const std::string& file, bool strict);

void create_device(const io::Api& api, const RenderSetup& setup, io::Handle<lumicut_device>& device);
// Builds what rays need of the scene of that file; Ctrl-C ends it.
void commit_scene(const io::Api& api, InterruptWatcher& watcher, lumicut_scene scene, const std::string& file);

// Both throw UsageError in the library's words where it refuses what the command line says.
void create_scene(const io::Api& api, const RenderSetup& setup, lumicut_device device,
                  io::Handle<lumicut_scene>& scene);
void create_integrator(const io::Api& api, const RenderSetup& setup, lumicut_device device,
                       io::Handle<lumicut_integrator>& integrator);

// What the library tells of an integrator. Throws UsageError where there is none of that name.
lumicut_integrator_info integrator_info(const io::Api& api, const std::string& id);
// Whether it is known to lack a trait, such as LUMICUT_SAVED_STATE: libraries before ABI 1.4 do not tell.
inline bool lacks(const lumicut_integrator_info& info, uint32_t trait) {
  return info.traits != 0 && (info.traits & trait) == 0;
}

// Throws UsageError where light groups are asked for and the integrator cannot tell them apart.
void check_groups(const io::Api& api, const RenderSetup& setup, bool groups);

// For options of numbers: from `low` to `high`, and no NaN (which CLI::Range lets pass).
CLI::Validator number_in(double low, double high);
// For options of pictures of one of these kinds (".exr"): no name that ends as another kind does.
CLI::Validator picture_of(std::initializer_list<std::string_view> kinds);

// --size: "512x384" -> {512, 384}, each 1 to 65536. Throws UsageError.
std::vector<uint32_t> image_size(const std::string& text);
// "512x384" -> {512, 384}; "a,b,c,d" with ','. Throws UsageError.
std::vector<uint32_t> numbers(const std::string& text, char separator, size_t count, const char* option);

// Of a checkpoint: the mean's sums, every channel, and the radiance of so many light groups.
uint64_t checkpoint_pixel_bytes(const io::Api& api, size_t groups, bool denoise);
// Throws FileError where a checkpoint of so many pixels has no place: a folder that is not there, no permission, a full
// disk.
void check_room_for_checkpoint(const io::Api& api, const std::string& path, uint64_t pixels, size_t groups,
                               bool denoise);
// Whether it is a channel that LUMICUT_DENOISE alone fills.
bool of_denoising(const std::string& channel);

// `count` squares of 32 pixels (less at the edges), spread evenly over the frame whatever their number; all of it when
// there are no more. [Roberts 2018, R2 sequence]
std::vector<lumicut_tile> choose_squares(uint32_t width, uint32_t height, uint32_t count);

}  // namespace lumicut::tools
