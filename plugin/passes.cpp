#include "plugin/passes.h"

#include <cstring>

#include "core/rng.h"
#include "plugin/check.h"
#include "plugin/hash.h"

namespace lumicut {

namespace {

constexpr char kMagic[8] = {'L', 'U', 'M', 'I', 'C', 'U', 'T', 'P'};
constexpr uint32_t kVersion = 1, kByteOrder = 0x01020304u;

struct Header {
  char magic[8];
  uint32_t version, byte_order;
  uint64_t key, checksum;  // of the body
  uint64_t mean_bytes, film_bytes;
  uint32_t passes, reserved;
};
static_assert(sizeof(Header) == 56);

[[noreturn]] void fail_checkpoint(const std::string& what) { fail_argument("lumicut_render_desc.checkpoint: " + what); }

}  // namespace

Params params_of_pass(const Params& params, uint32_t pass, const Scene& scene) {
  Params of = params;
  if (pass == 0) return of;
  const auto seed = static_cast<uint64_t>(params.integer("seed"));
  of.set("seed", number_text(uint64_t{hash64(seed, pass) & 0xffffffffu}));
  const double shrink = std::pow(pass + 1.0, -0.25);
  if (const double scale = sphere_scale(params) * shrink; scale > 0.0)
    of.set("sphere_scale", number_text(std::max(scale, 0.001)));
  if (!params.boolean("compensate")) {
    const double clamp = clamp_distance(params, scene) * shrink;
    if (clamp > 0.0) of.set("clamp_distance", number_text(clamp));
  }
  return of;
}

bool enough_passes(const PassOptions& options, uint32_t done, double seconds, double last_seconds, double error) {
  if (options.passes > 0 && done >= options.passes) return true;
  if (options.max_seconds > 0.0 && seconds + 0.5 * last_seconds > options.max_seconds) return true;
  return options.target_error > 0.0 && done >= kMinPassesForError && error <= options.target_error;
}

std::vector<uint8_t> save_passes(uint64_t key, uint32_t done, const PassMean& mean, const Film& film) {
  std::vector<uint8_t> bytes(sizeof(Header));
  mean.save(bytes);
  Header h{};
  std::memcpy(h.magic, kMagic, sizeof(kMagic));
  h.version = kVersion, h.byte_order = kByteOrder, h.key = key, h.passes = done;
  h.mean_bytes = bytes.size() - sizeof(Header);
  film.save(bytes);
  h.film_bytes = bytes.size() - sizeof(Header) - h.mean_bytes;
  h.checksum = hash_bytes(done, bytes.data() + sizeof(Header), bytes.size() - sizeof(Header));
  std::memcpy(bytes.data(), &h, sizeof(h));
  return bytes;
}

uint32_t load_passes(const std::vector<uint8_t>& bytes, uint64_t key, PassMean& mean, Film& film) {
  Header h{};
  if (bytes.size() < sizeof(h)) fail_checkpoint("it is too short to be one");
  std::memcpy(&h, bytes.data(), sizeof(h));
  if (std::memcmp(h.magic, kMagic, sizeof(kMagic)) != 0) fail_checkpoint("it does not begin as one");
  if (h.version != kVersion || h.byte_order != kByteOrder)
    fail_checkpoint("it is of version " + number_text(uint64_t{h.version}) + " or of another kind of machine");
  const size_t body = bytes.size() - sizeof(h);
  if (h.mean_bytes > body || h.film_bytes != body - h.mean_bytes ||
      h.checksum != hash_bytes(h.passes, bytes.data() + sizeof(h), body))
    fail_checkpoint("it is cut short or damaged");
  if (h.key != key) fail_checkpoint("it was made for another scene, size, integrator or parameters");
  const std::span<const uint8_t> all(bytes);
  if (h.passes == 0 || !mean.load(all.subspan(sizeof(h), h.mean_bytes)) ||
      !film.load(all.subspan(sizeof(h) + h.mean_bytes)))
    fail_checkpoint("it does not fit the film");
  return h.passes;
}

uint64_t passes_key(const Scene& scene, const std::string& integrator, const std::string& params,
                    const FrameOptions& frame, double confidence) {
  std::string text = integrator + "\n" + params;
  for (const uint64_t v : {uint64_t{frame.width}, uint64_t{frame.height}, uint64_t{frame.samples},
                           uint64_t{frame.tile_size}, uint64_t{frame.crop.x0}, uint64_t{frame.crop.y0},
                           uint64_t{frame.crop.x1}, uint64_t{frame.crop.y1}, uint64_t{frame.illuminance}})
    text += number_text(v) + "\n";
  text += number_text(confidence);
  return hash_bytes(scene_hash(scene), text.data(), text.size());
}

}  // namespace lumicut
