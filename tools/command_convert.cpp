// lumicut convert: any scene file to the project's own, with its meshes and textures beside it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "io/atomic_file.h"
#include "io/scene_writer.h"
#include "tools/commands.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

namespace {

struct Options {
  std::string scene, output;
  bool strict = false;
};

void convert(const Options& o) {
  if (!o.output.ends_with(".json")) throw UsageError(fmt::format("{}: the scene to write must end in .json", o.output));
  io::check_distinct({o.output}, {o.scene});
  io::check_writable(o.output);
  const io::SceneData scene = read_scene_file(o.scene);
  tell_warnings(scene.warnings, o.scene, o.strict);
  stop_if_interrupted();
  io::write_scene(scene, o.output);
  fmt::print("{}: {} meshes of {} triangles, {} materials, {} lights, {} textures\n", o.output, scene.meshes.size(),
             scene.triangle_count(), scene.materials.size(), scene.lights.size(), scene.textures.size());
}

}  // namespace

void add_convert(CLI::App& app) {
  auto* command = app.add_subcommand("convert", "Write any scene file as JSON, which renders to the same image");
  const auto o = std::make_shared<Options>();
  command->add_option("scene", o->scene, kSceneHelp)->required();
  command
      ->add_option("output", o->output, "NAME.json to write; meshes and textures go to the folder NAME_files beside it")
      ->required();
  command->add_flag("--strict", o->strict, "Take what is only warned of in files as an error");
  command->footer("Example: lumicut convert room.fbx room.json");
  command->callback([o] {
    catch_interrupts();
    convert(*o);
  });
}

}  // namespace lumicut::tools
