// Level 4: whole frames.
#include "plugin/check.h"
#include "plugin/convert.h"
#include "plugin/descriptors.h"
#include "plugin/render_job.h"

using namespace lumicut;

namespace {

const ChannelInfo& channel_named(const char* name) {
  if (name == nullptr) fail_argument("lumicut_render_read: channel is NULL");
  std::string known;
  for (const ChannelInfo& c : channel_table()) {
    if (std::strcmp(c.name, name) == 0) return c;
    known += (known.empty() ? "" : ", ") + std::string(c.name);
  }
  fail_argument(std::string("lumicut_render_read: channel \"") + name + "\" is not known; there are: " + known);
}

// Index of the group whose channel that is; none: no such channel.
std::optional<size_t> group_named(const char* name, const std::vector<uint32_t>& groups) {
  if (name == nullptr) return std::nullopt;
  for (size_t g = 0; g < groups.size(); ++g)
    if (name == "radiance." + number_text(uint64_t{groups[g]})) return g;
  return std::nullopt;
}

}  // namespace

lumicut_result lumicut_get_channel_info(uint32_t index, lumicut_channel_info* info) {
  return guard([&] {
    const auto table = channel_table();
    if (index >= table.size())
      fail_argument("lumicut_get_channel_info: index " + number_text(uint64_t{index}) + " is out of range: there are " +
                    number_text(uint64_t{table.size()}) + " channels");
    lumicut_channel_info out{};
    out.components = table[index].components;
    out.name = table[index].name, out.description = table[index].description;
    write(info, out);
  });
}

lumicut_result lumicut_render_start(lumicut_integrator integrator, lumicut_scene scene, const lumicut_render_desc* desc,
                                    lumicut_render* render) {
  return guard([&] {
    lumicut_integrator_t& i = object(integrator);
    lumicut_scene_t& s = object(scene);
    if (render == nullptr) fail_argument("lumicut_render_start: render is NULL");
    const lumicut_render_desc d = read(desc);
    *render = new lumicut_render_t(i, s, to_frame_options(d), to_pass_options(d));
  });
}

lumicut_result lumicut_render_wait(lumicut_render render, uint32_t milliseconds, lumicut_status* status) {
  return guard([&] {
    lumicut_render_t& r = object(render);
    const std::exception_ptr failure = r.wait(milliseconds);
    if (status != nullptr) write(status, r.status());
    if (failure) std::rethrow_exception(failure);
  });
}

lumicut_result lumicut_render_next_tile(lumicut_render render, lumicut_tile* tile) {
  return guard([&] {
    lumicut_render_t& r = object(render);
    write(tile, lumicut_tile{});  // a wrong structure must not cost a tile
    const Rect rect = r.next_tile();
    write(tile, {0, rect.x0, rect.y0, rect.x1, rect.y1});
  });
}

lumicut_result lumicut_render_read(lumicut_render render, const char* channel, const lumicut_tile* rect, float* out) {
  return guard([&] {
    lumicut_render_t& r = object(render);
    const std::optional<size_t> group = group_named(channel, r.groups());
    if (!group) channel_named(channel);
    if (out == nullptr) fail_argument("lumicut_render_read: out is NULL");
    const Rect part = part_of(r.options.crop, rect);
    if (group)
      r.read_group(*group, part, out);
    else
      r.read(channel_named(channel), part, out);
  });
}

lumicut_result lumicut_render_groups(lumicut_render render, const uint32_t** groups, uint64_t* count) {
  return guard([&] {
    const lumicut_render_t& r = object(render);
    if (groups == nullptr || count == nullptr) fail_argument("lumicut_render_groups: groups or count is NULL");
    *groups = r.groups().data(), *count = r.groups().size();
  });
}

lumicut_result lumicut_render_checkpoint(lumicut_render render, const void** data, uint64_t* size) {
  return guard([&] {
    lumicut_render_t& r = object(render);
    if (data == nullptr || size == nullptr) fail_argument("lumicut_render_checkpoint: data or size is NULL");
    const std::vector<uint8_t>& bytes = r.checkpoint();
    *data = bytes.data(), *size = bytes.size();
  });
}
