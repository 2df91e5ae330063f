// Level 3: integrators, their parameters, and shading of a host's points. Their lights: capi_lights.cpp.
#include <map>

#include "integrators/traits.h"
#include "plugin/check.h"
#include "plugin/convert.h"
#include "plugin/descriptors.h"
#include "plugin/objects.h"

using namespace lumicut;

static_assert(sizeof(lumicut_point) == 64);

namespace {

const IntegratorEntry& entry_named(const char* id) {
  if (id == nullptr) fail_argument("integrator: id is NULL");
  if (const IntegratorEntry* entry = find_integrator(id)) return *entry;
  std::string known;
  for (const IntegratorEntry& e : integrators()) known += (known.empty() ? "" : ", ") + std::string(e.id);
  fail_argument(std::string("integrator: \"") + id + "\" is not known; there are: " + known);
}

uint32_t trait_flags(const IntegratorEntry& entry, const IntegratorTraits& t) {
  uint32_t flags = 0;
  if (entry.light_source == LightSource::virtual_lights)
    flags |= LUMICUT_VIRTUAL_LIGHTS | LUMICUT_LIGHT_GROUPS | LUMICUT_COMPENSATION;
  if (t.saved_state) flags |= LUMICUT_SAVED_STATE;
  if (t.view_independent) flags |= LUMICUT_VIEW_INDEPENDENT;
  if (t.all_lights) flags |= LUMICUT_ALL_LIGHTS;
  return flags;
}

// First and last points of each batch. A pixel's points stay together, and batches depend on the input alone.
std::vector<std::pair<uint64_t, uint64_t>> batches_of(const lumicut_point* points, uint64_t count, uint64_t wanted) {
  std::vector<std::pair<uint64_t, uint64_t>> batches;
  for (uint64_t first = 0; first < count;) {
    uint64_t last = std::min(count, first + wanted);
    while (last < count && points[last].pixel == points[last - 1].pixel) ++last;
    batches.emplace_back(first, last);
    first = last;
  }
  return batches;
}

}  // namespace

lumicut_result lumicut_get_integrator_info(uint32_t index, lumicut_integrator_info* info) {
  return guard([&] {
    const auto all = integrators();
    if (index >= all.size())
      fail_argument("lumicut_get_integrator_info: index " + number_text(uint64_t{index}) +
                    " is out of range: there are " + number_text(uint64_t{all.size()}) + " integrators");
    const IntegratorEntry& e = all[index];
    lumicut_integrator_info out{};
    out.param_count = static_cast<uint32_t>(effective_params(e).size());
    out.id = e.id, out.label = e.label, out.description = e.description, out.source = e.source;
    const IntegratorTraits t = traits(e);
    out.traits = trait_flags(e, t);
    out.interactive = t.interactive, out.preview = t.preview, out.draft = t.draft, out.good = t.good;
    out.reference = t.reference;
    write(info, out);
  });
}

lumicut_result lumicut_get_param_info(const char* integrator, uint32_t index, lumicut_param_info* info) {
  return guard([&] {
    const IntegratorEntry& e = entry_named(integrator);
    const std::vector<const Param*> params = effective_params(e);
    if (index >= params.size())
      fail_argument("lumicut_get_param_info: index " + number_text(uint64_t{index}) + " is out of range: " + e.id +
                    " has " + number_text(uint64_t{params.size()}) + " parameters");
    const ParamInfo& p = *params[index];  // its texts stay
    lumicut_param_info out{};
    out.type = static_cast<uint32_t>(p.type);
    out.id = p.id, out.label = p.label, out.description = p.description, out.unit = p.unit;
    out.choices = p.choices, out.default_text = p.default_text.c_str();
    out.minimum = p.minimum, out.maximum = p.maximum;
    write(info, out);
  });
}

lumicut_result lumicut_integrator_create(lumicut_device device, const char* id, lumicut_integrator* integrator) {
  return guard([&] {
    lumicut_device_t& d = object(device);
    const IntegratorEntry& e = entry_named(id);
    if (integrator == nullptr) fail_argument("lumicut_integrator_create: integrator is NULL");
    *integrator = new lumicut_integrator_t(d, e);
  });
}

