#include "plugin/passes.h"

#include <cstring>

#include "core/rng.h"
#include "plugin/check.h"
#include "plugin/identity.h"

namespace lumicut {

namespace {

constexpr char kMagic[8] = {'L', 'U', 'M', 'I', 'C', 'U', 'T', 'P'};
constexpr char kInstructions[] = "instructions";
constexpr uint32_t kVersion = 2, kByteOrder = 0x01020304u;

struct Header {
  char magic[8];
  uint32_t version, byte_order;
  uint64_t checksum;  // of the header with 0 here, and of all that follows: the key, the mean and the film
  uint64_t key_bytes, mean_bytes, film_bytes;
  uint64_t passes;
};
static_assert(sizeof(Header) == 56);

uint64_t checksum(Header h, std::span<const uint8_t> body) {
  h.checksum = 0;
  return hash_bytes(hash_bytes(0, &h, sizeof(h)), body.data(), body.size());
}

// A pixel's.
uint64_t film_bytes(size_t groups) {
  uint64_t components = 3 * groups;
  for (const ChannelInfo& c : channel_table()) components += c.components;
  return components * sizeof(float);
}

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

uint64_t render_bytes(const Rect& crop, const PassOptions& options, size_t groups) {
  const uint64_t film = film_bytes(groups), state = film + PassMean::kBytes;
  uint64_t bytes = film;
  // The pass beside the mean; a list in which the image's error is looked up.
  if (options.progressive()) bytes += film + PassMean::kBytes + sizeof(double);
  // One is made, one is the last, one is what a host looks at. Or the one that the render goes on from.
  bytes += state * (options.checkpoints ? 3 : options.resume.empty() ? 0 : 1);
  return bytes * crop.width() * crop.height();
}

std::vector<uint8_t> save_passes(const std::string& key, uint32_t done, const PassMean& mean, const Film& film) {
  std::vector<uint8_t> bytes;
  const uint64_t pixels = uint64_t{film.crop().width()} * film.crop().height();
  bytes.reserve(sizeof(Header) + key.size() + pixels * (PassMean::kBytes + film_bytes(film.groups().size())));
  bytes.resize(sizeof(Header));
  bytes.insert(bytes.end(), key.begin(), key.end());
  mean.save(bytes);
  Header h{};
  std::memcpy(h.magic, kMagic, sizeof(kMagic));
  h.version = kVersion, h.byte_order = kByteOrder, h.passes = done;
  h.key_bytes = key.size();
  h.mean_bytes = bytes.size() - sizeof(Header) - h.key_bytes;
  film.save(bytes);
  h.film_bytes = bytes.size() - sizeof(Header) - h.key_bytes - h.mean_bytes;
  h.checksum = checksum(h, std::span(bytes).subspan(sizeof(Header)));
  std::memcpy(bytes.data(), &h, sizeof(h));
  return bytes;
}

uint32_t load_passes(const std::vector<uint8_t>& bytes, const std::string& key, PassMean& mean, Film& film) {
  Header h{};
  if (bytes.size() < sizeof(h)) fail_checkpoint("it is too short to be one");
  std::memcpy(&h, bytes.data(), sizeof(h));
  if (std::memcmp(h.magic, kMagic, sizeof(kMagic)) != 0) fail_checkpoint("it does not begin as one");
  if (h.version != kVersion || h.byte_order != kByteOrder)
    fail_checkpoint("it is of version " + number_text(uint64_t{h.version}) + " or of another kind of machine");
  const auto body = std::span(bytes).subspan(sizeof(h));
  if (h.key_bytes > body.size() || h.mean_bytes > body.size() - h.key_bytes ||
      h.film_bytes != body.size() - h.key_bytes - h.mean_bytes || h.checksum != checksum(h, body))
    fail_checkpoint("it is cut short or damaged");
  const std::string made_for(body.begin(), body.begin() + static_cast<std::ptrdiff_t>(h.key_bytes));
  if (const auto differs = difference(made_for, key)) {
    if (differs->name == kInstructions)
      fail_checkpoint("it was made with " + differs->saved + " instructions; this processor renders with " +
                      differs->now + ", which rounds otherwise");
    fail_checkpoint("it was made for another scene, size, integrator or parameters: " + differs->text());
  }
  if (h.passes == 0 || h.passes > UINT32_MAX || !mean.load(body.subspan(h.key_bytes, h.mean_bytes)) ||
      !film.load(body.subspan(h.key_bytes + h.mean_bytes)))
    fail_checkpoint("it does not fit the film");
  return static_cast<uint32_t>(h.passes);
}

std::string passes_key(const Scene& scene, const std::string& integrator, const Params& params,
                       const VplSet* host_lights, const FrameOptions& frame, const PassOptions& options) {
  // What is not added stops the render, or does not touch the image.
  const auto& [passes, max_seconds, target_error, confidence, checkpoints, groups, resume] = options;
  Identity key;
  key.add("version", std::string(LUMICUT_VERSION_TEXT));
  key.add("integrator", integrator);
  key.add(params);
  key.add_fields(frame);
  key.add("confidence", confidence);
  key.add("groups", groups);
  key.add_virtual_lights(host_lights);
  key.add(scene, true);
  key.add(kInstructions, instruction_class(scene));  // after the accel, on which it depends
  return key.text();
}

}  // namespace lumicut
