#include "io/mitsuba_upgrade.h"

#include <cctype>
#include <cstdlib>
#include <string>
#include <vector>

namespace lumicut::io {

namespace {

using Node = pugi::xml_node;

// toWorld: to_world; intIOR: int_ior.
std::string with_underscores(std::string name) {
  if (const size_t at = name.find("IOR"); at != std::string::npos) name.replace(at, 3, at > 0 ? "_ior" : "ior");
  std::string out;
  for (const char c : name) {
    if (std::isupper(static_cast<unsigned char>(c))) {
      if (!out.empty() && out.back() != '_') out += '_';
      out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    } else {
      out += c;
    }
  }
  return out;
}

// uscale, vscale, uoffset, voffset: a transform.
void upgrade_texture(Node texture) {
  const char* const names[2][2] = {{"uscale", "vscale"}, {"uoffset", "voffset"}};
  std::string steps[2][2] = {{"1", "1"}, {"0", "0"}};
  bool any = false;
  std::vector<Node> gone;
  for (const Node& c : texture.children())
    for (size_t kind = 0; kind < 2; ++kind)
      for (size_t axis = 0; axis < 2; ++axis)
        if (std::string(c.attribute("name").value()) == names[kind][axis])
          steps[kind][axis] = c.attribute("value").value(), any = true, gone.push_back(c);
  for (const Node& c : gone) texture.remove_child(c);
  if (!any) return;
  Node transform = texture.append_child("transform");
  transform.append_attribute("name") = "to_uv";
  for (size_t kind = 0; kind < 2; ++kind) {
    Node step = transform.append_child(kind == 0 ? "scale" : "translate");
    step.append_attribute("x") = steps[kind][0].c_str();
    step.append_attribute("y") = steps[kind][1].c_str();
  }
}

void upgrade(Node node) {
  const std::string element = node.name();
  if (element == "lookAt") node.set_name("lookat");
  if (element != "default")
    if (auto name = node.attribute("name")) name.set_value(with_underscores(name.value()).c_str());
  if (element == "bsdf" && std::string(node.attribute("type").value()) == "diffuse")
    for (Node c : node.children())
      if (std::string(c.attribute("name").value()) == "diffuseReflectance") c.attribute("name") = "reflectance";
  if (element == "texture") upgrade_texture(node);
}

}  // namespace

void upgrade_mitsuba(Node scene) {
  if (std::atof(scene.attribute("version").value()) >= 2) return;
  struct Walker : pugi::xml_tree_walker {
    bool for_each(Node& node) override {
      if (node.type() == pugi::node_element) upgrade(node);
      return true;
    }
  } walker;
  scene.traverse(walker);
}

}  // namespace lumicut::io