lumicut_result lumicut_integrator_set(lumicut_integrator integrator, const char* name, const char* value) {
  return guard([&] {
    lumicut_integrator_t& i = object(integrator);
    if (name == nullptr || value == nullptr) fail_argument("lumicut_integrator_set: name or value is NULL");
    const AccessGuard::Hold hold = i.gate.change("lumicut_integrator_set");
    i.params.set(name, value);
    if (i.entry.light_source == LightSource::emitters && i.params.find(name)->of_virtual_lights)
      i.device->log(LogLevel::warning,
                    std::string("parameter ") + name + " has no effect: " + i.entry.id + " has no virtual lights");
  });
}

const char* lumicut_integrator_get(lumicut_integrator integrator, const char* name) {
  const char* text = nullptr;
  guard([&] {
    lumicut_integrator_t& i = object(integrator);
    if (name == nullptr) fail_argument("lumicut_integrator_get: name is NULL");
    const std::string* value = i.params.text(name);
    if (value == nullptr) fail_argument(std::string("lumicut_integrator_get: no parameter \"") + name + "\"");
    text = value->c_str();
  });
  return text;
}

lumicut_result lumicut_integrator_prepare(lumicut_integrator integrator, lumicut_scene scene) {
  return guard([&] {
    lumicut_integrator_t& i = object(integrator);
    lumicut_scene_t& s = object(scene);
    const AccessGuard::Hold changing = i.gate.change("lumicut_integrator_prepare");
    const AccessGuard::Hold reading = s.gate.read("lumicut_integrator_prepare");
    s.require_committed();
    auto stats = std::make_unique<Stats>();
    run_work(i.work, [&](Progress& progress) { i.device->arena.run([&] { i.prepare_for(s, progress, *stats); }); });
    i.stats = std::move(stats);
  });
}

lumicut_result lumicut_integrator_shade(lumicut_integrator integrator, const lumicut_point* points, uint64_t count,
                                        float* radiance) {
  return guard([&] {
    lumicut_integrator_t& i = object(integrator);
    if (count > 0 && (points == nullptr || radiance == nullptr))
      fail_argument("lumicut_integrator_shade: points or radiance is NULL, but count is " + number_text(count));
    const AccessGuard::Hold using_integrator = i.gate.read("lumicut_integrator_shade");
    if (i.prepared == nullptr) fail_state("lumicut_integrator: it is not prepared");
    const Prepared& p = *i.prepared;
    lumicut_scene_t& s = i.prepared_scene();
    const AccessGuard::Hold using_scene = s.gate.read("lumicut_integrator_shade");
    if (s.changed || p.scene_version != s.scene.version())
      fail_state("lumicut_integrator: its scene was changed since lumicut_integrator_prepare");
    const std::shared_ptr<Progress> progress = i.work.share();
    const CurrentWork current(progress.get());
    const Scene& scene = s.scene;
    i.device->arena.run([&] {
      check_points(scene, points, count);
      const auto batches = batches_of(points, count, std::max<size_t>(1, p.method->batch_size()));
      parallel_chunks(batches.size(), 1, [&](size_t b, size_t) {
        progress->check();
        const auto [first, last] = batches[b];
        ShadePoints batch;
        batch.reserve(last - first);
        const std::vector<uint64_t> starts = append_points(scene, points, first, last, batch);
        batch.finish();
        std::vector<Rgb> light(batch.size());
        p.method->shade(batch, light, {}, {*progress, *i.stats});
        if (p.nearby != nullptr) {
          TracedPoints hits;
          Counters counters;
          p.nearby->trace(batch, {1, false, true}, *progress, hits, counters);
          for (size_t k = 0; k < hits.light.size(); ++k) light[hits.pixel[k]] += hits.light[k];
          i.stats->add(counters);
        }
        progress->check();
        for (size_t k = 0; k < starts.size(); ++k) {
          const size_t end = k + 1 < starts.size() ? starts[k + 1] : light.size();
          Rgb sum = light[starts[k]];
          for (size_t of = starts[k] + 1; of < end; ++of) sum += light[of];
          light[k] = sum;
        }
        light.resize(last - first);
        std::memcpy(radiance + 3 * first, light.data(), light.size() * sizeof(Rgb));
      });
    });
  });
}
