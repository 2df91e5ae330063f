#include "render/checkpoint.h"

#include <cstring>

#include "core/number_text.h"
#include "render/identity.h"

namespace lumicut {

namespace {

constexpr char kMagic[8] = {'L', 'U', 'M', 'I', 'C', 'U', 'T', 'P'};
constexpr char kInstructions[] = "instructions";
constexpr uint32_t kVersion = 3, kByteOrder = 0x01020304u;

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

[[noreturn]] void fail_checkpoint(const std::string& what) { fail_argument("lumicut_render_desc.checkpoint: " + what); }

}  // namespace

std::vector<uint8_t> save_checkpoint(const std::string& key, uint32_t done, const IterationMean& mean,
                                     const Film& film) {
  std::vector<uint8_t> bytes;
  const uint64_t pixels = uint64_t{film.crop().width()} * film.crop().height();
  bytes.reserve(sizeof(Header) + key.size() +
                pixels * (IterationMean::pixel_bytes(film.has(Channel::denoised)) +
                          film_pixel_bytes(film.groups().size(), film.has(Channel::denoised))));
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

uint32_t load_checkpoint(const std::vector<uint8_t>& bytes, const std::string& key, IterationMean& mean, Film& film) {
  Header h{};
  if (bytes.size() < sizeof(h)) fail_checkpoint("it is too short to be one");
  std::memcpy(&h, bytes.data(), sizeof(h));
  if (std::memcmp(h.magic, kMagic, sizeof(kMagic)) != 0) fail_checkpoint("it does not begin as one");
  if (h.version != kVersion || h.byte_order != kByteOrder)
    fail_checkpoint("it is of version " + number_text(uint64_t{h.version}) + " instead of " +
                    number_text(uint64_t{kVersion}) + ", or of another kind of machine: begin anew");
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

std::string checkpoint_key(const Scene& scene, const std::string& integrator, const Params& params,
                           const VplSet* host_lights, const FrameOptions& frame, const IterationOptions& options) {
  // What is not added stops the render, or does not touch the image.
  const auto& [count, max_seconds, target_error, confidence, checkpoints, groups, keep_fireflies, resume] = options;
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
